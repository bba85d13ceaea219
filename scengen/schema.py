"""What a pool may hold: types, finite numbers and sizes, checked wherever a pool is opened, before anything uses it."""

import json
import math
import os
import re
import resource
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from .certificate import StoredCertificate, from_json
from .sim.world import EMBODIMENTS

LARGEST_MANIFEST = 16_000_000
"""Bytes; the lines of ten thousand shards have 2 MB."""
LARGEST_SCENE = 5_000_000
"""Letters of a scene; the largest of the seven tasks has 60 000."""
LARGEST_TEXT = 100_000
"""Letters of any other text, JSON included."""
LONGEST_WITNESS = 1_000_000
"""Control periods; one hour, the longest horizon, has 360 000."""
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

_WORD = re.compile(r"[a-z0-9_]{1,100}")
_ID = re.compile(r"[0-9a-f]{12}")
_SHORT_HASH = re.compile(r"[0-9a-f]{16}")
_HASH = re.compile(r"[0-9a-f]{64}")
_SHARD = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")
_HIT = re.compile(r"hits/[A-Za-z0-9_-]{1,200}\.npz")
_SAMPLER = re.compile(r"iid|sobol|(lhs|grid):[0-9]{1,6}")
_CONFIG = ("task", "certify", "split", "sampler", "seed", "keep")
_VERDICTS = ("certified", "refuted", "unknown")
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
    entries = _mapping("the manifest", manifest)
    for name in entries:
        _require(name in _ENTRIES + _MORE_ENTRIES, f"an entry that no pool has, {name[:40]!r}")
    for name in (*_ENTRIES, "source_sha256", "versions"):
        _require(name in entries, f"no {name}")
    config = _mapping("config", entries["config"])
    for name in _CONFIG:
        _require(name in config, f"no config.{name}")
    for name in config:
        _require(name in _CONFIG, f"an entry of config that no pool has, {name[:40]!r}")
    _check_task(_mapping("config.task", config["task"]))
    certify = _mapping("config.certify", config["certify"])
    _text("config.certify.name", certify.get("name"), 100)
    _settling(certify.get("settle"))
    _text("config.split", config["split"], 1000)
    _matches("config.sampler", config["sampler"], _SAMPLER)
    _whole("config.seed", config["seed"])
    _require(isinstance(config["keep"], list), "config.keep is no list")
    for verdict in config["keep"]:
        _require(verdict in ("refuted", "unknown"), "config.keep names another verdict than refuted and unknown")
    for name in ("funnel", "reasons"):
        for what, count in _mapping(name, entries[name]).items():
            _text(name, what, 1000)
            _whole(f"{name} {what[:60]!r}", count, MOST_INDICES * 100)
    for name in ("indices", "n", "first_draws"):
        _whole(name, entries[name], MOST_INDICES)
    _versions(entries["versions"])
    _matches("fingerprint", entries["fingerprint"], _SHORT_HASH)
    _matches("source_sha256", entries["source_sha256"], _HASH)
    shards = entries["shards"]
    _require(isinstance(shards, list) and 0 < len(shards) <= MOST_SHARDS, "shards is no list of shards")
    for shard in [*shards, *([entries["rejected"]] if "rejected" in entries else [])]:
        _check_shard(shard)
    if "rejected" in entries:
        _require(entries["rejected"]["file"] == "rejected.parquet", "rejected names another file than rejected.parquet")
    _require(len({shard["file"] for shard in shards}) == len(shards), "a shard is listed twice")
    if "attack" in entries:
        _check_attack(_mapping("attack", entries["attack"]))
    if "subset" in entries:
        subset = _mapping("subset", entries["subset"])
        _matches("subset.of", subset.get("of"), _HASH)
        _text("subset.chosen", subset.get("chosen"), 1000)


def _check_attack(attack: Mapping[str, Any]) -> None:
    """What `scengen.attack.campaign.stored` writes, as far as it is read again."""
    for name in ("rates", "hits"):
        _require(isinstance(attack.get(name), list) and len(attack[name]) <= MOST_HITS, f"attack.{name} is no list")
    for rate in attack["rates"]:
        entry = _mapping("a rate of the attack", rate)
        _text("the tier of a rate", entry.get("tier"), 100)
        _require(isinstance(entry.get("raw"), bool), "a rate that does not say whether it is raw")
        for name in ("rollouts", "hits"):
            _whole(f"{name} of a rate", entry.get(name), MOST_INDICES)
    for hit in attack["hits"]:
        entry = _mapping("a hit", hit)
        _matches("the file of a hit", entry.get("file"), _HIT)
        _matches("sha256 of a hit", entry.get("sha256"), _HASH)
        _text("the tier of a hit", entry.get("tier"), 100)
        _require(isinstance(entry.get("raw"), bool), "a hit that does not say whether it is raw")
    _require(len({hit["file"] for hit in attack["hits"]}) == len(attack["hits"]), "a hit is listed twice")


