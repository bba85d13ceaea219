"""False claims about the checks: lists, settings, numbers and verdicts that the certificate does not bear out."""

import copy
from typing import Any

from forgery import Case, Draft
from labels import OTHERS, Change, _both


def _only(*names: str) -> Change:
    def change(draft: Draft) -> None:
        draft.certificate["checks"] = [check for check in draft.certificate["checks"] if check["name"] in names]

    return change


def _without(name: str) -> Change:
    def change(draft: Draft) -> None:
        draft.certificate["checks"] = [check for check in draft.certificate["checks"] if check["name"] != name]

    return change


def _check(which: str, /, **columns: Any) -> Change:
    return lambda draft: draft.check(which).update(copy.deepcopy(columns))


def _numbers(name: str, **numbers: Any) -> Change:
    return lambda draft: draft.check(name)["numbers"].update(copy.deepcopy(numbers))


def _settings(name: str, **settings: Any) -> Change:
    return lambda draft: draft.check(name)["settings"].update(settings)


def _certificate(**columns: Any) -> Change:
    return lambda draft: draft.certificate.update(columns)


def _drop_number(name: str, which: int = 0) -> Change:
    def change(draft: Draft) -> None:
        numbers = draft.check(name)["numbers"]
        del numbers[sorted(numbers)[which]]

    return change


def _first_number(name: str, *below: str, **numbers: Any) -> Change:
    """Of the first shortcut, at one of its two tries, or of the first ablation."""

    def change(draft: Draft) -> None:
        found = draft.check(name)["numbers"]
        found = found[min(found)]
        for key in below:
            found = found[key]
        found.update(numbers)

    return change


def _drop_try(draft: Draft) -> None:
    numbers = draft.check("shortcuts")["numbers"]
    del numbers[min(numbers)]["raw"]


def _swapped(draft: Draft) -> None:
    checks = draft.certificate["checks"]
    checks[4], checks[5] = checks[5], checks[4]


def _doubled(draft: Draft) -> None:
    draft.certificate["checks"].append(copy.deepcopy(draft.certificate["checks"][3]))


def _invented(draft: Draft) -> None:
    draft.certificate["checks"].append(
        {"name": "peer_reviewed", "passed": True, "reason": "", "settings": {}, "numbers": {}}
    )


def _all_certify(**settings: Any) -> Change:
    """The manifest's settings, and nothing else, say something better."""
    return lambda draft: draft.config["certify"].update(settings)


def _tighter_rest(draft: Draft) -> None:
    """Limits of one's own that the scenario does not keep, and numbers that would."""
    draft.config["certify"]["rest"]["drift"] = 1e-8
    for row in draft.rows:
        rest = next(check for check in row["certificate"]["checks"] if check["name"] == "rest")
        rest["settings"]["drift"], rest["numbers"]["drift"] = 1e-8, 5e-9


def _tighter_overlap(draft: Draft) -> None:
    draft.config["certify"]["overlap"] = 1e-20
    for row in draft.rows:
        overlap = next(check for check in row["certificate"]["checks"] if check["name"] == "overlap")
        overlap["settings"]["overlap"], overlap["numbers"]["deepest"] = 1e-20, 0.0


def _promoted(draft: Draft) -> None:
    """A scenario that failed a check stands among the certified ones, every check edited to passed."""
    row, sound = copy.deepcopy(draft.rejected[0]), copy.deepcopy(draft.row["certificate"]["checks"])
    for mine, theirs in zip(row["certificate"]["checks"], sound, strict=True):
        if not mine["passed"]:
            mine.update(passed=True, reason="", settings=theirs["settings"], numbers=theirs["numbers"])
    row["certificate"].update(verdict="certified", reason="")
    draft.rows, draft.rejected = [row, *draft.rows], []
    draft.timed(len(row["witness"]), draft.check("solved")["numbers"]["seconds"])
    counts = dict.fromkeys(draft.manifest["funnel"], 2)
    draft.manifest.update(n=2, indices=2, first_draws=2, reasons={}, funnel=counts)
    draft.config["keep"] = []


def _left_out(draft: Draft) -> None:
    """A scenario that was certified is said to have failed, with every count to match: the author did not like it."""
    del draft.rows[0]
    draft.manifest.update(n=1, first_draws=1, reasons={"robust: # of # jittered runs succeed; run #: dropped": 1})
    draft.manifest["funnel"].update(robust=1, certified=1)


