"""T31: ways to a rod on the ridge without setting it down in its place."""

from hand import Hand, otherwise

from scengen.geometry import UP
from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.skills.jaw import grasp, pick, release
from scengen.skills.motion import OPEN, hold, push
from scengen.tasks.balance import GRIP_DEPTH, LIFT_HEIGHT, MAX_TILT, RIDGE, UprightRod


class Leaned(UprightRod):
    """The task if a rod counts that the robot touches, as often as it likes."""

    def success(self, world: World) -> bool:
        return world.tilt("rod") <= MAX_TILT and world.touching_bodies("rod") - {ROBOT} == {RIDGE}


def leaned(scenario: Scenario) -> Scenario:
    return otherwise(with_values(Leaned(), values(scenario)))


def hold_its_end(scenario: Scenario, world: World) -> Plan:
    """Stand the rod on the ridge and keep hold of its end."""
    assert isinstance(scenario, UprightRod)
    yield from scenario._hold(world)


def lean_on_a_finger(scenario: Scenario, world: World) -> Plan:
    """Grip the rod across the ridge, put its centre of mass beside the ridge, open the jaw a little: it leans there."""
    assert isinstance(scenario, UprightRod)
    arm, rod = world.arm, scenario.rod
    grip = world.pos("rod") + (rod.height - GRIP_DEPTH) * UP
    yield from pick(arm, grip, world.rot("rod")[:, 1], above=0.06, lift=LIFT_HEIGHT)
    yield from scenario.bring(world, rod.com - scenario.ridge.width / 2 - 0.002)
    yield from push(arm, -0.02 * UP, until=lambda: world.touching("rod", RIDGE))
    yield from hold(arm, 0.05, OPEN)
    yield from hold(arm, 3.0, 0.0)


def open_and_catch(scenario: Scenario, world: World) -> Plan:
    """Open the jaw on the ridge to see whether the rod stands, close it again, and then let go."""
    assert isinstance(scenario, UprightRod)
    yield from scenario.lift(world)
    yield from scenario.bring(world, scenario.rod.com)
    yield from push(world.arm, -0.02 * UP, until=lambda: world.touching("rod", RIDGE))
    yield from release(world.arm, 0.3)
    yield from grasp(world.arm)
    yield from scenario.leave(world)


def drop_from_above(scenario: Scenario, world: World) -> Plan:
    """Align the rod over the ridge and let it fall."""
    assert isinstance(scenario, UprightRod)
    yield from scenario._drop(world)


HANDS = {
    "hold_its_end": Hand(hold_its_end, leaned),
    "lean_on_a_finger": Hand(lean_on_a_finger, leaned),
    "open_and_catch": Hand(open_and_catch),
    "drop_from_above": Hand(drop_from_above),
}
