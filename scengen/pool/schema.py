"""What a manifest may hold: types, finite numbers and sizes, checked before anything uses it."""

import json
import math
import os
import re
import resource
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..certificate import from_json

LARGEST_MANIFEST = 16_000_000
"""Bytes; the lines of ten thousand shards have 2 MB."""
LARGEST_TEXT = 100_000
"""Letters of any other text, JSON included."""
LONGEST_HORIZON = 3600.0
"""[s]"""
LONGEST_SETTLING = 10.0
"""[s]"""
DEEPEST = 16
"""Levels of brackets in JSON; a manifest has 7."""
MOST_SHARDS = 10_000
MOST_INDICES = 1_000_000_000
MOST_AXES = 200
MOST_SEVERITIES = 1000
"""Of all axes: each is proved to leave training when a pool is verified; a task has 8 axes with 5 each."""
MOST_VERSIONS = 100
MOST_HITS = 10_000
MEMORY = 4_000_000_000
"""Bytes that reading a few rows may take in addition to what the process has: a column that is declared small can
unpack to anything."""

WORD = re.compile(r"[a-z0-9_]{1,100}")
SHORT_HASH = re.compile(r"[0-9a-f]{16}")
HASH = re.compile(r"[0-9a-f]{64}")
_SHARD = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
_HIT = re.compile(r"hits/[A-Za-z0-9_-]{1,200}\.npz")
_SAMPLER = re.compile(r"iid|sobol|(lhs|grid):[0-9]{1,6}")
_CONFIG = ("task", "certify", "split", "sampler", "seed", "keep")
_ENTRIES = ("config", "fingerprint", "first_draws", "format", "funnel", "indices", "n", "reasons", "shards")
_MORE_ENTRIES = ("source_sha256", "versions", "rejected", "subset", "attack")


class Malformed(ValueError):
    """A part of a pool is not what the format says."""


def read_json(text: str, largest: int = LARGEST_TEXT) -> Any:
    """Read JSON that has finite numbers, no key twice, and a depth and size that nothing stumbles over.

    Raises:
        Malformed: it is something else.
    """
    if len(text) > largest:
        raise Malformed(f"JSON of {len(text)} letters; at most {largest} are read")
    try:
        found = json.loads(text, parse_constant=_not_finite, object_pairs_hook=_once)
    except RecursionError:
        raise Malformed("JSON with too many brackets within each other") from None
    except ValueError as error:
        raise Malformed(f"no JSON: {error}") from None
    check_plain(found)
    return found


def check_plain(value: Any) -> None:
    """Raise `Malformed` unless plain data is finite, and no deeper than `DEEPEST`."""
    todo = [(value, 0)]
    while todo:
        inner, depth = todo.pop()
        if depth > DEEPEST:
            raise Malformed(f"data more than {DEEPEST} levels deep")
        if isinstance(inner, float) and not math.isfinite(inner):
            raise Malformed("a number that is not finite")
        if isinstance(inner, int) and abs(inner) >= 2**63:
            raise Malformed("a whole number beyond 64 bits")
        if isinstance(inner, Mapping):
            todo.extend((v, depth + 1) for v in inner.values())
        elif isinstance(inner, list):
            todo.extend((v, depth + 1) for v in inner)