CHECKS: dict[str, tuple[str, Change]] = {
    "one_check_listed": (r"checks|complete", _only("witness")),
    "no_check_listed": (r"checks|complete|settle", _only()),
    "idle_not_listed": (r"checks|complete", _without("idle")),
    "shortcuts_not_listed": (r"checks|complete", _without("shortcuts")),
    "checks_exchanged": (r"checks|complete|order", _swapped),
    "check_twice": (r"checks|complete", _doubled),
    "check_invented": (r"checks|complete", _invented),
    "check_renamed": (r"checks|complete", _check("robust", name="sturdy")),
    "attack_not_listed": (r"checks|complete", _without("attack")),
    "attack_called_made": (r"attack", _check("attack", passed=True, reason="")),
    "attack_called_made_with_numbers": (
        r"attack",
        _check("attack", passed=True, reason="", settings={"rollouts": 8}, numbers={"raw": {"rollouts": 8, "hits": 0}}),
    ),
    "attack_for_another_reason": (r"attack", _check("attack", reason="not checked: everybody knows")),
    "ablations_called_nothing": (
        r"ablation",
        _check("ablations", passed=None, reason="not checked: the family has none", numbers={}),
    ),
    "check_failed": (r"complete|robust|passed", _check("robust", passed=False, reason="0 of 4 jittered runs succeed")),
    "check_skipped": (r"complete|idle|passed", _check("idle", passed=None, reason="not asked for")),
    "passed_with_a_reason": (r"reason|robust", _check("robust", reason="2 of 4 jittered runs succeed")),
    "verdict_refuted": (r"complete|verdict", _certificate(verdict="refuted")),
    "verdict_proved": (r"complete|verdict", _certificate(verdict="proved")),
    "verdict_with_a_reason": (r"reason|verdict|complete", _certificate(reason="robust: 1 of 4")),
    "called_full": (r"settings|full", _certificate(settings="full")),
    "called_full_everywhere": (
        r"settings|full|runs|bound",
        _both(
            _certificate(settings="full"),
            lambda d: d.rows[1]["certificate"].update(settings="full"),
            _all_certify(name="full"),
        ),
    ),
    "called_strict": (r"settings|strict", _both(_certificate(settings="strict"), _all_certify(name="strict"))),
    "manifest_asks_for_more": (
        r"settings|runs|robust",
        lambda d: d.config["certify"]["robust"].update(runs=14, bound=0.8),
    ),
    "rest_was_lenient": (r"settings|rest", _settings("rest", drift=0.5)),
    "rest_was_short": (r"settings|rest", _settings("rest", seconds=0.1)),
    "overlap_was_lenient": (r"settings|overlap", _settings("overlap", overlap=0.02)),
    "jitter_was_small": (r"settings|robust", _settings("robust", position=0.0, noise=0.0)),
    "bound_was_low": (r"settings|robust|bound", _settings("robust", bound=0.01)),
    "runs_were_few": (r"settings|robust|runs", _settings("robust", runs=1)),
    "settle_was_short": (r"settle|settings", _settings("witness", settle=0.01)),
    "idle_was_short": (r"settings|idle|horizon", _settings("idle", horizon=0.1)),
    "solved_had_longer": (r"settings|solved|horizon", _settings("solved", horizon=120.0)),
    "settings_added": (r"settings", _settings("rest", patience=3)),
    "overlap_beyond_its_limit": (r"overlap", _numbers("overlap", deepest=0.004)),
    "rest_beyond_its_limit": (r"rest|drift", _numbers("rest", drift=0.02)),
    "turn_beyond_its_limit": (r"rest|turn", _numbers("rest", turn=3.0)),
    "drift_is_nan": (r"rest|drift|finite|NaN|JSON|canonical", _numbers("rest", drift=float("nan"))),
    "idle_reached_the_goal": (r"idle", _numbers("idle", outcome="success", reason="")),
    "shortcut_reached_the_goal": (r"shortcut", _first_number("shortcuts", "filtered", outcome="success", reason="")),
    "shortcut_reached_the_goal_raw": (r"shortcut", _first_number("shortcuts", "raw", outcome="success", reason="")),
    "shortcut_tried_once": (r"shortcut", _drop_try),
    "shortcut_not_told": (r"shortcut", _drop_number("shortcuts")),
    "ablation_reached_the_goal": (r"ablation", _first_number("ablations", outcome="success", reason="")),
    "ablation_not_told": (r"ablation", _drop_number("ablations")),
    "robust_one_of_four": (r"robust|bound", _numbers("robust", solved=1)),
    "robust_bound_too_good": (r"robust|bound", _numbers("robust", bound=0.99)),
    "robust_more_runs": (r"robust|runs", _numbers("robust", runs=100, solved=100, bound=0.97)),
    "robust_failures_and_none": (r"robust|failures", _numbers("robust", failures=["run 0: dropped", "run 2: dropped"])),
    "oracle_timed_out": (r"solved", _numbers("solved", outcome="timeout")),
    "solved_after_the_horizon": (r"solved|horizon|seconds", _numbers("solved", seconds=99.0)),
    "solved_sooner": (r"solved|witness|seconds", _numbers("solved", seconds=0.5)),
    "witness_sooner": (r"witness|seconds", _numbers("witness", seconds=0.5)),
    "witness_shorter": (r"witness|periods", _numbers("witness", periods=10)),
    "numerics_flipped": (r"numerics", _numbers("numerics", half_time_step={"witness": "failure"})),
    "numerics_half_told": (r"numerics", _drop_number("numerics")),
    "features": (r"feasible|features", _drop_number("feasible")),
    "feature_invented": (r"feasible|features", _numbers("feasible", gap_over_height=0.1)),
    "counts": (r"compiles|bodies", _numbers("compiles", bodies=3)),
}
"""Refuted without simulating anything but the witness."""

