"""docs/api.md: what the author of a task, an oracle or an axis calls, from signatures and docstrings. `make docs`

`python tools/api_page.py` writes the page; `tests/test_api_page.py` fails when it is not what stands there. Modules are
parsed, not imported, so that signatures stand as they were written.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "api.md"
MODULES = {
    "The family": ("scenario", "params", "symmetry", "orientation"),
    "The world": ("sim.world", "sim.memory", "predicates", "geometry", "physics"),
    "Moves": ("skills.motion", "skills.jaw", "skills.grip", "skills.suction", "skills.hook", "skills.handover"),
    "The robot": ("robots.jaw", "control.teleop"),
    "Distributions and draws": (
        "samplers.task",
        "samplers.axis",
        "samplers.split",
        "samplers.dists",
        "samplers.designs",
    ),
    "Playing and certifying": ("validate.rollout", "validate.certify", "validate.settings", "certificate"),
    "Checks and tests": ("conformance.rules", "conformance.frames", "errors"),
    "Assets": (
        "assets.prop",
        *(f"assets.{path.stem}" for path in sorted((ROOT / "scengen" / "assets").glob("[a-z]*.py"))),
    ),
}
"""What stands on the page, by heading."""
LEFT_OUT = ("assets.kits", "assets.mesh_prop")
"""Modules that list and find assets for commands."""
LONGEST = 80
"""Letters of a constant's value; a longer one is told by its docstring alone."""
SECTIONS = ("Args", "Returns", "Raises", "Yields")
HEAD = """# What authors of tasks call

Written by `make docs` from signatures and docstrings. SI units and radians, unless brackets say otherwise; world axes,
x away from the robot, y to its left, z up; quaternions wxyz. How the parts work together:
[CONTRIBUTING](../CONTRIBUTING.md), and the task that `scengen new` writes. Parameters of a task: `scengen tasks
task=NAME`; of all assets: `scengen asset`.
"""


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())
    print(f"wrote {PAGE.relative_to(ROOT)}")


def page() -> str:
    """The whole page."""
    found = {
        title: {name: _parsed(name) for name in dict.fromkeys(names) if name not in LEFT_OUT}
        for title, names in MODULES.items()
    }
    return "\n".join([HEAD, *_index(found), *_sections(found)])


def _parsed(name: str) -> ast.Module:
    return ast.parse(ROOT.joinpath("scengen", *name.split(".")).with_suffix(".py").read_text())


def _index(found: dict[str, dict[str, ast.Module]]) -> Iterator[str]:
    for title, modules in found.items():
        yield f"**{title}**\n"
        for name, module in modules.items():
            first = (ast.get_docstring(module) or "").split("\n\n")[0].replace("\n", " ")
            yield f"- [`scengen.{name}`](#{_anchor(name)}): {first}"
        yield ""


def _anchor(name: str) -> str:
    """The address that the heading of a module gets in Markdown."""
    return re.sub(r"[^\w-]", "", f"scengen.{name}".lower())


def _sections(found: dict[str, dict[str, ast.Module]]) -> Iterator[str]:
    for title, modules in found.items():
        yield f"# {title}\n"
        for name, module in modules.items():
            yield f"## `scengen.{name}`\n"
            yield f"{_text(module)}\n"
            yield from _members(module.body, title == "Assets" and name != "assets.prop")


def _members(body: list[ast.stmt], classes_alone: bool) -> Iterator[str]:
    """Public constants, functions and classes, in the order in which they stand."""
    for statement, following in zip(body, [*body[1:], None], strict=True):
        if classes_alone and not isinstance(statement, ast.ClassDef):
            continue
        if isinstance(statement, ast.FunctionDef) and _public(statement.name):
            yield f"### `{statement.name}{_signature(statement)}`\n"
            yield f"{_text(statement)}\n"
        elif isinstance(statement, ast.ClassDef) and _public(statement.name):
            yield from _class(statement)
        elif (told := _constant(statement, following)) is not None:
            yield told


