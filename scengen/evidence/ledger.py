"""The ledger of measured figures: records/<kind>/<task>.jsonl, one line for each measurement.

A figure belongs to the version of its task that it was measured on. Readers request the rows of today's version; a row
of another version is only named, never shown as if it were of this one.
"""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

from ..errors import BadConfig, cut
from ..pool.untrusted import read_json
from ..samplers import task_files
from ..work import targets
from ..work.plain import MAX_FILE, read_plain

Kind = Literal[
    "certified",
    "axis",
    "belief",
    "baseline",
    "training",
    "attack",
    "cheat",
    "leak",
    "recall",
    "mutation",
    "plan",
    "prior",
    "drift",
    "perturb",
    "control",
    "disturbed",
]
"""Kind of a measurement, and name of its folder in records/.

`certified`: scenarios certified of the first draws, and what the oracle and robosuite did; `axis`: card of an axis;
`belief`: planners with beliefs of training; `baseline`, `training`: trained policies; `attack`: the adversary; `cheat`:
cheats of people; `leak`: hidden parameters in observations; `recall`: cheats that the adversary finds again;
`mutation`: rules left out; `plan`: plans carried out; `prior`: answers that need no look; `drift`: verdicts under other
versions of MuJoCo; `perturb`: proofs of perturbations; `control`: conditions of control
under which the oracle succeeds; `disturbed`: trained policies under perturbations of their readings.
"""
KINDS: tuple[Kind, ...] = get_args(Kind)
"""All kinds."""


@dataclass(frozen=True)
class Evidence:
    """One row of the ledger: figures that one measurement gave."""

    task: str
    """Name of the task."""
    version: int
    """Version of the task that was measured."""
    split: str
    """Split that was measured."""
    kind: Kind
    """Kind of the measurement."""
    n: int
    """Number of draws, twins or rollouts that the figures rest on."""
    value: Mapping[str, Any]
    """Figures, as plain data."""
    made_with: Mapping[str, Any]
    """Settings of the measurement, as plain data. Another measurement with the same settings replaces this one."""
    draws: str
    """Hash of the first draws of the split and their scenes, see `measuring.draws_of`."""

    @property
    def place(self) -> str:
        """Keys in which another row of the same kind and task must differ from this one: the split and the settings."""
        return json.dumps([self.split, self.made_with], sort_keys=True)

    def has(self, **made_with: Any) -> bool:
        """Whether the row was made with these settings."""
        return made_with.items() <= self.made_with.items()


_KINDS_OF_VALUES = {
    **dict.fromkeys(("task", "split", "kind", "draws"), str),
    **dict.fromkeys(("version", "n"), int),
    **dict.fromkeys(("value", "made_with"), dict),
}
"""Types of the values of a row, as JSON has them."""

_FIGURES: Mapping[Kind, tuple[str, ...]] = {"certified": ("certified", "indices", "cpu")}
"""Figures that commands print of rows, by kind: numbers that are not negative."""

_OPENED: ContextVar[tuple[str | None, tuple[str, ...]]] = ContextVar("opened", default=(None, ()))
"""Folder that replaces the ledgers of all tasks, and the overrides that add folders of other packages."""


@contextmanager
def opened(folder: str | None, search: Sequence[str] = ()) -> Iterator[None]:
    """Read and write a certain ledger.

    Args:
        folder: its folder; None for the ledger of each task, see `folder_of`.
        search: overrides that add folders of other packages, see `task_files.search_path`.
    """
    token = _OPENED.set((folder, tuple(search)))
    try:
        yield
    finally:
        _OPENED.reset(token)


def folder_of(task: str) -> Path:
    """Folder of the ledger about a task: `records` next to the folder of its task file, as in another package.

    For scengen's own tasks, and for those that exist no more, it is the ledger that comes with scengen.
    """
    folder, search = _OPENED.get()
    if folder is not None:
        return Path(folder)
    conf = task_files.conf_of(task, search)
    return conf / "records" if conf and conf != task_files.conf_dir() else task_files.shipped("records")


def version_of(task: str) -> int:
    """Today's version of a task."""
    return task_files.version(task, _OPENED.get()[1])


