"""What the columns of a row may hold: types, finite numbers and sizes, checked before anything uses them."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np

from ..certificate import StoredCertificate
from ..sim.world import EMBODIMENTS, action_size
from .schema import (
    HASH,
    LARGEST_TEXT,
    SHORT_HASH,
    WORD,
    canonical,
    check_horizon,
    check_match,
    check_settling,
    check_text,
    check_versions,
    check_whole,
    require,
)

LARGEST_SCENE = 5_000_000
"""Letters of a scene; the largest scenes have 60 000."""
LONGEST_WITNESS = 1_000_000
"""Control periods; one hour, the longest horizon, has 360 000."""

ACTION_SIZES = frozenset(map(action_size, EMBODIMENTS))
"""How many numbers the actions of any robot have."""

ID = re.compile(r"[0-9a-f]{12}")
VERDICTS = ("certified", "refuted", "unknown")


def _text(largest: int) -> Callable[[str, Any], Any]:
    def check(name: str, value: Any) -> Any:
        check_text(name, value, largest)
        return value

    return check


def _matches(pattern: re.Pattern[str]) -> Callable[[str, Any], Any]:
    def check(name: str, value: Any) -> Any:
        check_match(name, value, pattern)
        return value

    return check


def _whole(name: str, value: Any) -> Any:
    check_whole(name, value)
    return value


def _horizon(name: str, value: Any) -> Any:
    check_horizon(value)
    return value


def _axes(name: str, value: Any) -> tuple[str, ...]:
    require(isinstance(value, list) and len(value) <= 100, f"{name} is no list of axes")
    for axis in value:
        check_text(name, axis, 200)
    return tuple(value)


def _numbers(name: str, value: Any) -> dict[str, Any]:
    check_text(name, value)
    for key, number in (found := canonical(name, value)).items():
        plain = isinstance(number, (int, float)) and not isinstance(number, bool)
        require(plain, f"{name} has no number for {key[:60]!r}")
    return found


def _embodiment(name: str, value: Any) -> Any:
    require(value in EMBODIMENTS, f"{name} {str(value)[:60]!r} is no robot; known: {', '.join(EMBODIMENTS)}")
    return value


def _certificate(name: str, value: Any) -> StoredCertificate:
    require(isinstance(value, dict), f"{name} is no certificate")
    for what, largest in (("verdict", 100), ("reason", LARGEST_TEXT), ("settings", 100)):
        if value[what] is not None:
            check_text(f"{name}.{what}", value[what], largest)
    checks = value["checks"] or []
    require(len(checks) <= 100, f"{name} has {len(checks)} checks")
    for check in checks:
        require(isinstance(check, dict), f"{name} has an empty check")
        for what in ("name", "reason", "settings", "numbers"):
            check_text(f"{what} of a check", check[what])
        for what in ("settings", "numbers"):
            canonical(f"{what} of check {check['name'][:40]}", check[what])
    certificate = StoredCertificate.of(value)
    require(certificate.verdict in VERDICTS, f"{name} has the verdict {certificate.verdict[:40]!r}")
    check_match(f"{name}.fingerprint", certificate.fingerprint, SHORT_HASH)
    check_match(f"{name}.source_sha256", certificate.source_sha256, HASH)
    if certificate.final_state:
        check_text(f"{name}.final_state", certificate.final_state, 100)
    check_versions(certificate.versions)
    if certificate.settle is not None:
        check_settling(certificate.settle)
    return certificate


def witness_of(numbers: np.ndarray) -> np.ndarray:
    """The witness of a row from its numbers, shape (n, 7 * arms).

    Raises:
        Malformed: it has another shape, is too long, or not finite.
    """
    witness = np.asarray(numbers, np.float32)
    require(witness.ndim == 2 and witness.shape[1] in ACTION_SIZES, f"a witness of shape {witness.shape}")
    require(len(witness) < LONGEST_WITNESS, f"a witness of {len(witness)} control periods")
    require(bool(np.isfinite(witness).all()), "a witness with numbers that are not finite")
    return witness


def check_robot(embodiment: str, witness: np.ndarray) -> None:
    """Raise `Malformed` unless a witness consists of actions of the robot."""
    size = action_size(embodiment)
    told = f"a witness with {witness.shape[1]} numbers in an action; those of {embodiment} have {size}"
    require(witness.shape[1] == size, told)


COLUMNS: dict[str, Callable[[str, Any], Any]] = {
    "id": _matches(ID),
    "task": _matches(WORD),
    "code": _text(100),
    "category": _text(100),
    "split": _text(1000),
    "axes": _axes,
    "shifted": _numbers,
    "seed": _whole,
    "index": _whole,
    "attempt": _whole,
    "id_twin": _matches(ID),
    "instruction": _text(LARGEST_TEXT),
    "horizon": _horizon,
    "params": _numbers,
    "embodiment": _embodiment,
    "scene_xml": _text(LARGEST_SCENE),
    "scene_sha256": _matches(HASH),
    "witness_sha256": _matches(HASH),
    "certificate": _certificate,
}
"""What turns a stored column into the value of a row's field, or raises `Malformed`; the witness stands apart."""