def check_manifest(manifest: Any) -> None:
    """Raise `Malformed` unless a manifest has what every pool of this format has, and nothing else."""
    entries = mapping("the manifest", manifest)
    for name in entries:
        require(name in _ENTRIES + _MORE_ENTRIES, f"an entry that no pool has, {name[:40]!r}")
    for name in (*_ENTRIES, "source_sha256", "versions"):
        require(name in entries, f"no {name}")
    config = mapping("config", entries["config"])
    for name in _CONFIG:
        require(name in config, f"no config.{name}")
    for name in config:
        require(name in _CONFIG, f"an entry of config that no pool has, {name[:40]!r}")
    _check_task(mapping("config.task", config["task"]))
    certify = mapping("config.certify", config["certify"])
    check_text("config.certify.name", certify.get("name"), 100)
    check_settling(certify.get("settle"))
    check_text("config.split", config["split"], 1000)
    check_match("config.sampler", config["sampler"], _SAMPLER)
    check_whole("config.seed", config["seed"])
    require(isinstance(config["keep"], list), "config.keep is no list")
    for verdict in config["keep"]:
        require(verdict in ("refuted", "unknown"), "config.keep names another verdict than refuted and unknown")
    for name in ("funnel", "reasons"):
        for what, count in mapping(name, entries[name]).items():
            check_text(name, what, 1000)
            check_whole(f"{name} {what[:60]!r}", count, MOST_INDICES * 100)
    for name in ("indices", "n", "first_draws"):
        check_whole(name, entries[name], MOST_INDICES)
    check_versions(entries["versions"])
    check_match("fingerprint", entries["fingerprint"], SHORT_HASH)
    check_match("source_sha256", entries["source_sha256"], HASH)
    shards = entries["shards"]
    require(isinstance(shards, list) and 0 < len(shards) <= MOST_SHARDS, "shards is no list of shards")
    for shard in [*shards, *([entries["rejected"]] if "rejected" in entries else [])]:
        _check_shard(shard)
    if "rejected" in entries:
        require(entries["rejected"]["file"] == "rejected.parquet", "rejected names another file than rejected.parquet")
    require(len({shard["file"] for shard in shards}) == len(shards), "a shard is listed twice")
    if "attack" in entries:
        _check_attack(mapping("attack", entries["attack"]))
    if "subset" in entries:
        subset = mapping("subset", entries["subset"])
        check_match("subset.of", subset.get("of"), HASH)
        check_text("subset.chosen", subset.get("chosen"), 1000)


def _check_attack(attack: Mapping[str, Any]) -> None:
    """What `scengen.attack.campaign.stored` writes, as far as it is read again."""
    for name in ("rates", "hits"):
        require(isinstance(attack.get(name), list) and len(attack[name]) <= MOST_HITS, f"attack.{name} is no list")
    for rate in attack["rates"]:
        entry = mapping("a rate of the attack", rate)
        check_text("the tier of a rate", entry.get("tier"), 100)
        require(isinstance(entry.get("raw"), bool), "a rate that does not say whether it is raw")
        for name in ("rollouts", "hits"):
            check_whole(f"{name} of a rate", entry.get(name), MOST_INDICES)
    for hit in attack["hits"]:
        entry = mapping("a hit", hit)
        check_match("the file of a hit", entry.get("file"), _HIT)
        check_match("sha256 of a hit", entry.get("sha256"), HASH)
        check_text("the tier of a hit", entry.get("tier"), 100)
        require(isinstance(entry.get("raw"), bool), "a hit that does not say whether it is raw")
    require(len({hit["file"] for hit in attack["hits"]}) == len(attack["hits"]), "a hit is listed twice")


def _check_task(task: Mapping[str, Any]) -> None:
    check_match("config.task.name", task.get("name"), WORD)
    for name in ("family", "code", "category", "instruction"):
        check_text(f"config.task.{name}", str(task.get(name, "")))
        require(isinstance(task.get(name), (str, int, float)), f"config.task.{name} is no text")
    check_horizon(task.get("horizon"))
    for name in ("id", "axes", "limits", "certify"):
        require(isinstance(task.get(name) or {}, Mapping), f"config.task.{name} is no mapping")
    axes = task.get("axes") or {}
    require(len(axes) <= MOST_AXES, f"config.task has {len(axes)} axes; at most {MOST_AXES} are read")
    left = MOST_SEVERITIES
    for name, axis in axes.items():
        count = mapping(f"axis {name[:40]}", axis).get("severities", 0)
        check_whole(f"severities of axis {name[:40]}", count, left)
        left -= count


