"""Written cheats, by task: plans around what a task is about, for those who know it.

The declared shortcuts of a family are cheats too; here stand those that it does not declare. They tell which mutants
can be exploited at all. The adversary never sees them.
"""

import math
from collections.abc import Callable, Mapping
from contextlib import suppress

import numpy as np
from test_hands import HANDS

from scengen.assets.cage import lowered
from scengen.errors import GaveUp
from scengen.geometry import UP, heading, shortest
from scengen.robots.jaw import TIP_BELOW
from scengen.scenario import Plan, Shortcut
from scengen.sim.world import World
from scengen.skills.jaw import carry, grasp, pick, release
from scengen.skills.motion import CLOSED, COARSE, OPEN, STEADY, Pace, go_to, hold, push, retreat, turn_to, until

Cheat = Callable[..., Plan]


def _take_starter(self, world: World) -> Plan:
    across = np.array([-self.u[1], self.u[0], 0.0])
    high = self.spot(0) + 0.7 * self.starter.height * UP
    yield from pick(world.arm, high, closing=across, above=0.08, lift=0.12)


def knock_slab_with_starter(self, world: World) -> Plan:
    """Carry the first tile over the chain and knock the slab over with it."""
    yield from _take_starter(self, world)
    over = self.spot(self.count) + (self.slab.height + TIP_BELOW + 0.012) * UP - 0.05 * self.u
    yield from go_to(world.arm, over, pace=STEADY)
    yield from push(world.arm, 0.15 * self.u, lambda: self.success(world))


def strike_last_tile_with_starter(self, world: World) -> Plan:
    """Carry the first tile and strike the last one with its foot."""
    yield from _take_starter(self, world)
    last = self.spot(self.count - 1) + (0.75 * self.tile.height + 0.7 * self.starter.height) * UP
    yield from go_to(world.arm, last + 0.08 * UP - 0.03 * self.u)
    yield from go_to(world.arm, last - 0.03 * self.u)
    yield from push(world.arm, 0.15 * self.u, lambda: self.success(world))


def staircase(self, world: World) -> Plan:
    """Let the ball go too low, catch it as it comes back, 5 mm higher, and again."""
    arm, s = world.arm, self.release_place + 0.03
    yield from pick(arm, world.com("ball"), closing=self.axes[:, 1], lift=0.12)
    yield from carry(arm, "ball", self.resting(s) + 0.12 * UP, pace=COARSE)
    yield from carry(arm, "ball", self.resting(s) + 0.01 * UP)
    yield from push(arm, -0.04 * UP, until=lambda: world.touching("ball", "ramp/near"))
    while True:
        yield from release(arm, 0.12)
        yield from catch(world, "ball")
        yield from go_to(arm, arm.hand + self.resting(s - 0.02) - self.resting(s), pace=Pace(0.08, 0.002))
        s -= 0.02


def catch(world: World, body: str) -> Plan:
    """Keep the jaw open until a body that went away is coming back, then close it: the fingers need 0.15 s."""
    end, gone, last = world.time + 3.0, False, 0.0
    while world.time < end:
        away = float(np.linalg.norm(world.com(body) - world.arm.hand))
        if gone and away < min(last, 0.05):
            break
        gone, last = gone or away > 0.06, away
        yield np.append(np.zeros(6), OPEN)
    yield from grasp(world.arm)


def snap(self, world: World) -> Plan:
    """Lean the cage by 30 deg as fast as the hand turns, and back, towards one end and the other."""
    yield from self.pick_up(world)
    yield from self.present(world, lowered(0.5))
    level = world.arm.hand_rot
    for tilt in (0.5, -0.5) * 3:
        for rot in (shortest(world.rot("cage") @ lowered(tilt), -UP) @ world.arm.hand_rot, level):
            with suppress(GaveUp):
                yield from turn_to(world.arm, rot, rate=6.0, give_up=0.5)


def hop(self, world: World) -> Plan:
    """Take it up and shake it up and down."""
    yield from self.pick_up(world)
    yield from retreat(world.arm, 0.10)
    start = world.time
    while world.time < start + 6.0:
        sign = 1.0 if (world.time - start) % 0.3 < 0.15 else -1.0
        yield np.array([0.0, 0.0, sign, 0.0, 0.0, 0.0, CLOSED])


def slide_beside_the_stool(self, world: World) -> Plan:
    """Grasp the cage, slide it on the stool until the hole is beside it, and lower that end."""
    yield from until(self.pick_up(world), lambda: world.arm.grip == CLOSED)
    yield from grasp(world.arm)
    yield from go_to(world.arm, world.arm.hand + 0.05 * self.way * self.axes[:, 0], pace=Pace(0.05, 0.004))
    yield from self.tip(world, lowered(self.way * 0.6), rate=0.5)


