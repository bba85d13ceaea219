"""Code and versions that a certificate depends on."""

import ast
import hashlib
import importlib.metadata
import importlib.util
import inspect
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path

from ..errors import OtherVersions
from ..installation import versions
from ..scenario import Scenario


def check_versions(made: Mapping[str, str], where: str) -> None:
    """Refuse a pool that was certified with a MuJoCo or robosuite that differs from the installed one.

    Raises:
        OtherVersions: one of them differs.
    """
    for package in ("mujoco", "robosuite"):
        if made[package] != versions()[package]:
            raise OtherVersions(
                f"{where} was certified with {package} {made[package]}, this is {versions()[package]}; install that "
                "version, or certify the pool again (scengen verify mujoco=any shows what holds here)"
            )


JUDGES = ("scengen.episode", "scengen.validate.rollout", "scengen.validate.certify")
"""Modules that decide the verdict of a certificate, besides those that a family imports."""


@cache
def source_sha256(family: type[Scenario]) -> str:
    """Hash of the code that a certificate depends on: the family's module, and everything below it.

    Imports are followed through scengen, the family's own package and any other source files on the path: assets,
    skills, predicates, modules of third parties. An installed distribution counts by its name and version. The
    distributions that scengen itself depends on are listed in `versions` instead, and the standard library does not
    count. Comments, docstrings, formatting and the methods `oracle` and `features` of the family do not count: a
    certificate rests on the witness, not on how it was found or how its scene is described.
    """
    module = inspect.getmodule(family)
    assert module is not None
    files, installed = _sources(module.__name__, *JUDGES)
    parts = [_essence(path, family.__name__ if name == module.__name__ else "") for name, path in sorted(files.items())]
    return hashlib.sha256("\n".join([*parts, *sorted(installed)]).encode()).hexdigest()


@cache
def packages(family: type[Scenario]) -> Mapping[str, str]:
    """Versions of the installed distributions that the code of a certificate imports, by name."""
    module = inspect.getmodule(family)
    assert module is not None
    files, _ = _sources(module.__name__, *JUDGES)
    tops = {imported.partition(".")[0] for name, path in files.items() for imported in _imports(name, path)}
    own = {name.partition(".")[0] for name in files}
    found = {}
    for top in tops - own - sys.stdlib_module_names:
        for name in _distributions().get(top, [top]):  # a module of one compiled file is not listed
            with suppress(importlib.metadata.PackageNotFoundError):
                found[name] = importlib.metadata.version(name)
    return found


def _sources(*names: str) -> tuple[dict[str, Path], set[str]]:
    """Files of some modules and of all their imports, by module; and installed distributions, as `name version`."""
    own = {name.partition(".")[0] for name in names}
    files: dict[str, Path] = {}
    installed: set[str] = set()
    todo = [("", name) for name in names]
    while todo:
        importer, name = todo.pop()
        top = name.partition(".")[0]
        ours = importer.startswith("scengen.") and top != "scengen"  # what scengen needs is listed in `versions`
        if name in files or ours or top in sys.stdlib_module_names or not (path := _file(name)):
            continue
        if top not in own and (distributions := _distributions().get(top)):
            installed.update(f"{d} {importlib.metadata.version(d)}" for d in distributions if d not in _dependencies())
            continue
        files[name] = path
        todo.extend((name, imported) for imported in _imports(name, path))
    return files, installed


@cache
def _imports(name: str, path: Path) -> tuple[str, ...]:
    """Names that a file imports anywhere in it; of `from a import b` both `a` and `a.b`, which may be a module."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(module, package) if node.level else module
            found += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return tuple(found)


@cache
def _file(name: str) -> Path | None:
    """The Python file of a module; None if there is none, for instance because the name is not a module."""
    try:
        spec = importlib.util.find_spec(name)
    except (ModuleNotFoundError, ValueError):
        return None
    return Path(spec.origin) if spec and spec.origin and spec.origin.endswith(".py") else None


@cache
def _distributions() -> Mapping[str, list[str]]:
    """Installed distributions by the package that they provide."""
    return importlib.metadata.packages_distributions()


@cache
def _dependencies() -> frozenset[str]:
    """Names of the distributions that scengen depends on."""
    return frozenset(re.split(r"[^\w.-]", line, maxsplit=1)[0] for line in importlib.metadata.requires("scengen") or [])


@cache
def _essence(path: Path, family: str) -> str:
    """The code of a file without comments and docstrings, and without `oracle` and `features` of the class `family`.

    It is written as nested lists, because `ast.unparse` of Python 3.12 has other quotes in f-strings than that of 3.11.
    """
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            spared = isinstance(node, ast.ClassDef) and node.name == family
            node.body = [s for s in body if not _ignored(s, spared)] or [ast.Pass()]  # type: ignore[attr-defined]
    return repr(_plain(tree))


def _plain(node: object) -> object:
    """A syntax tree as lists, without empty fields, of which later Pythons have more."""
    if isinstance(node, ast.JoinedStr):  # Python 3.12.1 adds empty texts to some
        return ["JoinedStr", [_plain(v) for v in node.values if not (isinstance(v, ast.Constant) and v.value == "")]]
    if isinstance(node, ast.AST):
        parts = [(name, _plain(value)) for name, value in ast.iter_fields(node) if value is not None and value != []]
        return [type(node).__name__, parts]
    return [_plain(each) for each in node] if isinstance(node, list) else repr(node)


def _ignored(statement: ast.stmt, of_family: bool) -> bool:
    """Whether a statement does not count: a docstring, or a method of the family that certificates do not rest on."""
    documents = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
    return documents or (
        of_family and isinstance(statement, ast.FunctionDef) and statement.name in ("oracle", "features")
    )
