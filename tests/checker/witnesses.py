"""False witnesses: actions that nobody could have sent, that nobody plays, or that do not reach the goal."""

from collections.abc import Callable

import numpy as np
from forgery import ELSEWHERE, Case, Draft
from labels import OTHERS, Change
from scipy.special import betaincinv


def _witness(change: Callable[[np.ndarray], np.ndarray], played: bool = True) -> Change:
    """Other actions in the first scenario; the final state is right where they still reach the goal."""

    def forge(draft: Draft) -> None:
        actions = change(draft.row["witness"].copy())
        draft.row["witness"] = actions
        if played:
            draft.played()
            draft.row["witness"] = actions
            draft.timed(len(actions), draft.check("witness")["numbers"]["seconds"])

    return forge


def _jerk(actions: np.ndarray) -> np.ndarray:
    """In the settling time the arm is told to go from one extreme to the other in one period."""
    actions[-20:, 2] = np.where(np.arange(20) % 2, 1.0, -1.0)
    return actions


def _beyond(actions: np.ndarray) -> np.ndarray:
    actions[-10:, 2] = np.linspace(0.1, 1.5, 10)
    return actions


def _tail(actions: np.ndarray) -> np.ndarray:
    """A hundred rows that nobody ever plays."""
    return np.vstack([actions, np.tile(np.float32([0, 0, 0, 0, 0, 0, -1]), (100, 1))]).astype(np.float32)


def _tail_elsewhere(draft: Draft) -> None:
    """Ten minutes of actions behind the end, where the lengths of other machines need not be equal."""
    draft.everywhere(fingerprint=ELSEWHERE)
    actions = draft.row["witness"]
    draft.row["witness"] = np.vstack([actions, np.tile(actions[-1:], (60_000, 1))])
    draft.timed(len(draft.row["witness"]), draft.check("witness")["numbers"]["seconds"])


def _spoiled(value: float) -> Callable[[np.ndarray], np.ndarray]:
    def change(actions: np.ndarray) -> np.ndarray:
        actions[40, 1] = value
        return actions

    return change


def _unfiltered(draft: Draft) -> None:
    """The oracle without the filter of the interface: another, quicker robot."""
    from scengen import load_task
    from scengen.sim.world import World

    row = draft.row
    scenario = load_task(row["task"]).scenario(row["params"])
    world = World.load(row["scene_xml"], row["embodiment"])
    world.reset()
    actions = []
    for action in scenario.oracle(world):
        actions.append(np.asarray(action, np.float32))
        world.step_filtered(actions[-1])
        if scenario.success(world):
            break
    draft.played(np.array(actions, np.float32))


def _of_the_second(draft: Draft) -> None:
    draft.row["witness"] = draft.rows[1]["witness"].copy()


def _other_robustness(draft: Draft) -> None:
    """The oracle is said to have failed one of its jittered runs, which all succeed. The settings allow for it."""
    draft.config["certify"]["robust"]["bound"] = 0.2
    for row in draft.rows:
        robust = next(check for check in row["certificate"]["checks"] if check["name"] == "robust")
        robust["settings"]["bound"] = 0.2
    told = {"solved": 3, "bound": float(betaincinv(3, 2, 0.05)), "failures": ["run 2: the tile was missed"]}
    draft.check("robust")["numbers"].update(told)


def _other_robustness_and_witness(draft: Draft) -> None:
    """The same beside a witness that differs from the oracle's actions by one bit of one gripper command."""
    _other_robustness(draft)
    actions = draft.row["witness"].copy()
    actions[3, 6] = np.nextafter(actions[3, 6], np.float32(0))
    draft.played(actions)


def _other_numerics_and_witness(draft: Draft) -> None:
    """Numbers of a check that replays the witness, beside such a witness."""
    _other_robustness_and_witness(draft)
    draft.check("numerics")["numbers"]["half_time_step"] = {"witness": "timeout", "oracle": "success"}


CERTIFIED_AGAIN = {
    "robustness_of_another": ("reject", r"robust has other numbers", _other_robustness),
    "robustness_beside_another": ("decline", r"robust has other numbers.*oracle", _other_robustness_and_witness),
    "numerics_beside_another": ("reject", r"numerics has other numbers", _other_numerics_and_witness),
}
"""Noticed by certifying again, and by nothing less."""

WITNESS: dict[str, tuple[str, Change]] = {
    "nothing": (r"witness", _witness(lambda a: a[:0], played=False)),
    "half_of_it": (r"witness", _witness(lambda a: a[: len(a) // 3], played=False)),
    "of_the_second": (r"witness", _of_the_second),
    "mirrored": (r"witness", _witness(lambda a: a * np.float32([-1, -1, 1, 1, 1, 1, 1]), played=False)),
    "nan": (r"witness|finite", _witness(_spoiled(float("nan")), played=False)),
    "infinite": (r"witness|finite", _witness(_spoiled(float("inf")), played=False)),
    "jerk": (r"witness|filter", _witness(_jerk)),
    "beyond_one": (r"witness|filter", _witness(_beyond)),
    "tail": (r"witness", _witness(_tail)),
    "tail_elsewhere": (r"witness", _tail_elsewhere),
    "unfiltered_oracle": (r"witness|filter", _unfiltered),
}

QUICK = ("jerk", "tail", "half_of_it")

CASES = [
    *(
        Case(f"single_quick__witness_{name}", "single_quick", "reject", says, change, quick=name in QUICK)
        for name, (says, change) in WITNESS.items()
    ),
    *(
        Case(f"single_quick__witness_{name}", "single_quick", expect, says, change, level="full")
        for name, (expect, says, change) in CERTIFIED_AGAIN.items()
    ),
    *(Case(f"{base}__witness_half_of_it", base, "reject", *WITNESS["half_of_it"]) for base in OTHERS),
]
