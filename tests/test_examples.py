"""The examples are short and run as they are, and so does the notebook."""

import ast
import os
import subprocess
import sys

import helpers
import pytest

FOLDER = helpers.ROOT / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
MAX_LINES = 50
MAX_DOCSTRING_LINES = 3
PRINTED = {
    "01_look": "A film strip is in generated",
    "02_certify": "same final state: True",
    "03_own_axis": "refused: axis heavy_tiles",
    "04_own_task": "witness    passed",
    "05_policy": "the goal was not reached in 12 s",
    "06_vector_env": "object-state (16, ",
    "07_record": "[0, 1]",
    "08_train": "wrote generated/examples/evaluation",
    "09_mesh": "the scenario is certified",
    "10_perturbations": "as in a certificate       4 of 4 solved",
    "11_agent": "100.0 [16.5, 100.0]",
    "12_cluster": "the pools have the same bytes",
}
"""Text that each script prints."""
EXTRAS = {"08_train": ("sklearn", "train"), "09_mesh": ("coacd", "mesh"), "12_cluster": ("ray", "ray")}
"""Packages that scripts need, and the extras that install them."""
NEED_PICTURES = ("01_look", "09_mesh")
"""Scripts that draw."""
FOREIGN = ("DISPLAY", "WAYLAND_DISPLAY", "COLUMNS")
"""Variables of a test run that change what a script prints or opens."""
WITHOUT_DISPLAY = {name: value for name, value in os.environ.items() if name not in FOREIGN}


def script(path):
    """A script as a parameter of the test that runs it; no two clusters run at once."""
    return pytest.param(path, id=path.stem, marks=pytest.mark.xdist_group("cluster") if "cluster" in path.stem else ())


def test_there_are_twelve_and_the_page_lists_them():
    page = (FOLDER / "README.md").read_text()
    assert [path.stem for path in SCRIPTS] == list(PRINTED) and len(SCRIPTS) == 12
    assert all(f"[{path.name}]({path.name})" in page for path in (*SCRIPTS, FOLDER / "tour.ipynb"))


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_says_what_it_prints_and_uses_public_names(path):
    text = path.read_text()
    tree = ast.parse(text)
    told = ast.get_docstring(tree)
    assert len(text.splitlines()) <= MAX_LINES
    assert "Prints" in told and len(told.splitlines()) <= MAX_DOCSTRING_LINES
    imports = [
        node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module.startswith("scengen")
    ]
    parts = {part for node in imports for name in node.names for part in (*node.module.split("."), name.name)}
    assert not [part for part in parts if part.startswith("_")]


@pytest.mark.each_change
@pytest.mark.parametrize("path", [script(path) for path in SCRIPTS])
def test_a_script_runs_as_it_is(path, tmp_path):
    if path.stem in EXTRAS:
        package, extra = EXTRAS[path.stem]
        pytest.importorskip(package, reason=f"no {package}; it is in the extra {extra}")
    if path.stem in NEED_PICTURES and not helpers.pictures_are_possible():
        pytest.skip("no OpenGL on this machine")
    done = subprocess.run([sys.executable, path], cwd=tmp_path, env=WITHOUT_DISPLAY, capture_output=True, text=True)
    assert done.returncode == 0 and PRINTED[path.stem] in done.stdout, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert {found.name for found in tmp_path.iterdir()} <= {"generated"}


@pytest.mark.each_change
def test_the_notebook_runs_and_shows_tables_and_films():
    nbclient = pytest.importorskip("nbclient", reason="no nbclient; it is in the extra dev")
    pytest.importorskip("ipykernel", reason="no ipykernel; it is in the extra dev")
    if not helpers.pictures_are_possible():
        pytest.skip("no OpenGL on this machine")
    import nbformat

    notebook = nbformat.read(FOLDER / "tour.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": FOLDER}}).execute()
    shown = [output.data for cell in notebook.cells for output in cell.get("outputs", ()) if "data" in output]
    pages = "".join(data.get("text/html", "") for data in shown)
    assert pages.count("<table>") == 5 and pages.count("data:image/webp;base64,") == 3
    assert "True" in [data["text/plain"] for data in shown], "the replay ends in the same bits"


def test_the_notebook_is_stored_without_outputs():
    nbformat = pytest.importorskip("nbformat", reason="no nbformat; it is in the extra dev")
    cells = [cell for cell in nbformat.read(FOLDER / "tour.ipynb", as_version=4).cells if cell.cell_type == "code"]
    assert cells and not [cell for cell in cells if cell.outputs or cell.execution_count]
