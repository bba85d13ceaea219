"""The hash of a family's code changes with anything that its certificates depend on, and with nothing else."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

FOREIGN = Path(__file__).parents[1] / "foreign"
HASH = """
import sys
from scengen import load_task
from scengen.validate.identity import source_sha256
print(source_sha256(load_task("push_block", ("hydra.searchpath=[file://" + sys.argv[1] + "/foreign/conf]",)).family))
"""


def source_hash(folder):
    """The hash as a fresh process finds it: imports and hashes are remembered within one."""
    done = subprocess.run([sys.executable, "-c", HASH, folder], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A copy of the foreign package whose task takes a constant from a helper in yet another package."""
    folder = tmp_path_factory.mktemp("foreign")
    shutil.copytree(FOREIGN, folder / "foreign", ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "helpers_of_others").mkdir()
    (folder / "helpers_of_others" / "__init__.py").write_text('"""Constants."""\n')
    (folder / "helpers_of_others" / "numbers.py").write_text("MARGIN = 0.01\n")
    task = folder / "foreign" / "push_block.py"
    task.write_text(task.read_text() + "\nfrom helpers_of_others.numbers import MARGIN  # noqa: E402, F401\n")
    return folder


def changed(path, old, new):
    """Edit a file."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.slow
def test_a_constant_in_a_helper_of_another_package_expires_a_certificate(package):
    before = source_hash(package)
    changed(package / "helpers_of_others" / "numbers.py", "0.01", "0.02")
    after = source_hash(package)
    assert before != after
    changed(package / "helpers_of_others" / "numbers.py", "MARGIN = 0.02", "# twice as much as before\nMARGIN = 0.02")
    changed(package / "helpers_of_others" / "__init__.py", "Constants.", "Constants of others.")
    assert source_hash(package) == after, "comments and docstrings do not count"


def test_everything_below_a_family_is_in_its_hash():
    from scengen.tasks.domino_single import DominoSingle
    from scengen.validate import identity

    files, installed = identity._sources(DominoSingle.__module__, *identity.JUDGES)
    below = "skills.motion skills.jaw predicates geometry robots.jaw robots.panda assets.box assets.prop control.osc"
    assert {f"scengen.{name}" for name in below.split()} <= files.keys()
    assert not installed and not any(name.startswith(("numpy", "mujoco", "scengen.tasks.pack")) for name in files)


def test_oracle_and_features_of_the_family_alone_do_not_count(tmp_path):
    from scengen.validate.identity import _essence

    def written(name, oracle, success):
        path = tmp_path / name
        path.write_text(f"class A:\n    def oracle(self): return {oracle}\n    def success(self): return {success}\n")
        return path

    family = written("family.py", 1, 2)
    other_oracle, other_success = written("oracle.py", 3, 2), written("success.py", 1, 4)
    assert _essence(other_oracle, "A") == _essence(family, "A") != _essence(other_success, "A")
    assert _essence(other_oracle, "") != _essence(family, "")


def test_the_hash_of_code_is_the_same_in_every_python(tmp_path):
    """Pinned: Python 3.11 and 3.12 write this f-string with other quotes, and parse it alike."""
    import hashlib

    from scengen.validate.identity import _essence

    path = tmp_path / "family.py"
    path.write_text("def told(names: list[str]) -> str:\n    return f\"known: {', '.join(names):>{len(names)}}\"\n")
    assert hashlib.sha256(_essence(path, "").encode()).hexdigest()[:16] == "2838ff990e47804c"
