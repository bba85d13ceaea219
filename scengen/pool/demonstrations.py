"""Demonstrations on disk: a folder with `demonstrations.json` and Parquet files. As a pool, it is data only."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from ..episode import STRICT, check_rules
from ..errors import PoolError, ScengenError
from ..work.typed import typed
from . import writing
from .files import read_json_file, replace_file
from .kinds import MARKS, check_one, check_there, marks
from .manifest import (
    MAX_INDICES,
    MAX_SHARDS,
    FileEntry,
    check_counts,
    check_draws,
    check_entry,
    check_origin,
)
from .row import DemonstrationRow
from .rows import StoredRows
from .untrusted import (
    HASH,
    MAX_TEXT,
    WORD,
    check_mapping,
    check_match,
    check_settling,
    check_text,
    check_whole,
    demand,
)

DEMONSTRATIONS = "demonstrations.json"
"""File with what a folder of demonstrations says of itself."""
FAILED = "failed.parquet"
"""File of the failed attempts, if they were kept."""
DEMONSTRATIONS_FORMAT = 2
"""Version of the format, which changes with the columns, the names of files and the entries of the manifest."""
SCRIPTED = "scripted"
"""Source of demonstrations that an oracle has played."""
TELEOP = "teleop"
"""Source of demonstrations that a person has driven, and the style of all of them."""
POLICY = "policy"
"""Source of rollouts of a policy, and the style of all of them."""
OPERATOR = re.compile(r"[a-z]{0,4}[0-9]{1,6}")
"""Code of an operator: short, and no name."""


@dataclass(frozen=True)
class DemonstrationConfig:
    """Everything that decides which demonstrations a run makes."""

    task: Mapping[str, Any]
    """Name of the task and content of its file, with measured limits and what the command line changed."""
    split: str
    sampler: str
    """Design that the numbers came from, such as `iid`; see `scengen.samplers.designs`."""
    seed: int
    runs: int
    """Number of runs of one scenario."""
    styles: tuple[str, ...]
    """Styles that the runs were chosen from."""
    keep: tuple[str, ...]
    """`failed` if failed attempts were kept."""
    settle: float
    """Time for which a reached goal had to last [s]."""
    apart: tuple[str, ...]
    """Hashes of the pools from which the scenarios were kept apart."""
    rules: str = STRICT
    """Rules of the episodes, see `scengen.episode.Rules`."""


@dataclass(frozen=True, kw_only=True)
class DemonstrationManifest:
    """Manifest of a folder of demonstrations."""

    config: DemonstrationConfig
    n: int
    """Number of demonstrations that were requested."""
    indices: int
    """Number of attempts: of indices, times the runs of each. Runs that a person did not need are counted, too."""
    funnel: Mapping[str, int]
    """Number of attempts that got through each step."""
    reasons: Mapping[str, int]
    """Number of failed attempts by "check: reason"."""
    outcomes: Mapping[str, int]
    """Number of rollouts by outcome."""
    styles: Mapping[str, int]
    """Number of demonstrations by style."""
    versions: Mapping[str, str]
    """Versions of the packages that the physics depends on, and the platform."""
    fingerprint: str
    """Rounding of the machine; see `scengen.work.fingerprint`."""
    task_version: int
    """Version of the task on which the demonstrations were made, see `Scenario.VERSION`."""
    source_sha256: str
    """Hash of the code of the family when the demonstrations were made. It decides nothing."""
    shards: tuple[FileEntry, ...] = ()
    """Files of the demonstrations, in the order of the attempts."""
    failed: FileEntry | None = None
    """File of the failed attempts, if they were kept."""
    operator: str | None = None
    """Code of the person who drove the robot; None if no person did."""
    policy: str | None = None
    """Name of the policy that drove the robot, as `scengen evaluate` takes it; None if no policy did."""
    condition: str | None = None
    """What was changed of what the policy perceived, such as `noise@1` or `blind`; None if nothing was."""
    perturb_seed: int | None = None
    """Seed of a perturbation of what the policy perceived; None if nothing was changed."""
    checks: Mapping[str, Any] | None = None
    """Settings of the checks before the oracle plays; None for the usual ones of the task."""

    @classmethod
    def read(cls, folder: Path) -> "DemonstrationManifest":
        """The manifest of a folder.

        Raises:
            PoolError: it does not exist, it is damaged, or it is of another format.
        """
        check_there(folder, DEMONSTRATIONS, "demos")
        path = folder / DEMONSTRATIONS
        try:
            plain = dict(check_mapping("the manifest", read_json_file(path)))
            version = plain.pop("format")
            if version == DEMONSTRATIONS_FORMAT:
                found = typed("", cls, plain, exact=True)
                _check(found)
                return found
        except (ScengenError, ValueError, KeyError, TypeError, OSError) as error:
            why = " ".join(str(error).split())[:160]
            raise PoolError(f"{path} is damaged; restore it or make the demonstrations again ({why})") from None
        message = (
            f"{folder} has format {str(version)[:20]} of demonstrations, this scengen reads {DEMONSTRATIONS_FORMAT}"
        )
        raise PoolError(f"{message}; make them again with the command that made them")

    def write(self, folder: Path) -> None:
        """Write the manifest of a folder."""
        plain = {name: value for name, value in asdict(self).items() if value is not None}
        text = json.dumps({"format": DEMONSTRATIONS_FORMAT, **plain}, indent=1, sort_keys=True) + "\n"
        replace_file(folder / DEMONSTRATIONS, text.encode())

    @property
    def task_node(self) -> dict[str, Any]:
        """Content of the task's file as it was, with measured limits and what the command line changed."""
        return {key: node for key, node in self.config.task.items() if key != "name"}

    @property
    def source(self) -> str:
        """Origin of the actions: `SCRIPTED`, `TELEOP` or `POLICY`."""
        return TELEOP if self.operator is not None else POLICY if self.policy is not None else SCRIPTED

    @property
    def files(self) -> tuple[FileEntry, ...]:
        """All files with rows."""
        return self.shards if self.failed is None else (*self.shards, self.failed)


