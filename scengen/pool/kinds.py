"""What a folder is, by the file that marks it: a pool, demonstrations, and so on. A folder is one thing."""

import os
from pathlib import Path

from ..errors import PoolError, nearest

POLICY = "policy.json"
"""File that marks a trained policy."""
EPISODES = "episodes.jsonl"
"""File that marks an evaluation."""
RECORDING = "meta/info.json"
"""File that marks a recording."""
MARKS = {
    "manifest.json": "a pool",
    "demonstrations.json": "demonstrations",
    "index.json": "an index of pools",
    RECORDING: "a recording",
    POLICY: "a trained policy",
    EPISODES: "an evaluation",
}
"""Meaning of the file that marks a folder, by its path in the folder."""


def marks(folder: str | Path) -> list[str]:
    """Files that mark a folder. Links and pipes count, too."""
    return [mark for mark in MARKS if os.path.lexists(Path(folder, mark))]


def check_one(folder: str | Path) -> None:
    """Raise `PoolError` if a folder is two things: two commands would read different data from it."""
    if len(found := marks(folder)) > 1:
        what = " and ".join(f"{MARKS[mark]} ({mark})" for mark in found)
        raise PoolError(f"{folder} is {what}; a folder must be one of them: move the others elsewhere")


def check_target(folder: str | Path, mark: str = "", setting: str = "to") -> None:
    """Raise `PoolError` if a folder to be written is a thing of another kind.

    Args:
        mark: file that marks what is to be written, if it may be there already.
        setting: name of the setting that names the folder.
    """
    if others := [other for other in marks(folder) if other != mark]:
        raise PoolError(f"{folder} is {MARKS[others[0]]} already ({others[0]}); choose another {setting}=")


def check_there(folder: Path, mark: str, maker: str) -> None:
    """Raise `PoolError` if a folder is not what its file `mark` says; the reason names what it is instead.

    Args:
        maker: command that makes such a folder.
    """
    check_one(folder)
    if (folder / mark).is_file():
        return
    if others := marks(folder):
        why = f"it is {MARKS[others[0]]} ({others[0]}); name {MARKS[mark]}"
    elif Path(f"{folder}.run").is_dir():
        why = f"{mark} is missing; a run was started there; repeat its command to finish it"
    else:
        why = f"{mark} is missing; see scengen {maker}"
    there = [path for path in folder.parent.glob("*/") if path != folder and marks(path)]
    within = [path for path in sorted(folder.glob("*/")) if (path / mark).is_file()]
    close = within or [path for path in there if nearest(folder.name, [path.name])]
    alike = f" (did you mean {str(close[0])!r}?)" if close else ""
    raise PoolError(f"no {MARKS[mark].removeprefix('a ')} at {folder}{alike}: {why}")
