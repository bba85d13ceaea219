"""The manifest of a pool: `manifest.json`, read from data of unknown origin and checked."""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import PoolError, ScengenError
from ..work.typed import typed
from .files import FileEntry as FileEntry
from .files import read_json_file, replace_file
from .kinds import check_there
from .untrusted import (
    HASH,
    SHORT_HASH,
    WORD,
    check_horizon,
    check_mapping,
    check_match,
    check_settling,
    check_task_version,
    check_text,
    check_versions,
    check_whole,
    demand,
)

MANIFEST = "manifest.json"
FORMAT = 4
"""Version of the format of pools, which changes with the columns, the names of files and the entries of a manifest."""
REJECTED = "rejected.parquet"
"""File of the scenarios that were kept although they were not certified."""
PROCESS = "process"
"""Word in place of a check in the reasons, for a scenario that ended its process or was ended with it at a limit."""

MAX_SHARDS = 10_000
MAX_INDICES = 1_000_000_000
MAX_AXES = 200
"""Largest number of axes of a task."""
MAX_SEVERITIES = 1000
"""Largest number of severities of all axes together. Verification proves of each that it leaves training; a task has
8 axes with 5 each."""
MAX_HITS = 10_000
"""Largest number of hits of an attack, and of its rates."""

_SHARD = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
_HIT = re.compile(r"hits/[A-Za-z0-9_-]{1,200}\.npz")
_SAMPLER = re.compile(r"iid|sobol|(lhs|grid):[0-9]{1,6}")
_NUMBER = re.compile(r"((?<!\w)-)?\d+(\.\d+)?")


