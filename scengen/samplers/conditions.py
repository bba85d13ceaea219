"""Conditions of control, which are parts of a split as axes are, and which every task has.

`action_delay@3` is the third level of one, `wide_gaps@3+payload@1` goes with an axis. Strengths are in
`conf/perturbations`, of which these kinds are those that change what happens and not only what is perceived. Values
depend on kind, scenario and seed; their strength on the level.
"""

from collections.abc import Callable, Mapping
from functools import cache

import yaml

from ..control.impairment import Impairment
from ..errors import BadConfig
from ..robots.panda import JOINTS
from ..scenario import Conditions
from .keyed import normals, unit
from .split import Part, Split
from .task_files import conf_dir

LEVELS = 5
"""Number of levels of each kind."""
START = "start_pose"
"""Kind whose values also depend on the scene: the arm must start free of contact."""
KINDS: Mapping[str, Callable[[float, float], dict[str, float]]] = {
    START: lambda strength, sign: {"size": strength},
    "action_delay": lambda strength, sign: {"delay": strength},
    "action_noise": lambda strength, sign: {"noise": strength},
    "lost_actions": lambda strength, sign: {"lost": strength},
    "stiffness": lambda strength, sign: {"stiffness": 2.0 ** (sign * strength)},
    "slow_gripper": lambda strength, sign: {"gripper": 1.0 / strength},
    "payload": lambda strength, sign: {"payload": strength},
}
"""Fields of an `Impairment` by kind, given the strength and a sign that the scenario draws."""


@cache
def strengths(kind: str) -> tuple[float, ...]:
    """Strengths of the levels of a kind of `KINDS`."""
    node = yaml.safe_load((conf_dir() / "perturbations" / f"{kind}.yaml").read_text())
    return tuple(map(float, node["strengths"]))


def check(part: Part) -> None:
    """Raise `BadConfig` unless a part of a split, whose axis is one of `KINDS`, has one of its levels."""
    if part.severity is None or not 1 <= part.severity <= LEVELS:
        raise BadConfig(f"split {part}: give {part.axis} a level from 1 to {LEVELS}, such as {part.axis}@3")


def split_under(split: Split | str, conditions: Conditions | None) -> Split:
    """A split under conditions."""
    parts = (Part(kind, level) for kind, level in (conditions.parts if conditions else ()))
    return Split((*Split.parse(split).parts, *parts))


def impairment(conditions: Conditions, scenario: str, seed: int = 0) -> Impairment:
    """What the conditions of a scenario do, but for another start.

    Args:
        scenario: id of the scenario without conditions.
        seed: another number draws other values.
    """
    found = dict[str, float]()
    for kind, level in conditions.parts:
        found |= values(kind, level, scenario, seed) if kind != START else {}
    return Impairment(**found)  # type: ignore[arg-type]


def values(kind: str, level: int, scenario: str, seed: int = 0) -> dict[str, float]:
    """Values of a kind, by field of `Impairment`; of another start its size, because its offsets depend on the scene.

    Args:
        scenario: id of the scenario without conditions.
        seed: another number draws other values.
    """
    sign = 1.0 if unit("condition", kind, scenario, seed) < 0.5 else -1.0
    found = KINDS[kind](strengths(kind)[level - 1], sign)
    if found.keys() & {"noise", "lost"}:
        found["key"] = float(int(unit("condition", "key", scenario, seed) * 2**31))
    return found


def start(conditions: Conditions, arms: int, scenario: str, seed: int, attempt: int) -> tuple[float, ...]:
    """Offsets of the joints of all arms [rad], whose root mean square over each arm is the strength; empty if the
    conditions have no other start.

    Args:
        arms: number of driven arms.
        attempt: number of the try, from 0.
    """
    level = dict(conditions.parts).get(START)
    if level is None:
        return ()
    size, found = strengths(START)[level - 1], list[float]()
    for arm in range(arms):
        way = normals(JOINTS, "condition", START, scenario, seed, attempt, arm)
        length = sum(each**2 for each in way) ** 0.5
        found += [round(size * JOINTS**0.5 * each / length, 6) for each in way]
    return tuple(found)