def rock(self, world: World, amplitude: float = math.radians(8.0)) -> Plan:
    """Rock the cage to and fro about the level, so that the ball gets a little farther each time."""
    yield from self.pick_up(world)
    yield from self.present(world, lowered(amplitude))
    for tilt in (amplitude, -amplitude) * 6:
        with suppress(GaveUp):
            yield from turn_to(world.arm, shortest(world.rot("cage") @ lowered(tilt), -UP) @ world.arm.hand_rot)


def jerk_back(self, world: World) -> Plan:
    """Carry the cage slowly along, then jerk it back under the ball, and again."""
    yield from self.pick_up(world)
    along = self.way * self.axes[:, 0]
    for _ in range(8):
        for velocity, seconds in ((0.08, 1.0), (-0.6, 0.2)):
            with suppress(GaveUp):
                yield from push(world.arm, velocity * along, lambda: False, give_up=seconds)


def hold_the_weight_down(self, world: World) -> Plan:
    """Put the counterweight in the mirror image and press on it, or on the target, until the deck is level."""
    yield from self.put_at(world, self.mirror)
    arm, side = world.arm, -1 if self.tilt(world) > 0 else 1
    block = min(world.free_bodies, key=lambda name: -side * self.along(world, name))
    yield from go_to(arm, [*arm.hand[:2], world.com(block)[2] + 0.12], pace=COARSE, grip=CLOSED)
    yield from go_to(arm, world.com(block) + 0.08 * UP, pace=STEADY)
    yield from push(arm, -0.05 * UP, until=lambda: side * self.tilt(world) > -0.02)
    yield from hold(arm, 4.5)


def nudge_the_target(self, world: World) -> Plan:
    """Put the counterweight in the mirror image, then push the target along the deck until it is level."""
    yield from self.put_at(world, self.mirror)
    arm = world.arm
    for _ in range(6):
        heavy = 1.0 if self.tilt(world) > 0 else -1.0
        sign = -heavy  # towards the arm that is up
        u = sign * heading(self.heading)
        at = world.com("target")
        yield from go_to(arm, [*arm.hand[:2], at[2] + 0.10], pace=COARSE, grip=CLOSED)
        yield from go_to(arm, at - 0.05 * u + 0.08 * UP, pace=STEADY)
        yield from go_to(arm, at - 0.05 * u, pace=STEADY)
        yield from push(arm, 0.03 * u, until=lambda h=heavy: h * self.tilt(world) < math.radians(3.0), give_up=4.0)
        yield from go_to(arm, arm.hand - 0.03 * u)
        yield from retreat(arm, 0.1)
        yield from hold(arm, 3.5)


def topple_the_decoy(self, world: World) -> Plan:
    """Topple the chain that leads to the wrong slab."""
    lane = next(k for k, chain in enumerate(self.lanes.chains) if chain.astray)
    yield from self.topple(world, f"tile_{lane}_0")
    yield from hold(world.arm, 3.0)


def only_draw_it_in(self, world: World) -> Plan:
    """Draw the cube in with the hook, and leave it at that."""
    yield from self.take_hook(world)
    yield from self.draw_in(world)
    yield from retreat(world.arm, 0.12)


def take_it_by_hand(self, world: World) -> Plan:
    """Take the cube where it stands."""
    yield from self.lift_cube(world)


CHEATS: Mapping[str, Mapping[str, Cheat]] = {
    "domino_single": {f.__name__: f for f in (knock_slab_with_starter, strike_last_tile_with_starter)},
    "domino_select": {f.__name__: f for f in (topple_the_decoy,)},
    "galileo_ramp_drop": {"staircase": staircase},
    "ball_cage_escape": {f.__name__: f for f in (snap, hop, rock, jerk_back, slide_beside_the_stool)},
    "seesaw_balance": {f.__name__: f for f in (hold_the_weight_down, nudge_the_target)},
    "tool_retrieve": {f.__name__: f for f in (only_draw_it_in, take_it_by_hand)},
}


def written(task: str, scenario) -> dict[str, Shortcut]:
    """The cheats of a scenario: the declared shortcuts, those that stand here, and those that hands found."""
    own = {name: Shortcut(lambda world, f=cheat: f(scenario, world)) for name, cheat in CHEATS.get(task, {}).items()}
    hands = {
        name: Shortcut(lambda world, f=hand.plan: f(scenario, world))
        for (of, name), hand in HANDS.items()
        if of == task
    }
    return {**scenario.shortcuts(), **own, **hands}
