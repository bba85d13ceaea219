"""T11: the jaw is opened by one period only and closed when the bob is seen to turn: nothing needs to begin earlier."""

from hand import Hand

from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.jaw import grasp
from scengen.skills.motion import COARSE, OPEN, Pace, go_to, hold, until
from scengen.tasks.pendulum_grasp import HINGE, NEAR_SIDE, PendulumGrasp

KEPT = 0.0  # gripper command that keeps the gap
TURNS = 0.15  # rate below which the bob is seen to turn [rad/s]


def narrow_jaw(scenario: Scenario, world: World) -> Plan:
    """Wait at the near turning point with a jaw that is 3 mm wider than the bob, and close when the bob turns."""
    assert isinstance(scenario, PendulumGrasp)
    arm, rot = world.arm, scenario.grasp_rot
    at = scenario.bob_at(NEAR_SIDE * scenario.peak_angle)
    yield from go_to(arm, at - 0.10 * rot[:, 2], rot, COARSE, KEPT)
    yield from hold(arm, 0.01, OPEN)

    def far() -> bool:
        angle, rate = world.hinge(HINGE)
        return angle > 0.0 and rate > 0.0

    def turns() -> bool:
        angle, rate = world.hinge(HINGE)
        return angle < 0.0 and rate > -TURNS

    yield from until(hold(arm, 3.0, KEPT), far)
    yield from go_to(arm, at, rot, Pace(0.30, 0.004, 2.0), KEPT)
    yield from until(hold(arm, 3.0, KEPT), lambda: world.hinge(HINGE)[0] > 0.0)
    yield from until(hold(arm, 3.0, KEPT), turns)
    yield from grasp(arm)
    yield from hold(arm, 1.0)


HANDS = {"narrow_jaw": Hand(narrow_jaw)}
