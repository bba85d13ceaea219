"""T21: the hand's narrow side fits through the gap: the ball is dragged through in the jaw, and nudged behind it."""

from contextlib import suppress

from hand import Hand

from scengen.errors import GaveUp
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import carry, pick, release
from scengen.skills.motion import CLOSED, Pace, go_to, hold, push, retreat
from scengen.tasks.gap_funnel import GapFunnel


def drag(scenario: GapFunnel, world: World, beyond: float) -> Plan:
    """Take the ball along the gap's axis, draw it in front of the gap, and through it by a distance [m]."""
    arm, height = world.arm, float(world.com("ball")[2])
    yield from pick(arm, world.com("ball"), scenario.normal, above=0.09, lift=0.0)
    for way in (-scenario.before, beyond):
        spot = scenario.gap_at + way * scenario.normal
        with suppress(GaveUp):
            yield from carry(arm, "ball", [spot[0], spot[1], height], pace=Pace(0.12, 0.003, 6.0))


def through_and_nudge(scenario: Scenario, world: World) -> Plan:
    """Release the ball just behind the wall, and push it on with closed fingers that are in the gap."""
    assert isinstance(scenario, GapFunnel)
    arm = world.arm
    yield from drag(scenario, world, 0.025)
    yield from release(arm, 0.3)
    yield from retreat(arm, 0.047, Pace(0.2, 0.008, 1.5))
    start, rot = world.com("ball") - 0.052 * scenario.normal, arm.hand_rot
    for place in ([*start[:2], arm.hand[2]], start):
        yield from go_to(arm, place, rot, Pace(0.2, 0.006, 4.0), CLOSED)
    end = world.time + 1.0
    speed = 1.1 * scenario.speed_for(float((scenario.zone_at - world.com("ball")) @ scenario.normal))
    yield from push(arm, speed * scenario.normal, lambda: world.time > end or forward(scenario, world) > 0.055, CLOSED)
    yield from hold(arm, 4.0)


def forward(scenario: GapFunnel, world: World) -> float:
    """Distance of the ball behind the middle of the wall [m]."""
    return float((world.com("ball") - scenario.gap_at) @ scenario.normal)


HANDS = {"through_and_nudge": Hand(through_and_nudge)}