@dataclass(frozen=True)
class RunConfig:
    """Everything that decides which scenarios a run makes and keeps."""

    task: Mapping[str, Any]
    """Name of the task and content of its file, with measured limits and what the command line changed."""
    certify: Mapping[str, Any]
    """Settings of the certificates."""
    split: str
    sampler: str
    """Design that the numbers came from, such as `iid`; see `scengen.samplers.designs`."""
    seed: int
    keep: tuple[str, ...]
    """Verdicts besides `certified` whose scenarios were kept."""


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """Manifest of a pool."""

    config: RunConfig
    n: int
    """Number of scenarios that were requested."""
    indices: int
    """Number of indices that were tried."""
    first_draws: int
    """Number of indices whose first draw was certified."""
    funnel: Mapping[str, int]
    """Number of draws that got through each step."""
    reasons: Mapping[str, int]
    """Number of rejections by "check: reason"."""
    versions: Mapping[str, str]
    """Versions of the packages that the pool was certified with, and the platform."""
    fingerprint: str
    """Rounding of the machine that made the pool; see `scengen.work.fingerprint`."""
    task_version: int
    """Version of the task on which the pool was made, see `Scenario.VERSION`."""
    source_sha256: str
    """Hash of the code of the family when the pool was made. It decides nothing."""
    shards: tuple[FileEntry, ...]
    """Files of the certified scenarios, in the order of their indices."""
    rejected: FileEntry | None = None
    """File of the scenarios that were kept although they were not certified, if there are any."""
    subset: Mapping[str, Any] | None = None
    """`of`, the hash of the pool from which the scenarios were chosen, and `chosen`, the way in which they were."""
    attack: Mapping[str, Any] | None = None
    """`rates` and `hits` of the attack on the finished pool, if there was one."""

    @classmethod
    def of(cls, plain: Any) -> "Manifest":
        """The reverse of `plain`, for data of unknown origin.

        Raises:
            ValueError, ScengenError: it is not what every pool of this format has, or has more.
        """
        entries = {name: value for name, value in check_mapping("the manifest", plain).items() if name != "format"}
        found = typed("", cls, entries, exact=True)
        _check(found)
        return found

    @classmethod
    def read(cls, folder: Path) -> "Manifest":
        """The manifest of a folder.

        Raises:
            PoolError: it does not exist, it is damaged, or it is of another format.
        """
        check_there(folder, MANIFEST, "generate")
        path = folder / MANIFEST
        try:
            plain = read_json_file(path)
            version = plain["format"]
            if version == FORMAT:
                return cls.of(plain)
        except (ScengenError, ValueError, KeyError, TypeError, OSError) as error:
            why = " ".join(str(error).split())[:160]
            raise PoolError(f"{path} is damaged; restore it or generate the pool again ({why})") from None
        newer = isinstance(version, int) and version > FORMAT
        remedy = "install a newer scengen" if newer else "generate it again with the command and seed that made it"
        message = f"{folder} has pool format {str(version)[:20]}, this scengen reads {FORMAT}"
        raise PoolError(f"{message}; {remedy} (docs/pools.md, Formats)")

    def plain(self) -> dict[str, Any]:
        """Plain data, as a pool stores it."""
        return {"format": FORMAT, **{name: value for name, value in asdict(self).items() if value is not None}}

    def write(self, folder: Path) -> None:
        """Write the manifest of a folder."""
        text = json.dumps(self.plain(), indent=1, sort_keys=True) + "\n"
        replace_file(folder / MANIFEST, text.encode())

    def without_files(self) -> "Manifest":
        """The same without shards, rejects, and an attack, whose hits are files."""
        return replace(self, shards=(), rejected=None, attack=None)

    @property
    def scenarios(self) -> int:
        """Number of certified scenarios."""
        return sum(entry.rows for entry in self.shards)

    @property
    def files(self) -> tuple[FileEntry, ...]:
        """All files with rows."""
        return self.shards if self.rejected is None else (*self.shards, self.rejected)

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.config.task["name"]

    @property
    def task_node(self) -> dict[str, Any]:
        """Content of the task's file as it was, with measured limits and what the command line changed."""
        return {key: node for key, node in self.config.task.items() if key != "name"}

    @property
    def settings(self) -> str:
        """Name of the settings of the certificates, `quick` or `full`."""
        return self.config.certify["name"]

    @property
    def is_subset(self) -> bool:
        """Whether the scenarios were chosen from another pool, and not drawn."""
        return self.subset is not None

    @property
    def hits(self) -> Sequence[Mapping[str, Any]]:
        """Entries of the hits of the attack; empty if there was no attack."""
        return self.attack["hits"] if self.attack else ()

    @property
    def rates(self) -> Sequence[Mapping[str, Any]]:
        """Entries of the rates of the attack; empty if there was no attack."""
        return self.attack["rates"] if self.attack else ()


def without_numbers(reason: str) -> str:
    """A reason with `#` for each number: rejections of the same kind have the same reason then, and are counted."""
    return _NUMBER.sub("#", reason)


# --- rules beyond names and types; each raises `Malformed` ------------------------------------------------------------


def _check(manifest: Manifest) -> None:
    _check_config(manifest.config)
    check_counts(manifest, ("funnel", "reasons"), ("indices", "n", "first_draws"))
    check_origin(manifest)
    demand(0 < len(manifest.shards) <= MAX_SHARDS, f"{len(manifest.shards)} shards; 1 to {MAX_SHARDS} are read")
    for entry in manifest.files:
        check_entry(entry)
    demand(len({entry.file for entry in manifest.shards}) == len(manifest.shards), "a shard is listed twice")
    if manifest.rejected is not None:
        demand(manifest.rejected.file == REJECTED, f"rejected names a different file than {REJECTED}")
    if manifest.attack is not None:
        _check_attack(manifest.attack)
    if manifest.subset is not None:
        check_match("subset.of", manifest.subset.get("of"), HASH)
        check_text("subset.chosen", manifest.subset.get("chosen"), 1000)


