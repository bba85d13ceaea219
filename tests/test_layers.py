"""Imports go one way: no module imports from a layer above its own, and none imports itself in a circle."""

import ast
import graphlib
import importlib.util
from pathlib import Path

import pytest

import scengen

LAYERS = (
    ("errors", "geometry", "installation", "compat", "certificate"),
    ("decisions", "html_tables", "orientation", "params", "physics", "symmetry"),
    ("robots",),
    ("control", "look"),
    ("sim",),
    ("assets", "means"),
    ("predicates", "scenario"),
    ("episode", "skills", "samplers"),
    ("tasks", "work"),
    ("pool", "perturb"),
    ("validate",),
    ("attack", "compose", "pictures"),
    ("evidence", "runs", "envs", "intake"),
    ("export", "bench"),
    ("learn", "drift"),
    ("evaluate",),
    ("agents", "ood"),
    ("demos", "conformance"),
    ("measures",),
    ("cli", "studio"),
    ("site", "__init__", "__main__"),
)
"""Packages and modules of scengen from the ground up. Those of one line must not import each other."""
WINGS = {
    "core": """errors geometry installation compat decisions html_tables orientation params physics symmetry robots
        control look sim assets means predicates scenario episode skills samplers tasks work compose perturb""",
    "proof": "certificate validate attack evidence conformance measures",
    "data": "pool runs demos export intake",
    "study": "learn evaluate ood agents bench drift",
    "face": "pictures envs studio site cli __init__ __main__",
}
"""The same packages and modules by what they are for."""
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}
ROOT = Path(scengen.__file__).parent


def modules():
    """Every module's dotted name and file."""
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        yield ".".join(("scengen", *parts)).removesuffix(".__init__"), path


MODULES = dict(modules())


def statements(node, types):
    """Everything in a syntax tree, on request without what only type checkers read."""
    yield node
    if types or not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"):
        for child in ast.iter_child_nodes(node):
            yield from statements(child, types)


def imports(name, types=True):
    """The modules of scengen that a module imports, whether at its top, in a function or for types alone."""
    path = MODULES[name]
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in statements(ast.parse(path.read_text()), types):
        if isinstance(node, ast.ImportFrom):
            told = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(told, package) if node.level else told
            for alias in node.names:
                target = f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
                if target in MODULES and target != name:
                    yield target
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)


def room(name):
    """The package, or the loose module, that a module belongs to."""
    return name.split(".")[1] if "." in name else "__init__"


@pytest.mark.parametrize("name", MODULES)
def test_imports_point_down(name):
    here = room(name)
    assert here in HEIGHT, f"{here} has no layer"
    up = [t for t in imports(name) if room(t) != here and HEIGHT[room(t)] >= HEIGHT[here]]
    assert not up or here == "__init__", f"{name} imports {', '.join(up)} from its own layer or above"


def test_each_package_is_in_one_wing():
    assert sorted(name for names in WINGS.values() for name in names.split()) == sorted(HEIGHT)
    assert {room(name) for name in MODULES} == set(HEIGHT)


def test_no_circles():
    """Imports for types alone are never executed, so they may close a circle within a package."""
    graph = {name: {t for t in imports(name, types=False) if t != "scengen"} for name in MODULES if name != "scengen"}
    assert len(list(graphlib.TopologicalSorter(graph).static_order())) == len(graph)


def test_an_import_that_points_up_is_seen():
    """The negative control: the certifier is above the skills."""
    assert HEIGHT["validate"] > HEIGHT["skills"]
    assert "scengen.episode" in set(imports("scengen.validate.rollout"))
    for types in (True, False):
        assert ("scengen.sim.world" in imports("scengen.sim.arm", types)) == types


def test_task_families_are_flat_and_found_by_their_files_alone():
    """Ids hash the module's path; nothing else imports a family."""
    assert {p.parent for p in (ROOT / "tasks").rglob("*.py")} == {ROOT / "tasks"}
    assert not [n for n in MODULES if room(n) != "tasks" for t in imports(n) if t.startswith("scengen.tasks.")]


def test_contributing_draws_every_package_in_its_wing():
    drawn = (ROOT.parent / "CONTRIBUTING.md").read_text().partition("```\nscengen/\n")[2].partition("```")[0]
    found, wing = {name: set() for name in WINGS}, ""
    for line in drawn.splitlines():
        names = line[:50].split()
        wing = names[0] if line[2] != " " else wing
        found[wing] |= {*names}
    for name, told in WINGS.items():
        assert {*told.split()} - {"__init__", "__main__"} <= found[name], name
