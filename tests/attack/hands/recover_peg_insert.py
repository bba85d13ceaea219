"""T02: the nose enters askew, is squared up inside, and the board turns around a peg that is in already."""

import math
from collections.abc import Sequence

from hand import Hand, otherwise

from scengen.geometry import about_z
from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.insertion import Line
from scengen.skills.jaw import release
from scengen.skills.motion import facing, retreat, turn_to
from scengen.tasks.recover_peg_insert import BOARD_CLEARANCE, RecoverPegInsert


class TurnsAroundPeg(RecoverPegInsert):
    """The task without its rule: the board also turns when the nose of an inserted peg comes out behind."""

    def outside(self, lengthwise: Sequence[float]) -> bool:
        return True


def unmended(scenario: Scenario) -> Scenario:
    return otherwise(with_values(TurnsAroundPeg(), values(scenario)))


def enter_askew(scenario: Scenario, world: World) -> Plan:
    """Bring the nose in 9 deg askew, where the peg is not in line, square it up inside, push it home."""
    assert isinstance(scenario, RecoverPegInsert)
    arm = world.arm

    def askew() -> Line:
        rot, mouth = scenario.slot(world)
        return about_z(math.radians(9.0)) @ rot, mouth

    def nose_in() -> bool:
        return max(end[0] for end in scenario.ends(world)) > 0.012

    yield from scenario.take(world)
    yield from turn_to(arm, facing(scenario._azimuth, math.pi / 2), 1.2)
    yield from scenario.guide(world, askew, -0.02, 0.25)
    stop = world.time + 4.0
    yield from scenario.guide(world, askew, 0.03, 0.06, lambda: nose_in() or world.time > stop)
    stop = world.time + 4.0
    ends = lambda: scenario._near_board(world, BOARD_CLEARANCE) or world.time > stop  # noqa: E731
    yield from scenario.guide(world, lambda: scenario.slot(world), scenario.peg.length, 0.06, ends)
    yield from release(arm)
    yield from retreat(arm, 0.05)
    yield from scenario.push_home(world)


HANDS = {"enter_askew": Hand(enter_askew, unmended)}
