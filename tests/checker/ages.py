"""False claims about the version of the task: old pools that pass for today's, false ones that name another version.

An author may write any number into a pool. Today's numbers in an old pool must gain nothing, and another version must
not turn a fault into a success: what cannot be compared is declined, and never sound.
"""

from forgery import ELSEWHERE, Case, Draft
from labels import Change, _both, _certificate, _config, _manifest, _param, _row, _task

VERSION = r"version 2 of domino_single"
"""Reason why a claim against another version is declined."""


def _version(number: int) -> Change:
    """The whole pool says that it was certified against this version."""
    return lambda draft: draft.everywhere(task_version=number)


def _todays_code(draft: Draft) -> None:
    """The pool says that it was made with the code of today."""
    from scengen import load_task
    from scengen.validate.identity import source_sha256

    draft.everywhere(source_sha256=source_sha256(load_task(draft.task["name"]).family))


def _scene(pattern: str, new: str) -> Change:
    """A scene of older physics, on a machine whose bits are not compared."""

    def change(draft: Draft) -> None:
        draft.scene(pattern, new, rows=len(draft.rows))
        draft.everywhere(fingerprint=ELSEWHERE)

    return change


def _unsealed(draft: Draft) -> None:
    draft.scene("<option ", '<option gravity="0 0 -5" ')
    draft.row["kept"] = ("scene_sha256",)


def _jerk(draft: Draft) -> None:
    draft.row["witness"] = draft.row["witness"].copy()
    draft.row["witness"][5] = -draft.row["witness"][40]
    draft.row["witness"][6] = 1.0


def _solved_by_shortcut(draft: Draft) -> None:
    numbers = draft.check("shortcuts")["numbers"]
    numbers[min(numbers)]["raw"]["outcome"] = "success"


def _gone(draft: Draft) -> None:
    draft.row["params"]["gone"] = 1.0


GRAVITY = _scene("<option ", '<option gravity="0 0 -3" ')
SLIPPERY = _scene('friction="[^"]*"', 'friction="0.1 0.005 0.0001"')

CHANGES: dict[str, tuple[str, str, Change]] = {
    # old pools with the numbers of today
    "old_scene_as_today": ("reject", r"scene", _both(GRAVITY, _version(1), _todays_code)),
    "old_friction_as_today": ("reject", r"scene", _both(SLIPPERY, _version(1), _todays_code)),
    "old_draw_as_today": ("reject", r"parameters|drawn", _both(_param("x", 0.9), _version(1), _todays_code)),
    "old_seed_as_today": ("reject", r"parameters|drawn", _both(_config(seed=77), _version(1), _todays_code)),
    "old_time_limit_as_today": ("reject", r"horizon", _both(_task(horizon=60.0), _version(1), _todays_code)),
    "old_verdict_as_today": (
        "reject",
        r"another state",
        _both(_certificate(final_state="1" * 16), _version(1), _todays_code),
    ),
    # false pools that flee into another version
    "other_version_hand_picked": ("refuse", VERSION, _both(_param("x", 0.9), _version(2))),
    "other_version_easier_scene": ("refuse", VERSION, _both(GRAVITY, _version(2))),
    "other_version_other_seed": ("refuse", VERSION, _both(_config(seed=77), _version(2))),
    "other_version_wrong_hash": ("reject", r"sha256", _both(_unsealed, _version(2))),
    "other_version_unfiltered": ("reject", r"filter", _both(_jerk, _version(2))),
    "other_version_shortcut_solves": ("reject", r"shortcuts", _both(_solved_by_shortcut, _version(2))),
    "other_version_unknown_parameter": ("reject", r"horizon", _both(_row(horizon=60.0), _gone, _version(2))),
    # versions that contradict each other, or are none
    "version_of_a_row": ("reject", r"task_version", _certificate(task_version=2)),
    "version_of_the_manifest": ("refuse", r"task_version", _manifest(task_version=2)),
    "version_none": ("refuse", r"task_version", _version(0)),
    "version_enormous": ("refuse", r"version", _both(_param("x", 0.9), _version(10**9))),
}
"""What must be said of each, its reason, and the change."""

CASES = [
    *(Case(f"single_quick__{name}", "single_quick", *told) for name, told in CHANGES.items()),
    Case("single_quick__other_version", "single_quick", "accept", VERSION, _version(2)),
]
