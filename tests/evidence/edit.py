"""Edits of the source tree, which are applied in a temporary copy of it."""

import hashlib
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from scengen.robots import files

ROOT = Path(__file__).parents[2]
ROBOT = Path("robot")
"""Folder of the robot's files in the copy, of 40 MB: links to the files that this process reads."""
HASHES = Path("scengen/robots/files.json")
"""File with the hashes of the robot's files. An edit of one of them changes its hash, too."""
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
        if ROBOT in Path(file).parents:
            path.unlink()  # a link to a file that is not ours
            _swap_hash(tree, text, text.replace(old, new))
        path.write_text(text.replace(old, new))


def _swap_hash(tree: Path, old: str, new: str) -> None:
    """Let a tree expect a new text of one of the robot's files."""
    before, after = (hashlib.sha256(text.encode()).hexdigest() for text in (old, new))
    expected = (tree / HASHES).read_text()
    assert expected.count(before) == 1
    (tree / HASHES).write_text(expected.replace(before, after))


@contextmanager
def copied() -> Iterator[Path]:
    """A temporary copy of the code and its configuration, with the machine code that is compiled already.

    Code in it finds the robot's files if `files.VARIABLE` names the folder `ROBOT` in it.
    """
    with TemporaryDirectory() as folder:
        tree = Path(folder)
        shutil.copytree(ROOT / "scengen", tree / "scengen")
        shutil.copytree(ROOT / "conf", tree / "conf")
        for name in files.hashes():
            there = tree / ROBOT / name
            there.parent.mkdir(parents=True, exist_ok=True)
            there.symlink_to(files.checked(name))
        yield tree