def _check_shard(shard: Any) -> None:
    entry = mapping("a shard", shard)
    require(set(entry) == {"file", "rows", "bytes", "sha256"}, "a shard without file, rows, bytes and sha256")
    check_text("the file of a shard", entry["file"], 1000)
    require(_SHARD.fullmatch(entry["file"]) is not None, f"the shard {entry['file'][:60]!r} lies outside the pool")
    check_whole("rows of a shard", entry["rows"], MOST_INDICES)
    check_whole("bytes of a shard", entry["bytes"], 2**50)
    check_match("sha256 of a shard", entry["sha256"], HASH)


# --- files ------------------------------------------------------------------------------------------


def why_no_plain_file(path: Path) -> str:
    """Why a file of a pool cannot be opened: only plain files are, no links, pipes or devices. Empty if it can."""
    try:
        mode = os.lstat(path).st_mode
    except OSError:
        return "is missing"
    return "" if stat.S_ISREG(mode) else "is no plain file"


def read_file(path: Path) -> Any:
    """What a JSON file beside the shards says: a manifest, or an index.

    Raises:
        ValueError: it is no plain file, too large, or no strict JSON.
        OSError: it cannot be read.
    """
    if why := why_no_plain_file(path):
        raise ValueError(f"it {why}")
    if (size := path.stat().st_size) > LARGEST_MANIFEST:
        raise ValueError(f"it has {size} bytes")
    return read_json(path.read_text(), LARGEST_MANIFEST)


@contextmanager
def memory_bounded(more: int = MEMORY) -> Iterator[None]:
    """Let this process take only so many bytes more than it has, while something unknown is unpacked."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    bound = taken + more if soft == resource.RLIM_INFINITY else min(soft, taken + more)
    resource.setrlimit(resource.RLIMIT_AS, (bound, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


# --- small rules --------------------------------------------------------------------------------------


def require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise Malformed(otherwise)


def mapping(name: str, value: Any) -> Mapping[str, Any]:
    require(isinstance(value, Mapping), f"{name} is no mapping")
    return value


def check_text(name: str, value: Any, largest: int = LARGEST_TEXT) -> None:
    require(isinstance(value, str), f"{name} is no text")
    require(len(value) <= largest, f"{name} has {len(value)} letters; at most {largest} are read")


def check_match(name: str, value: Any, pattern: re.Pattern[str]) -> None:
    require(isinstance(value, str), f"{name} is no text")
    require(pattern.fullmatch(value) is not None, f"{name} {value[:60]!r} is not of the form {pattern.pattern}")


def check_whole(name: str, value: Any, most: int = 2**63 - 1) -> None:
    require(isinstance(value, int) and not isinstance(value, bool), f"{name} is no whole number")
    require(0 <= value <= most, f"{name} = {value}; it must lie in [0, {most}]")


def check_number(name: str, value: Any, most: float) -> None:
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    require(plain and math.isfinite(value), f"{name} is no finite number")
    require(0 < value <= most, f"{name} = {value:g} s; it must lie in (0, {most:g}] s")


def check_horizon(value: Any) -> None:
    check_number("the horizon", value, LONGEST_HORIZON)


def check_settling(value: Any) -> None:
    check_number("the settling time", value, LONGEST_SETTLING)


def check_versions(value: Any) -> None:
    require(len(mapping("versions", value)) <= MOST_VERSIONS, f"more than {MOST_VERSIONS} versions")
    for name, version in value.items():
        check_text("a version", name, 100)
        check_text(f"the version of {name[:40]!r}", version, 100)
    for name in ("mujoco", "robosuite"):
        require(name in value, f"versions without {name}")


def canonical(name: str, text: str) -> dict[str, Any]:
    """Canonical JSON of a mapping, as `certificate.as_json` writes it, with finite numbers."""
    check_text(name, text)
    try:
        found = from_json(text)
    except RecursionError:
        raise Malformed(f"{name} has too many brackets within each other") from None
    check_plain(found)
    return found


def _not_finite(text: str) -> Any:
    raise Malformed(f"the number {text}, which is not finite")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    require(len(found) == len(pairs), "a key that stands twice")
    return found