def _check_task(task: Mapping[str, Any]) -> None:
    _matches("config.task.name", task.get("name"), _WORD)
    for name in ("family", "code", "category", "instruction"):
        _text(f"config.task.{name}", str(task.get(name, "")))
        _require(isinstance(task.get(name), (str, int, float)), f"config.task.{name} is no text")
    _horizon(task.get("horizon"))
    for name in ("id", "axes", "limits", "certify"):
        _require(isinstance(task.get(name) or {}, Mapping), f"config.task.{name} is no mapping")
    axes = task.get("axes") or {}
    _require(len(axes) <= MOST_AXES, f"config.task has {len(axes)} axes; at most {MOST_AXES} are read")
    left = MOST_SEVERITIES
    for name, axis in axes.items():
        count = _mapping(f"axis {name[:40]}", axis).get("severities", 0)
        _whole(f"severities of axis {name[:40]}", count, left)
        left -= count


def _check_shard(shard: Any) -> None:
    entry = _mapping("a shard", shard)
    _require(set(entry) == {"file", "rows", "bytes", "sha256"}, "a shard without file, rows, bytes and sha256")
    _text("the file of a shard", entry["file"], 1000)
    _require(_SHARD.fullmatch(entry["file"]) is not None, f"the shard {entry['file'][:60]!r} lies outside the pool")
    _whole("rows of a shard", entry["rows"], MOST_INDICES)
    _whole("bytes of a shard", entry["bytes"], 2**50)
    _matches("sha256 of a shard", entry["sha256"], _HASH)


# --- columns of a row ---------------------------------------------------------------------------------


def _column_text(largest: int) -> Callable[[str, Any], Any]:
    def check(name: str, value: Any) -> Any:
        _text(name, value, largest)
        return value

    return check


def _column_matches(pattern: re.Pattern[str]) -> Callable[[str, Any], Any]:
    def check(name: str, value: Any) -> Any:
        _matches(name, value, pattern)
        return value

    return check


def _column_whole(name: str, value: Any) -> Any:
    _whole(name, value)
    return value


def _column_horizon(name: str, value: Any) -> Any:
    _horizon(value)
    return value


def _column_axes(name: str, value: Any) -> tuple[str, ...]:
    _require(isinstance(value, list) and len(value) <= 100, f"{name} is no list of axes")
    for axis in value:
        _text(name, axis, 200)
    return tuple(value)


def _column_numbers(name: str, value: Any) -> dict[str, Any]:
    _text(name, value)
    for key, number in (found := _canonical(name, value)).items():
        plain = isinstance(number, (int, float)) and not isinstance(number, bool)
        _require(plain, f"{name} has no number for {key[:60]!r}")
    return found


def _column_embodiment(name: str, value: Any) -> Any:
    _require(value in EMBODIMENTS, f"{name} {str(value)[:60]!r} is no robot; known: {', '.join(EMBODIMENTS)}")
    return value


def _column_certificate(name: str, value: Any) -> StoredCertificate:
    _require(isinstance(value, dict), f"{name} is no certificate")
    for what, largest in (("verdict", 100), ("reason", LARGEST_TEXT), ("settings", 100)):
        if value[what] is not None:
            _text(f"{name}.{what}", value[what], largest)
    checks = value["checks"] or []
    _require(len(checks) <= 100, f"{name} has {len(checks)} checks")
    for check in checks:
        _require(isinstance(check, dict), f"{name} has an empty check")
        for what in ("name", "reason", "settings", "numbers"):
            _text(f"{what} of a check", check[what])
        for what in ("settings", "numbers"):
            _canonical(f"{what} of check {check['name'][:40]}", check[what])
    certificate = StoredCertificate.of(value)
    _require(certificate.verdict in _VERDICTS, f"{name} has the verdict {certificate.verdict[:40]!r}")
    _matches(f"{name}.fingerprint", certificate.fingerprint, _SHORT_HASH)
    _matches(f"{name}.source_sha256", certificate.source_sha256, _HASH)
    if certificate.final_state:
        _text(f"{name}.final_state", certificate.final_state, 100)
    _versions(certificate.versions)
    if certificate.settle is not None:
        _settling(certificate.settle)
    return certificate


