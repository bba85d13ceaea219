"""False claims about what a run has left out: kept rejects, reasons, and an attack on the finished pool."""

import copy
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from forgery import Case, Draft, sha256, write_manifest
from labels import Change, _config, _from, _manifest


def _certified_too(draft: Draft) -> None:
    """Instead of the scenario that failed the first certified one stands among the rejects."""
    failed = draft.rejected[0]["certificate"]["checks"]
    draft.rejected[0] = _from(draft)
    draft.rejected[0]["certificate"].update(
        checks=failed, verdict="unknown", reason=next(f"{c['name']}: {c['reason']}" for c in failed if not c["passed"])
    )


def _other_reason(draft: Draft) -> None:
    """The certificate of a reject agrees with itself, and not with what the manifest counts."""
    certificate = draft.rejected[0]["certificate"]
    failed = next(check for check in certificate["checks"] if check["passed"] is False)
    failed["reason"] = "the robot had a bad day"
    certificate["reason"] = f"{failed['name']}: {failed['reason']}"


def _other_check(draft: Draft) -> None:
    """It has failed to be solved, and not to be robust; every count follows."""
    certificate = draft.rejected[0]["certificate"]
    names = [check["name"] for check in certificate["checks"]]
    for check in certificate["checks"][names.index("solved") :]:
        check.update(passed=None, reason="skipped after a failed check", settings={}, numbers={})
    certificate["checks"][names.index("solved")].update(passed=False, reason="timeout")
    certificate["reason"] = "solved: timeout"


def _attacked(hit: dict[str, Any] | None, hits: int = 1, tier: str = "retry") -> Change:
    """The manifest tells of an attack that nobody has made."""
    listed = [] if hit is None else [{**hit, "tier": tier, "raw": False}]
    rates = [{"tier": tier, "raw": False, "rollouts": 100, "hits": hits, "refuting": 0}]
    return _manifest(attack={"task": "domino_single", "rates": rates, "hits": listed})


def _left_out_by_an_attack(draft: Draft) -> None:
    """A scenario that the author did not like is said to have a way around, and nobody sees it."""
    del draft.rows[0]
    _attacked(None, hits=0)(draft)
    draft.manifest.update(n=1, first_draws=1, reasons={"attack: a way around, by retry, raw, without a - b: c": 1})
    draft.manifest["funnel"].update(certified=1)


_ENTRY = {"file": "hits/a.npz", "sha256": "0" * 64}


def _hit(make: Callable[[Path], None]) -> Callable[[Path], None]:
    """A file in place of a hit that the manifest lists, with a hash to match."""

    def damage(folder: Path) -> None:
        path = folder / "hits" / "a.npz"
        path.parent.mkdir()
        make(path)
        if path.is_file():
            manifest = json.loads((folder / "manifest.json").read_text())
            manifest["attack"]["hits"][0]["sha256"] = sha256(path.read_bytes())
            write_manifest(folder, manifest)

    return damage


def _npz(**about: Any) -> Callable[[Path], None]:
    """A hit whose description has these entries."""
    whole = {"scenario": "0" * 12, "tier": "retry", "raw": False, "plan": "", "seconds": 1.0, "digest": "0" * 16,
             "lacks": [], "unmoved": [], "params": {}, "task": "domino_single", "rules": "strict", **about}  # fmt: skip
    return lambda path: np.savez(path, actions=np.zeros((3, 7), np.float32), about=json.dumps(whole))


HITS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "is_a_pipe": (r"plain file", os.mkfifo),
    "is_a_link": (r"plain file", lambda path: path.symlink_to("/dev/zero")),
    "is_noise": (r"not a hit", lambda path: path.write_bytes(bytes(range(256)))),
    "without_parameters": (r"not a hit.*params", _npz(params=None)),
    "of_endless_time": (r"not a hit.*seconds", _npz(seconds=1e300)),
    "of_another_scenario": (r"hit", _npz(params={"count": 5})),
}
"""What stands in place of a hit."""


CHANGES: dict[str, tuple[str, str, Change]] = {
    # name: base, reason, change
    "reject_without_its_scene": ("single_kept", r"reject|scene", lambda d: d.rejected[0].update(scene_xml="")),
    "reject_of_another_scene": (
        "single_kept",
        r"reject|scene",
        lambda d: d.rejected[0].update(scene_xml=d.row["scene_xml"]),
    ),
    "keep_without_rejects": ("single_kept", r"reject|keep|kept", lambda d: d.rejected.clear()),
    "rejects_without_keep": ("single_kept", r"reject|keep|kept", _config(keep=[])),
    "reject_of_another_index": ("single_kept", r"reject|index|drawn", lambda d: d.rejected[0].update(index=40)),
    "left_out_by_an_attack": ("single_quick", r"way around", _left_out_by_an_attack),
    "hits_of_nobody": ("single_quick", r"hit", _attacked({"file": "hits/a.npz", "sha256": "0" * 64})),
    "attacked_by_an_unknown_tier": ("single_quick", r"unknown tier", _attacked(None, hits=0, tier="thorough")),
    "hits_not_counted": ("single_quick", r"hits", _attacked(None, hits=3)),
    "reject_of_a_certified_index": ("single_kept", r"reject|certified too", _certified_too),
    "reject_twice": ("single_kept", r"reject", lambda d: d.rejected.append(copy.deepcopy(d.rejected[0]))),
    "reject_for_another_reason": ("single_kept", r"reject|reasons", _other_reason),
    "reject_of_another_check": ("single_kept", r"reject|reasons|funnel", _other_check),
    "reject_certified": ("single_kept", r"reject|verdict", lambda d: d.rejected[0]["certificate"].update(reason="")),
}

CASES = [
    *(Case(f"{base}__{name}", base, "reject", says, change) for name, (base, says, change) in CHANGES.items()),
    *(
        Case(f"single_quick__hit_{name}", "single_quick", "reject", says, _attacked(_ENTRY), _hit(make))
        for name, (says, make) in HITS.items()
    ),
    Case("single_quick__tier_with_markup", "single_quick", "refuse", r"tier", _attacked(None, 0, "<b>sure</b>\n# A")),
]