def _check(manifest: DemonstrationManifest) -> None:
    config = manifest.config
    check_draws(config.task, config.split, config.sampler, config.seed)
    check_whole("config.runs", config.runs, MAX_INDICES)
    demand(config.runs > 0, "config.runs is 0")
    check_settling(config.settle)
    check_rules(config.rules)
    demand(0 < len(config.styles) <= 100, f"config.styles has {len(config.styles)} entries")
    for style in config.styles:
        check_match("config.styles", style, WORD)
    demand(config.keep in ((), ("failed",)), "config.keep names something other than failed")
    demand(len(config.apart) <= MAX_SHARDS, f"config.apart has {len(config.apart)} entries")
    for pool in config.apart:
        check_match("config.apart", pool, HASH)
    check_counts(manifest, ("funnel", "reasons", "outcomes", "styles"), ("n", "indices"))
    check_origin(manifest)
    demand(0 < len(manifest.shards) <= MAX_SHARDS, f"{len(manifest.shards)} files; 1 to {MAX_SHARDS} are read")
    for entry in manifest.files:
        check_entry(entry)
    demand(len({entry.file for entry in manifest.files}) == len(manifest.files), "a file is listed twice")
    if manifest.operator is not None:
        check_match("operator", manifest.operator, OPERATOR)
    if manifest.policy is not None:
        check_text("policy", manifest.policy, MAX_TEXT)
    demand(manifest.operator is None or manifest.policy is None, "an operator and a policy")
    changed = (manifest.condition, manifest.perturb_seed)
    demand(changed == (None, None) or (None not in changed and manifest.policy is not None), "a condition, no policy")
    if manifest.condition is not None:
        check_text("condition", manifest.condition, MAX_TEXT)
        check_whole("perturb_seed", manifest.perturb_seed)
    for source, stated in ((TELEOP, manifest.operator), (POLICY, manifest.policy)):
        demand((stated is None) == (source not in config.styles), f"style {source} and its source go together")
        demand(source not in config.styles or len(config.styles) == 1, f"{source} cannot be mixed with other styles")
    demand((manifest.failed is None) == (not config.keep), f"keep= and {FAILED} go together")
    if manifest.failed is not None:
        demand(manifest.failed.file == FAILED, f"failed names a different file than {FAILED}")
    check_text("config.split", config.split, MAX_TEXT)


@dataclass(frozen=True, repr=False)
class Demonstrations(StoredRows[DemonstrationManifest, DemonstrationRow]):
    """A finished folder of demonstrations, opened for reading: in the order of their attempts."""

    ROW = DemonstrationRow
    MANIFEST = DEMONSTRATIONS
    REMEDY = "make the demonstrations again"

    @classmethod
    def open(cls, folder: str | Path) -> "Demonstrations":
        """Open the demonstrations in a folder.

        Raises:
            PoolError: there are no finished ones of a known format.
        """
        return cls(Path(folder), DemonstrationManifest.read(Path(folder)))

    def failures(self) -> Iterator[DemonstrationRow]:
        """The failed attempts, if they were kept (`keep=failed`).

        Raises:
            PoolError: their file cannot be read.
        """
        return self._rows_of_file(self.manifest.failed)

    def attempts(self) -> Iterator[DemonstrationRow]:
        """The demonstrations, then the failed attempts, if they were kept."""
        return chain(self.rows(), self.failures())


def write_demonstrations(
    folder: Path,
    about: DemonstrationManifest,
    rows: Iterable[DemonstrationRow],
    failures: Iterable[DemonstrationRow],
) -> Demonstrations:
    """Write a folder of demonstrations: rows first, the manifest last.

    Args:
        about: the manifest; its files are replaced by those that are written.
        rows: demonstrations in the order of their attempts.
        failures: failed attempts; a file for them is written only if failed attempts are kept.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shard = writing.write_rows(folder / "demonstrations-00000.parquet", rows, DemonstrationRow)
    keep = bool(about.config.keep)
    failed = writing.write_rows(folder / FAILED, failures, DemonstrationRow) if keep else None
    replace(about, shards=(shard,), failed=failed).write(folder)
    return Demonstrations.open(folder)


def is_demonstrations(folder: str | Path) -> bool:
    """Whether a folder holds demonstrations.

    Raises:
        PoolError: it holds something else besides.
    """
    check_one(folder)
    return (Path(folder) / DEMONSTRATIONS).is_file()


def demonstration_folders(given: str | Sequence[str]) -> list[str]:
    """Folders of demonstrations. A folder without a manifest stands for those in it, as `task=all` writes them.

    Raises:
        PoolError: a folder holds something besides demonstrations.
    """
    return [each for folder in ([given] if isinstance(given, str) else given) for each in _members(folder)]


def _members(folder: str) -> list[str]:
    check_one(folder)
    inside = {} if marks(folder) else {path: marks(path) for path in sorted(Path(folder).glob("*/"))}
    found = [str(path) for path, own in inside.items() if DEMONSTRATIONS in own]
    if found and (others := {path: own for path, own in inside.items() if own not in ([], [DEMONSTRATIONS])}):
        path, own = next(iter(others.items()))
        raise PoolError(f"{folder} holds demonstrations ({found[0]}) and {MARKS[own[0]]} ({path}); name the folders")
    return found or [folder]
