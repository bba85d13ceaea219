"""What a certificate was made with: versions, the code of the family, and how this machine rounds."""

import ast
import hashlib
import importlib.metadata
import importlib.util
import inspect
import platform
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np

from ..assets.box import Domino
from ..assets.prop import TABLE_TOP, place, table
from ..errors import PoolError
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.world import World


@cache
def versions() -> dict[str, str]:
    """Versions of everything that the physics depends on."""
    packages = {p: importlib.metadata.version(p) for p in ("scengen", "mujoco", "robosuite", "numpy")}
    return {**packages, "platform": f"{platform.system()}-{platform.machine()}"}


def check_versions(made: Mapping[str, str], where: str) -> None:
    """Refuse what was certified with another MuJoCo or robosuite than the installed one.

    Raises:
        PoolError: one of them differs.
    """
    for package in ("mujoco", "robosuite"):
        if made[package] != versions()[package]:
            raise PoolError(
                f"{where} was certified with {package} {made[package]}, this is {versions()[package]}; install that "
                "version, or run scengen verify and certify the pool again"
            )


@cache
def fingerprint() -> str:
    """How this machine rounds: a hash of the end of a fixed short rollout of the arm and a falling tile.

    Machines with equal fingerprints replay bit by bit; on others (another libm, another instruction set) the same
    actions ends in nearly the same state.
    """
    scene = table()
    place(scene, Domino(), "tile", [0.1, 0.0, TABLE_TOP + 0.01], yaw=0.3)
    world = World.load(scene_text.emit(scene)[0])
    for k in range(30):
        world.step(np.array([np.sin(0.3 * k), np.cos(0.2 * k), -0.5, 0.1, -0.2, 0.3, 1.0]))
    return world.digest


@cache
def source_sha256(family: type[Scenario]) -> str:
    """Hash of the code that gives a family its meaning: its module and the assets that it uses.

    Comments, docstrings, formatting and the methods `oracle` and `features` do not count: a certificate rests on the
    witness, not on how it was found or how its scene is described.
    """
    text = "".join(_essence(path) for path in _sources(inspect.getmodule(family)))
    return hashlib.sha256(text.encode()).hexdigest()


def _sources(module: ModuleType | None) -> list[Path]:
    """The module's file and, in order of their names, the files of `scengen.assets` that it imports."""
    assert module is not None and module.__file__
    found: dict[str, Path] = {}
    todo = [(module.__name__, Path(module.__file__))]
    while todo:
        name, path = todo.pop()
        if name in found:
            continue
        found[name] = path
        todo.extend((n, p) for n, p in _imports(name, path) if n.startswith("scengen.assets."))
    return [found.pop(module.__name__), *(found[name] for name in sorted(found))]


def _imports(name: str, path: Path) -> list[tuple[str, Path]]:
    package = name.rpartition(".")[0]
    names = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            target = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            names += [target, *(f"{target}.{alias.name}" for alias in node.names)]
    specs = [(n, _find(n)) for n in names if n.startswith("scengen.assets.")]
    return [(n, p) for n, p in specs if p]


def _find(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    return Path(spec.origin) if spec and spec.origin else None


def _essence(path: Path) -> str:
    """The code of a file without comments, docstrings, `oracle` and `features`."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [s for s in body if not _beside_the_point(s)] or [ast.Pass()]  # type: ignore[attr-defined]
    return ast.unparse(tree)


def _beside_the_point(statement: ast.stmt) -> bool:
    documents = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    return documents or (isinstance(statement, ast.FunctionDef) and statement.name in ("oracle", "features"))