RECHECKED: dict[str, tuple[str, str, Change]] = {
    "stiller_than_it_is": ("single_quick", r"rest|drift", _tighter_rest),
    "overlaps_less": ("single_quick", r"overlap", _tighter_overlap),
    "overlap_is_zero": ("select_id", r"overlap", _numbers("overlap", deepest=9e-4)),
    "drifts_less": ("single_quick", r"rest|drift", _numbers("rest", drift=9e-4)),
    "idle_fails_early": ("single_quick", r"idle", _numbers("idle", outcome="failure", seconds=0.3)),
    "ablation_fails_early": ("single_quick", r"ablation", _first_number("ablations", outcome="failure", seconds=0.1)),
    "tool_ablation_fails_early": ("tool_id", r"ablation", _first_number("ablations", outcome="unstable", seconds=0.1)),
    "numerics_hold_by_oracle": (
        "single_quick", r"numerics", _numbers("numerics", half_time_step={"witness": "timeout", "oracle": "success"})),
}  # fmt: skip
"""Refuted by repeating the checks that need no oracle."""

CERTIFIED_AGAIN: dict[str, tuple[str, str, Change]] = {
    "left_out": ("single_quick", r"certified here", _left_out),
    "failed_check_edited": ("single_kept", r"robust", _promoted),
    "shortcut_fails_early": (
        "single_quick",
        r"shortcut",
        _first_number("shortcuts", "raw", seconds=0.01, reason="gave up"),
    ),
}
"""Refuted by certifying again with the oracle, and by nothing less."""

QUICK = {
    "one_check_listed", "check_failed", "called_full_everywhere", "settle_was_short", "rest_beyond_its_limit",
    "robust_one_of_four", "ablation_not_told",
}  # fmt: skip

EVERY = ("idle_not_listed", "shortcut_not_told", "rest_was_lenient", "ablation_not_told")
WITHOUT_ABLATIONS = ("collapse_id", "mirror_id", "slip_id", "stack_id", "ycb_id")
"""Pools of families that have none: there is nothing to leave out."""


def _cases() -> list[Case]:
    found = []
    for name, (says, change) in CHECKS.items():
        found.append(Case(f"single_quick__{name}", "single_quick", "reject", says, change, quick=name in QUICK))
    for base in OTHERS:
        for name in EVERY[: -1 if base in WITHOUT_ABLATIONS else None]:
            says, change = CHECKS[name]
            found.append(Case(f"{base}__{name}", base, "reject", says, change))
    for level, cases in (("recheck", RECHECKED), ("full", CERTIFIED_AGAIN)):
        for name, (base, says, change) in cases.items():
            quick = name == "stiller_than_it_is"
            found.append(Case(f"{base}__{name}", base, "reject", says, change, level=level, quick=quick))
    return found


CASES = _cases()
