"""Edits of the source tree, which are applied in a temporary copy of it."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
ASSETS = Path("scengen/robots/robosuite_assets")
"""Folder of the robot's meshes, of 40 MB: the copy refers to its files by links."""
NEW = ""
"""Old text of a file that an edit adds."""
STALE = "mend this edit, because the code has moved"

Swap = tuple[str, str, str]
"""A file, a text that occurs once in it (or `NEW`), and the text in its place."""


@dataclass(frozen=True)
class Edit:
    """An edit that a developer may make, and how the comparison of tasks must judge it."""

    name: str
    tasks: tuple[str, ...]
    """Tasks that are compared after the edit."""
    swaps: tuple[Swap, ...]
    kinds: tuple[str, ...] = ()
    """Kinds of differences of which each task must report at least one; empty for a refactoring."""
    least: str = "version"
    """Least level of such a difference, `version` or `bits`."""
    longer: bool = False
    """Whether all rollouts of all splits are played, as before a release, and not only those of every change."""
    rounds: bool = False
    """Whether a refactoring may change the last bits."""
    misjudged: str = ""
    """Reason why the comparison judges the edit wrongly, as far as is known; empty if it must judge it rightly."""


class StaleEdit(Exception):
    """An edit cannot be applied to the present code."""


def apply(edit: Edit, tree: Path) -> None:
    """Apply an edit to a tree.

    Raises:
        StaleEdit: an old text does not occur exactly once, or a new file exists.
    """
    for file, old, new in edit.swaps:
        path = tree / file
        if old == NEW:
            if path.exists():
                raise StaleEdit(f"{edit.name}: {file} exists already; {STALE}")
            path.write_text(new)
            continue
        text = path.read_text() if path.is_file() else ""
        if (count := text.count(old)) != 1:
            raise StaleEdit(f"{edit.name}: {old.strip().splitlines()[0]!r} occurs {count} times in {file}; {STALE}")
        if path.is_symlink() or ASSETS in Path(file).parents:
            path.unlink()
        path.write_text(text.replace(old, new))


@contextmanager
def copied() -> Iterator[Path]:
    """A temporary copy of the code and its configuration, with the machine code that is compiled already."""
    with TemporaryDirectory() as folder:
        tree = Path(folder)
        shutil.copytree(ROOT / "scengen", tree / "scengen", ignore=_without_assets)
        shutil.copytree(ROOT / "conf", tree / "conf")
        for file in (ROOT / ASSETS).rglob("*"):
            if file.is_file():
                there = tree / file.relative_to(ROOT)
                there.parent.mkdir(parents=True, exist_ok=True)
                there.symlink_to(file)
        yield tree


def _without_assets(folder: str, names: list[str]) -> list[str]:
    """Names in a folder that are not copied."""
    return [name for name in names if Path(folder, name) == ROOT / ASSETS]