def read(kind: Kind, task: str) -> list[Evidence]:
    """All rows of a kind about a task, those of earlier versions included.

    Raises:
        BadConfig: a line of the file is not a row.
    """
    path = folder_of(task) / kind / f"{task}.jsonl"
    return _rows(path)


def newest(kind: Kind, task: str) -> list[Evidence]:
    """The rows of a kind about an installed task: for each split, those of the newest version that has any. `mark` says
    which that is, if it is not today's."""
    rows = [row for row in read(kind, task) if row.version <= version_of(task)]
    last = {row.split: row.version for row in sorted(rows, key=lambda row: row.version)}
    return [row for row in rows if row.version == last[row.split]]


def mark(row: Evidence) -> str:
    """What a page adds to the figures of a row about an earlier version of its task; else nothing."""
    return "" if row.version == version_of(row.task) else f" (version {row.version})"


def latest(kind: Kind, task: str, **made_with: Any) -> dict[str, Evidence]:
    """The newest row of a task on each split: of those with these settings, that with the largest n."""
    rows = [row for row in newest(kind, task) if row.has(**made_with)]
    return {row.split: row for row in sorted(rows, key=lambda row: row.n)}


def write(row: Evidence) -> None:
    """Add a row to the ledger. It replaces the row of the same place, of any version."""
    path = folder_of(row.task) / row.kind / f"{row.task}.jsonl"
    targets.try_folder(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    with _locked(path.parent):
        rows = {one.place: one for one in _rows(path)} | {row.place: row}
        text = "".join(json.dumps(asdict(rows[place]), sort_keys=True) + "\n" for place in sorted(rows))
        targets.write(path, text)


def not_measured(task: str) -> str:
    """What a page says where there is no row about a task."""
    return f"not measured on version {version_of(task)}"


def _rows(path: Path) -> list[Evidence]:
    """The rows of a file; none if it does not exist."""
    if not os.path.lexists(path):
        return []
    try:
        lines = read_plain(path).decode().splitlines()
    except (ValueError, OSError) as error:
        raise BadConfig(f"{path} cannot be read: {cut(str(error))}; restore the file") from None
    rows: dict[str, Evidence] = {}
    for number, line in enumerate(lines, 1):
        try:
            row = _row(read_json(line, MAX_FILE), path)
            if row.place in rows:
                raise ValueError(f"a row with this split ({row.split}) and these settings stands above")
        except (ValueError, TypeError, RecursionError, BadConfig) as error:
            raise BadConfig(f"{path}, line {number}: {cut(str(error))}; restore the file") from None
        rows[row.place] = row
    return [*rows.values()]


def _row(plain: Any, path: Path) -> Evidence:
    """A row of a file.

    Raises:
        ValueError, TypeError: it lacks fields, or names a kind or task that is not that of its file.
    """
    if not isinstance(plain, dict):
        raise ValueError("it is not a mapping")
    row = Evidence(**plain)
    for name, kind in _KINDS_OF_VALUES.items():
        if type(getattr(row, name)) is not kind:
            raise ValueError(f"{name} = {cut(repr(getattr(row, name)))}")
    if (row.kind, row.task) != (path.parent.name, path.stem):
        raise ValueError(f"it is of kind {cut(row.kind)}, about {cut(row.task)}")
    if row.version < 1 or row.n < 0:
        raise ValueError(f"version = {row.version}, n = {row.n}")
    for name in _FIGURES.get(row.kind, ()):
        figure = row.value.get(name)
        if not isinstance(figure, (int, float)) or isinstance(figure, bool) or figure < 0:
            raise ValueError(f"value has {name} = {cut(repr(figure))}")
    return replace(row, value=_Entries(row.value), made_with=_Entries(row.made_with))


class _Entries(dict[str, Any]):
    """Entries of a row that was read: one that is read and missing is a fault of the file."""

    def __missing__(self, name: str) -> Any:
        raise BadConfig(f"a row of the ledger lacks {name}, it has {cut(', '.join(self))}; restore records/")


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Lock a folder, so that one process at a time writes in it. The lock leaves no file."""
    folder = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)