def column_witness(numbers: np.ndarray) -> np.ndarray:
    """The witness of a row from its numbers, shape (n, 7).

    Raises:
        Malformed: it is too long, or not finite.
    """
    witness = np.asarray(numbers, np.float32).reshape(-1, 7)
    _require(len(witness) < LONGEST_WITNESS, f"a witness of {len(witness)} control periods")
    _require(bool(np.isfinite(witness).all()), "a witness with numbers that are not finite")
    return witness


COLUMNS: dict[str, Callable[[str, Any], Any]] = {
    "id": _column_matches(_ID),
    "task": _column_matches(_WORD),
    "code": _column_text(100),
    "category": _column_text(100),
    "split": _column_text(1000),
    "axes": _column_axes,
    "shifted": _column_numbers,
    "seed": _column_whole,
    "index": _column_whole,
    "attempt": _column_whole,
    "id_twin": _column_matches(_ID),
    "instruction": _column_text(LARGEST_TEXT),
    "horizon": _column_horizon,
    "params": _column_numbers,
    "embodiment": _column_embodiment,
    "scene_xml": _column_text(LARGEST_SCENE),
    "scene_sha256": _column_matches(_HASH),
    "witness_sha256": _column_matches(_HASH),
    "certificate": _column_certificate,
}
"""What turns a stored column into the value of a row's field, or raises `Malformed`; the witness stands apart."""


# --- files ------------------------------------------------------------------------------------------


def why_no_plain_file(path: Path) -> str:
    """Why a file of a pool cannot be opened: only plain files are, no links, pipes or devices. Empty if it can."""
    try:
        mode = os.lstat(path).st_mode
    except OSError:
        return "is missing"
    return "" if stat.S_ISREG(mode) else "is no plain file"


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


def _require(holds: bool, otherwise: str) -> None:
    if not holds:
        raise Malformed(otherwise)


def _mapping(name: str, value: Any) -> Mapping[str, Any]:
    _require(isinstance(value, Mapping), f"{name} is no mapping")
    return value


def _text(name: str, value: Any, largest: int = LARGEST_TEXT) -> None:
    _require(isinstance(value, str), f"{name} is no text")
    _require(len(value) <= largest, f"{name} has {len(value)} letters; at most {largest} are read")


def _matches(name: str, value: Any, pattern: re.Pattern[str]) -> None:
    _require(isinstance(value, str), f"{name} is no text")
    _require(pattern.fullmatch(value) is not None, f"{name} {value[:60]!r} is not of the form {pattern.pattern}")


def _whole(name: str, value: Any, most: int = 2**63 - 1) -> None:
    _require(isinstance(value, int) and not isinstance(value, bool), f"{name} is no whole number")
    _require(0 <= value <= most, f"{name} = {value}; it must lie in [0, {most}]")


def _number(name: str, value: Any, most: float) -> None:
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    _require(plain and math.isfinite(value), f"{name} is no finite number")
    _require(0 < value <= most, f"{name} = {value:g} s; it must lie in (0, {most:g}] s")


def _horizon(value: Any) -> None:
    _number("the horizon", value, LONGEST_HORIZON)


def _settling(value: Any) -> None:
    _number("the settling time", value, LONGEST_SETTLING)


def _versions(value: Any) -> None:
    _require(len(_mapping("versions", value)) <= MOST_VERSIONS, f"more than {MOST_VERSIONS} versions")
    for name, version in value.items():
        _text("a version", name, 100)
        _text(f"the version of {name[:40]!r}", version, 100)
    for name in ("mujoco", "robosuite"):
        _require(name in value, f"versions without {name}")


def _canonical(name: str, text: str) -> dict[str, Any]:
    """Canonical JSON of a mapping, as `certificate.as_json` writes it, with finite numbers."""
    try:
        found = from_json(text)
    except RecursionError:
        raise Malformed(f"{name} has too many brackets within each other") from None
    read_json(text)
    return found


def _not_finite(text: str) -> Any:
    raise Malformed(f"the number {text}, which is not finite")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    _require(len(found) == len(pairs), "a key that stands twice")
    return found