def check_counts(manifest: Any, groups: Sequence[str], numbers: Sequence[str]) -> None:
    """Counts by text, and numbers, of a manifest."""
    for name in groups:
        for what, count in getattr(manifest, name).items():
            check_text(name, what, 1000)
            check_whole(f"{name} {what[:60]!r}", count, MAX_INDICES * 100)
    for name in numbers:
        check_whole(name, getattr(manifest, name), MAX_INDICES)


def check_origin(manifest: Any) -> None:
    """Entries that say with what something was made."""
    check_versions(manifest.versions)
    check_match("fingerprint", manifest.fingerprint, SHORT_HASH)
    check_task_version(manifest.task_version)
    check_match("source_sha256", manifest.source_sha256, HASH)


def _check_config(config: RunConfig) -> None:
    check_draws(config.task, config.split, config.sampler, config.seed)
    check_text("config.certify.name", config.certify.get("name"), 100)
    check_settling(config.certify.get("settle"))
    for verdict in config.keep:
        demand(verdict in ("refuted", "unknown"), "config.keep names a different verdict than refuted and unknown")


def check_draws(task: Mapping[str, Any], split: str, sampler: str, seed: int) -> None:
    """Entries of a configuration that decide which scenarios are drawn."""
    _check_task(task)
    check_text("config.split", split, 1000)
    check_match("config.sampler", sampler, _SAMPLER)
    check_whole("config.seed", seed)


def _check_task(task: Mapping[str, Any]) -> None:
    check_match("config.task.name", task.get("name"), WORD)
    for name in ("family", "code", "category", "instruction"):
        check_text(f"config.task.{name}", str(task.get(name, "")))
        demand(isinstance(task.get(name), (str, int, float)), f"config.task.{name} is not a text")
    check_horizon(task.get("horizon"))
    for name in ("id", "axes", "limits", "certify"):
        check_mapping(f"config.task.{name}", task.get(name) or {})
    axes = task.get("axes") or {}
    demand(len(axes) <= MAX_AXES, f"config.task has {len(axes)} axes; at most {MAX_AXES} are read")
    left = MAX_SEVERITIES
    for name, axis in axes.items():
        count = check_mapping(f"axis {name[:40]}", axis).get("severities", 0)
        check_whole(f"severities of axis {name[:40]}", count, left)
        left -= count


def check_entry(entry: FileEntry) -> None:
    """An entry of a file with rows."""
    check_text("the file of a shard", entry.file, 1000)
    demand(_SHARD.fullmatch(entry.file) is not None, f"the shard {entry.file[:60]!r} lies outside the pool")
    check_whole("rows of a shard", entry.rows, MAX_INDICES)
    check_whole("bytes of a shard", entry.bytes, 2**50)
    check_match("sha256 of a shard", entry.sha256, HASH)


def _check_attack(attack: Mapping[str, Any]) -> None:
    """Check the entries that `scengen.attack.campaign.store_in_pool` writes and that are read again."""
    for name in ("rates", "hits"):
        listed = attack.get(name)
        demand(isinstance(listed, list) and len(listed) <= MAX_HITS, f"attack.{name} is not a list")
    for rate in attack["rates"]:
        entry = check_mapping("a rate of the attack", rate)
        check_match("the tier of a rate", entry.get("tier"), WORD)
        demand(isinstance(entry.get("raw"), bool), "a rate does not say whether it is raw")
        for name in ("rollouts", "hits"):
            check_whole(f"{name} of a rate", entry.get(name), MAX_INDICES)
    for hit in attack["hits"]:
        entry = check_mapping("a hit", hit)
        check_match("the file of a hit", entry.get("file"), _HIT)
        check_match("sha256 of a hit", entry.get("sha256"), HASH)
        check_match("the tier of a hit", entry.get("tier"), WORD)
        demand(isinstance(entry.get("raw"), bool), "a hit does not say whether it is raw")
    demand(len({hit["file"] for hit in attack["hits"]}) == len(attack["hits"]), "a hit is listed twice")
