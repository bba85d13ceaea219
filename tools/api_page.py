"""Writes docs/api.md, what authors and users call, from signatures and docstrings. `make docs`

`tests/test_api_page.py` fails if the page is out of date. Modules are parsed, not imported, so that signatures
appear as they were written.
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
    "The world": ("sim.world", "sim.arm", "sim.embodiment", "sim.memory", "predicates", "geometry", "physics"),
    "Moves": (
        "skills.motion",
        "skills.pace",
        "skills.jaw",
        "skills.grip",
        "skills.suction",
        "skills.hook",
        "skills.handover",
        "skills.waiting",
        "skills.cubes",
        "skills.fitting",
        "skills.insertion",
        "skills.keys",
    ),
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
    "The base of assets": ("assets.prop",),
    "Pools and environments": ("pool.pool", "pool.rows", "envs.gym", "envs.lerobot"),
    "Pictures": ("pictures.film",),
}
"""Modules on the page, by heading. `scengen asset` lists the assets themselves."""
MAX_VALUE_LENGTH = 80
"""Longest value of a constant that is shown [characters]."""
SECTIONS = ("Args", "Returns", "Raises", "Yields")
HEAD = """# API

Functions and classes that authors of tasks and axes call, and those for users of pools. `make docs` writes this
page from signatures and docstrings. Units are SI and radians unless brackets say otherwise. In the world frame x
points away from the robot, y to its left, and z up. Quaternions are wxyz. [CONTRIBUTING](../CONTRIBUTING.md) and
the task that `scengen new` writes show how the parts work together. `scengen tasks task=NAME` lists the parameters
of a task, `scengen asset` those of all assets.
"""


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())
    print(f"wrote {PAGE.relative_to(ROOT)}")


def page() -> str:
    """The whole page."""
    found = {title: {name: _parsed(name) for name in names} for title, names in MODULES.items()}
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
    """Anchor of a module's heading in Markdown."""
    return re.sub(r"[^\w-]", "", f"scengen.{name}".lower())


def _sections(found: dict[str, dict[str, ast.Module]]) -> Iterator[str]:
    for title, modules in found.items():
        yield f"# {title}\n"
        for name, module in modules.items():
            yield f"## `scengen.{name}`\n"
            yield f"{_text(module)}\n"
            yield from _members(module.body)


def _members(body: list[ast.stmt]) -> Iterator[str]:
    """Public constants, functions and classes, in the order of the file."""
    for statement, following in zip(body, [*body[1:], None], strict=True):
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
    return f"- `{name}{kind}{value if len(value) < MAX_VALUE_LENGTH else ''}`{f': {told}' if told else ''}"


def _constant(statement: ast.stmt, following: ast.stmt | None) -> str | None:
    """A documented constant of a module, or a type alias."""
    if not isinstance(statement, (ast.AnnAssign, ast.Assign)) or (name := _target(statement)) is None:
        return None
    told, is_type = _documents(following), not name.isupper() and name[0].isupper() and len(name) > 1
    if not told and not is_type:
        return None
    value = f" = {ast.unparse(statement.value)}" if statement.value is not None else ""
    return f"### `{name}{value if len(value) < MAX_VALUE_LENGTH else ''}`\n\n{told}\n"


def _target(statement: ast.Assign | ast.AnnAssign) -> str | None:
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    names = ast.unparse(targets[0]).strip("()")
    return names if all(_public(name) and name.isidentifier() for name in names.split(", ")) else None


def _documents(statement: ast.stmt | None) -> str:
    """Docstring below an assignment, in one line."""
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
    """Entries below a heading such as `Args:`: one for each line that is not indented further."""
    entries: list[str] = []
    for line in inspect.cleandoc(text).splitlines():
        if line.startswith(" ") and entries:
            entries[-1] += f" {line.strip()}"
        else:
            entries.append(line.strip())
    return "\n".join("- " + re.sub(r"^([\w*]+(?:, [\w*]+)*): ", r"`\1`: ", entry) for entry in entries)


if __name__ == "__main__":
    main()