def _class(node: ast.ClassDef) -> Iterator[str]:
    bases = [base for base in map(ast.unparse, node.bases) if base not in ("abc.ABC", "Protocol")]
    yield f"### class `{node.name}{f'({chr(44).join(bases)})' if bases else ''}`\n"
    yield f"{_text(node)}\n"
    fields = [
        told
        for statement, following in zip(node.body, [*node.body[1:], None], strict=True)
        if (told := _field(statement, following)) is not None
    ]
    yield from fields
    if fields:
        yield ""
    for statement in node.body:
        if isinstance(statement, ast.FunctionDef) and _public(statement.name) and ast.get_docstring(statement):
            marks = {ast.unparse(mark) for mark in statement.decorator_list}
            shown = statement.name
            if marks & {"property", "cached_property", "functools.cached_property"}:
                shown += f" -> {ast.unparse(statement.returns)}" if statement.returns else ""
            else:
                shown += _signature(statement)
            yield f"#### `{node.name}.{shown}`\n"
            yield f"{_text(statement)}\n"


def _field(statement: ast.stmt, following: ast.stmt | None) -> str | None:
    """A field of a dataclass, or an attribute, as an entry of a list."""
    if not isinstance(statement, (ast.AnnAssign, ast.Assign)) or (name := _target(statement)) is None:
        return None
    kind = f": {ast.unparse(statement.annotation)}" if isinstance(statement, ast.AnnAssign) else ""
    value = f" = {ast.unparse(statement.value)}" if statement.value is not None else ""
    told = _documents(following)
    return f"- `{name}{kind}{value if len(value) < LONGEST else ''}`{f': {told}' if told else ''}"


def _constant(statement: ast.stmt, following: ast.stmt | None) -> str | None:
    """A documented constant of a module, or the name of a type."""
    if not isinstance(statement, (ast.AnnAssign, ast.Assign)) or (name := _target(statement)) is None:
        return None
    told, is_type = _documents(following), not name.isupper() and name[0].isupper() and len(name) > 1
    if not told and not is_type:
        return None
    value = f" = {ast.unparse(statement.value)}" if statement.value is not None else ""
    return f"### `{name}{value if len(value) < LONGEST else ''}`\n\n{told}\n"


def _target(statement: ast.Assign | ast.AnnAssign) -> str | None:
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    names = ast.unparse(targets[0]).strip("()")
    return names if all(_public(name) and name.isidentifier() for name in names.split(", ")) else None


def _documents(statement: ast.stmt | None) -> str:
    """The text below an assignment, in one line."""
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        if isinstance(statement.value.value, str):
            return " ".join(statement.value.value.split())
    return ""


def _public(name: str) -> bool:
    return not name.startswith("_")


def _signature(node: ast.FunctionDef) -> str:
    """Parameters with their types and defaults, without `self` and `cls`."""
    given = ast.unparse(node.args)
    own = re.sub(r"^(self|cls)(, |$)", "", given)
    return f"({own})" + (f" -> {ast.unparse(node.returns)}" if node.returns else "")


def _text(node: ast.Module | ast.ClassDef | ast.FunctionDef) -> str:
    """A docstring in Markdown: sections such as `Args` become lists."""
    text = inspect.cleandoc(ast.get_docstring(node) or "")
    section = re.compile(rf"^({'|'.join(SECTIONS)}):\n((?:    .*\n?|\n(?=    ))+)", re.M)
    return section.sub(lambda found: f"{found[1]}:\n\n{_list(found[2])}\n", text + "\n").strip()


def _list(text: str) -> str:
    """What stands below `Args:` and the like: one entry for each line that is not indented further."""
    entries: list[str] = []
    for line in inspect.cleandoc(text).splitlines():
        if line.startswith(" ") and entries:
            entries[-1] += f" {line.strip()}"
        else:
            entries.append(line.strip())
    return "\n".join("- " + re.sub(r"^([\w*]+(?:, [\w*]+)*): ", r"`\1`: ", entry) for entry in entries)


if __name__ == "__main__":
    main()
