"""Feedback plans around a puzzle: pursue, press down, stand in the way, cradle, loosen, carry through narrow ways.

People who attack a task by hand start here (`docs/cheats.md`), and so does the tier `servo` of the adversary. The plans
know bodies and arms, but no task. They read poses and velocities as a policy with a good camera would, and no parameter
of the scenario.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from ..assets.prop import TABLE_TOP
from ..control.loop import Loop
from ..errors import GaveUp
from ..geometry import UP, Mat3, Vec3, about_z, between, heading, rotation
from ..robots.jaw import TIP_BELOW
from ..scenario import Plan
from ..sim.arm import Arm
from ..skills.jaw import RELEASE_TIME, carry, grasp, release
from ..skills.motion import (
    CLOSED,
    COARSE,
    FINE,
    OPEN,
    STEADY,
    Pace,
    closing_along,
    facing,
    go_to,
    hold,
    push,
    retreat,
    steer,
    until,
)
from .solids import solids

HOVER_HEIGHT = 0.06
"""Height above a body at which a hand follows it before it comes down [m]."""
LOWEST_HAND = TABLE_TOP + TIP_BELOW + 0.003
"""Lowest position of the grip site of a hand that points down [m]: the tips keep 3 mm from the table."""
STOPPED_SPEED = 0.02
"""Speed below which a body counts as stopped [m/s]."""
KEEP = 0.0
"""Gripper command that keeps the gap."""
NEAR_DISTANCE = 0.05
"""Distance below which a body is at a place [m]."""
TURNING_SPEED = 0.06
"""Speed below which a swinging body is seen to turn round [m/s]."""
LOOSE_GAP = 0.003
"""Distance by which a jaw opens that slips [m]."""
STEADY_WAY = Pace(0.25, 0.02, 4.0)
"""Pace of a hand that carries a thing from beneath."""
STEP_BACK = Pace(0.15, 0.01, 2.0)
"""Pace away from a body."""
WAY = Pace(0.30, 0.02, 1.5)
"""Pace through way points with a body in the hand."""
HAUL = Pace(0.15, 0.02, 0.5)
"""Pace of a hinged body that is pulled along in short steps."""
LOWER = Pace(0.15, 0.006, 2.0)
"""Pace down to the place where a body is let go."""
LEG = Pace(0.12, 0.003, 6.0)
"""Pace along a way with little clearance."""
LIFT = 0.12
"""Height by which a grasped body is lifted [m]."""


def velocity_of(arm: Arm, body: str) -> Vec3:
    """Linear velocity of a body's centre of mass [m/s], world axes."""
    return arm.world.velocity(body)[3:]


def pursue(
    arm: Arm, body: str, lead: float = 0.0, skew: float = math.pi / 2, within: float = 0.012, seconds: float = 12.0
) -> Plan:
    """Follow a moving body by feedback, come down on it as it moves, close the jaw, lift it.

    Args:
        arm: the arm.
        body: name of the body.
        lead: time by which the hand is ahead of the body on its present course [s].
        skew: angle from the body's course to the closing direction of the jaw [rad].
        within: distance at which the jaw closes [m].
        seconds: time limit [s].
    """
    world = arm.world
    end, height = world.time + seconds, HOVER_HEIGHT
    while world.time < end:
        velocity = velocity_of(arm, body)
        goal = world.com(body) + lead * velocity
        goal[2] = max(goal[2], LOWEST_HAND) + height
        level = np.linalg.norm((goal - arm.hand)[:2])
        if level < 2 * within:
            height = max(0.0, height - 0.003)
        if height == 0.0 and np.linalg.norm(goal - arm.hand) < within:
            break
        yield steer(arm, goal, velocity, between(arm.hand_rot, _across(arm, velocity, skew)), OPEN)
    for _ in range(30):
        velocity = velocity_of(arm, body) if arm.gap > 0.01 else np.zeros(3)
        goal = world.com(body).copy()
        goal[2] = max(goal[2], LOWEST_HAND)
        yield steer(arm, goal, velocity, np.zeros(3), CLOSED)
    yield from retreat(arm, LIFT)


def press_and_pick(arm: Arm, body: str, lead: float = 0.15, seconds: float = 12.0) -> Plan:
    """Press a moving body to what it lies on with closed fingers, wait until it has stopped, pick it up.

    Args:
        arm: the arm.
        body: name of the body.
        lead: time by which the fingers are ahead of the body on its present course [s].
        seconds: time limit of the pursuit [s].
    """
    world = arm.world
    end, height, top = world.time + seconds, HOVER_HEIGHT, extent(arm, body, UP) + TIP_BELOW
    while world.time < end and not world.touching(arm.label, body):
        velocity = velocity_of(arm, body)
        goal = world.com(body) + lead * velocity
        goal[2] += top + height
        if np.linalg.norm((goal - arm.hand)[:2]) < 0.02:
            height -= 0.004
        yield steer(arm, goal, velocity, between(arm.hand_rot, _across(arm, velocity, math.pi / 2)), CLOSED)
    yield from hold(arm, 0.4, CLOSED)
    yield from pick_where_it_is(arm, body)


def block_and_pick(arm: Arm, body: str, lead: float = 0.3, seconds: float = 15.0) -> Plan:
    """Stand in the way of a moving body with closed fingers, wait until it has stopped, pick it up.

    Args:
        arm: the arm.
        body: name of the body.
        lead: time by which the fingers are ahead of the body on its present course [s].
        seconds: time limit [s].
    """
    world = arm.world
    end = world.time + seconds
    while world.time < end:
        velocity = velocity_of(arm, body)
        if world.touching(arm.label, body) and np.linalg.norm(velocity) < STOPPED_SPEED:
            break
        goal = world.com(body) + lead * velocity
        goal[2] = max(float(world.com(body)[2]), LOWEST_HAND)
        yield steer(arm, goal, np.zeros(3), between(arm.hand_rot, _across(arm, velocity, 0.0)), CLOSED)
    yield from go_to(arm, arm.hand + 0.05 * UP, pace=STEP_BACK)
    yield from pick_where_it_is(arm, body)


def cradle(arm: Arm, body: str, azimuth: float, pitch: float, depth: float = 0.0, raise_by: float = LIFT) -> Plan:
    """Put closed fingers under a body from the side, with the hand looking upwards, and lift it without a grasp.

    Args:
        arm: the arm.
        body: name of the body.
        azimuth: direction in which the hand looks, from above [rad].
        pitch: angle by which the hand looks above the horizontal [rad].
        depth: distance of the tips beyond the body's centre [m].
        raise_by: height by which the body is raised [m].
    """
    world = arm.world
    rot = facing(azimuth, -pitch)
    out = rot[:, 2]
    below = world.com(body) - extent(arm, body, UP) * UP
    start = below - (0.08 + extent(arm, body, out)) * out
    start[2] = max(start[2], TABLE_TOP + 0.03)
    yield from go_to(arm, start + 0.12 * UP, rot, COARSE, CLOSED)
    yield from go_to(arm, start, rot, STEADY, CLOSED)
    yield from go_to(arm, below + depth * out + [0.0, 0.0, 0.012], rot, FINE, CLOSED)
    yield from go_to(arm, arm.hand + raise_by * UP, rot, FINE, CLOSED)


def await_turn(arm: Arm, body: str, angle: float = math.radians(20.0), seconds: float = 8.0) -> Plan:
    """Hold the open hand until a moving body has changed its course, as at a wall.

    Args:
        arm: the arm.
        body: name of the body.
        angle: change of course [rad].
        seconds: time limit [s].
    """
    course: Vec3 | None = None
    end = arm.world.time + seconds
    while arm.world.time < end:
        velocity = velocity_of(arm, body) * [1.0, 1.0, 0.0]
        if (speed := float(np.linalg.norm(velocity))) > STOPPED_SPEED:
            course = velocity / speed if course is None else course
            if course @ velocity < speed * math.cos(angle):
                return
        yield from hold(arm, Loop.PERIOD, OPEN)


def meet(arm: Arm, body: str, at: ArrayLike, rot: Mat3, periods: int = 2, seconds: float = 6.0) -> Plan:
    """Wait where a swinging body turns round, and close the jaw when it is seen to be slow there.

    The hand comes from behind while the body is on its way out. A jaw that is almost closed closes at once.

    Args:
        arm: the arm.
        body: name of the body.
        at: position of the grip site when the jaw closes [m].
        rot: orientation of the hand.
        periods: control periods for which the jaw opens; 0 to open it wide.
        seconds: time limit of each wait [s].
    """
    world, goal = arm.world, np.asarray(at, float)

    def speed() -> float:
        return float(np.linalg.norm(velocity_of(arm, body)))

    def leaving() -> bool:
        return float(velocity_of(arm, body) @ (world.com(body) - goal)) > 0.0 and speed() > STOPPED_SPEED

    def near() -> bool:
        return float(np.linalg.norm(world.com(body) - goal)) < NEAR_DISTANCE

    grip = KEEP if periods else OPEN
    if not periods:
        yield from release(arm, 0.3)
    yield from go_to(arm, goal - 0.10 * rot[:, 2], rot, WAY, grip)
    if periods:
        yield from hold(arm, periods * Loop.PERIOD, OPEN)
    yield from until(hold(arm, seconds, grip), lambda: leaving() and not near())
    yield from go_to(arm, goal, rot, Pace(0.30, 0.004, 2.0), grip)
    yield from until(hold(arm, seconds, grip), lambda: not near())
    yield from until(hold(arm, seconds, grip), lambda: near() and speed() < TURNING_SPEED)
    yield from grasp(arm)
    yield from hold(arm, 1.0)


def stop_and_bring(
    arm: Arm, body: str, at: ArrayLike, to: ArrayLike, rot: Mat3, pitch: float = 0.0, seconds: float = 5.0
) -> Plan:
    """Stand in the way of a swinging body with an open hand until it has stopped, take it, and bring it to a place.

    Args:
        arm: the arm.
        body: name of the body.
        at: place where it is stopped [m].
        to: position of the grip site to which it is brought [m].
        rot: orientation of the hand at that position.
        pitch: angle by which the hand looks higher where it stops the body [rad].
        seconds: time limit of the wait [s].
    """
    world, goal = arm.world, np.asarray(to, float)
    level = np.cross(rot[:, 2], UP)
    before = rotation(pitch * level / max(float(np.linalg.norm(level)), 1e-9)) @ rot
    with suppress(GaveUp):  # the body may be in the way
        yield from go_to(arm, np.asarray(at, float) - 0.10 * before[:, 2], before, WAY, OPEN)
        yield from go_to(arm, at, before, WAY, OPEN)

    def stopped() -> bool:
        return world.touching(arm.label, body) and float(np.linalg.norm(velocity_of(arm, body))) < STOPPED_SPEED

    yield from until(hold(arm, seconds, OPEN), stopped)
    with suppress(GaveUp):
        yield from go_to(arm, world.com(body), before, STEP_BACK, OPEN)
    yield from grasp(arm)
    start, turn = arm.hand, between(arm.hand_rot, rot)
    aim = arm.hand_rot
    for share in np.linspace(0.1, 1.1, 11):  # a straight way, in short steps: what is hinged goes along its arc
        with suppress(GaveUp):
            yield from go_to(arm, start + share * (goal - start), rotation(share * turn) @ aim, HAUL, CLOSED)
    yield from hold(arm, 1.0, CLOSED)


def turn_about(arm: Arm, body: str, rot: Mat3, rate: float = 1.8) -> Plan:
    """Turn the hand about the middle of a held body, for at most 1.5 s longer than the turn takes.

    Args:
        arm: the arm.
        body: name of the held body.
        rot: final orientation of the hand; see `on_its_side`.
        rate: rate of the turn [rad/s].
    """
    world, middle, start, begin = arm.world, arm.world.com(body), arm.hand_rot, arm.world.time
    held, turn = start.T @ (middle - arm.hand), between(start, rot)
    seconds = float(np.linalg.norm(turn)) / rate
    while world.time < begin + seconds + 1.5:
        share = min(1.0, (world.time - begin) / max(seconds, 1e-9))
        if share == 1.0 and np.linalg.norm(between(arm.hand_rot, rot)) < 0.08:
            return
        aim = rotation(share * turn) @ start
        yield steer(arm, middle - aim @ held, np.zeros(3), between(arm.hand_rot, aim), CLOSED)


def carry_steadily(arm: Arm, way: ArrayLike, tries: int = 4) -> Plan:
    """Move a closed hand by a displacement [m], shape (3,), and hold it still while the jaw opens by itself."""
    gap, goal = arm.gap + LOOSE_GAP, arm.hand + np.asarray(way, float)
    for _ in range(tries):
        with suppress(GaveUp):
            yield from until(go_to(arm, goal, arm.hand_rot, STEADY_WAY, CLOSED), lambda: arm.gap > gap)
        if arm.gap <= gap:
            return
        yield from until(hold(arm, 3.0, CLOSED), lambda: arm.gap <= gap)
        yield from hold(arm, 0.2, CLOSED)


def on_its_side(azimuth: float, elevation: float) -> Mat3:
    """Orientation of a hand that looks along a direction [rad] and whose fingers close in a vertical plane.

    What it holds rests on the lower finger when the jaw opens a little.
    """
    along = math.cos(elevation) * heading(math.degrees(azimuth)) + math.sin(elevation) * UP
    closing = np.cross(along, [-math.sin(azimuth), math.cos(azimuth), 0.0])
    return np.stack([closing, np.cross(along, closing), along], axis=1)


def pick_where_it_is(arm: Arm, body: str, skew: float = 0.0, lift: float = LIFT) -> Plan:
    """Pick up a body from above at its present place, across its narrow level side.

    Args:
        arm: the arm.
        body: name of the body.
        skew: turn of the hand from the narrow side [rad]; a quarter turn puts the hand's narrow side along the body.
        lift: height by which the body is lifted [m].
    """
    world = arm.world
    at = world.com(body)
    at[2] = max(at[2], LOWEST_HAND)
    rot = closing_along(arm, about_z(skew) @ narrow_direction(arm, body))
    yield from go_to(arm, [*at[:2], max(at[2] + HOVER_HEIGHT, arm.hand[2])], rot, COARSE, OPEN)
    yield from go_to(arm, at, rot, FINE, OPEN)
    yield from grasp(arm)
    yield from retreat(arm, lift)


def carry_to(
    arm: Arm,
    body: str,
    goal: ArrayLike,
    over: float,
    skew: float | None = None,
    drop: float = 0.0,
    aside: float = 0.0,
) -> Plan:
    """Carry a held body to a place and let it go: over or around an obstacle, or along the table with a turned hand.

    Args:
        arm: the arm.
        body: name of the held body.
        goal: final position of the body's centre of mass [m].
        over: height above the goal at which it is carried [m].
        skew: yaw of the hand while it carries, from its present one [rad]; None to keep it.
        drop: height from which the body is let go [m].
        aside: largest distance to the left of the straight way [m].
    """
    world, target = arm.world, np.asarray(goal, float)
    rot = arm.hand_rot if skew is None else about_z(skew) @ arm.hand_rot
    lag = arm.hand - world.com(body)
    yield from _pass(arm, [*arm.hand[:2], max(arm.hand[2], target[2] + over + lag[2])], rot)
    lag = arm.hand - world.com(body)
    if aside:
        way = (target + lag - arm.hand)[:2]
        middle = arm.hand[:2] + way / 2 + aside * np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-9)
        yield from _pass(arm, [*middle, target[2] + over + lag[2]], rot)
    yield from _pass(arm, [*(target + lag)[:2], target[2] + over + lag[2]], rot)
    with suppress(GaveUp):  # it is let go in any case
        yield from go_to(arm, target + lag + drop * UP, rot, LOWER, CLOSED)
    yield from release(arm, 0.2 if drop else RELEASE_TIME)
    yield from retreat(arm, max(0.08, over - drop), WAY)


def carry_along(arm: Arm, body: str, way: ArrayLike, skew: float = 0.0, raise_by: float = 0.003) -> Plan:
    """Carry a held body along a way. The jaw closes along its longest leg, so that the narrow side of the hand passes.

    Args:
        arm: the arm.
        body: name of the held body.
        way: corners of the way of the body's centre of mass [m], shape (n, 3).
        skew: turn of the closing direction from the longest leg [rad].
        raise_by: height above the way at which the body is carried [m].
    """
    corners = np.asarray(way, float) + raise_by * UP
    legs = np.diff(corners, axis=0) * [1.0, 1.0, 0.0]
    longest = legs[int(np.argmax(np.linalg.norm(legs, axis=1)))]
    with suppress(GaveUp):
        yield from go_to(arm, arm.hand, closing_along(arm, about_z(skew) @ longest), LOWER, CLOSED)
    for corner in corners[1:]:
        with suppress(GaveUp):
            yield from carry(arm, body, corner, pace=LEG)
    with suppress(GaveUp):
        yield from go_to(arm, arm.hand - raise_by * UP, pace=LOWER, grip=CLOSED)
    yield from release(arm, RELEASE_TIME)
    yield from retreat(arm, 0.08, WAY)


def _pass(arm: Arm, at: ArrayLike, rot: Mat3) -> Plan:
    """Go through a way point with a body in the hand, or as near to it as the arm comes."""
    with suppress(GaveUp):
        yield from go_to(arm, at, rot, WAY, CLOSED)


def touch_with(arm: Arm, body: str, other: str, along: ArrayLike, seconds: float = 4.0) -> Plan:
    """Move a held body until it touches another one, as a latch asks, and back again.

    Args:
        arm: the arm.
        body: name of the held body.
        other: name of the body that it has to touch.
        along: velocity of the hand [m/s], shape (3,).
        seconds: time limit [s].
    """
    world, way = arm.world, np.asarray(along, float)
    try:
        yield from push(arm, way, lambda: world.touching(body, other), CLOSED, seconds)
    finally:
        back = arm.hand - 0.02 * way / max(float(np.linalg.norm(way)), 1e-9)
    yield from go_to(arm, back, pace=STEP_BACK, grip=CLOSED)


def loosen(arm: Arm, body: str, shift: ArrayLike, periods: int = 3) -> Plan:
    """Open the jaw for some periods around a held body, close it again, and shift the hand where the body slipped.

    Args:
        arm: the arm.
        body: name of the held body.
        shift: displacement of the hand between opening and closing [m], shape (3,).
        periods: control periods for which the jaw opens.
    """
    move = np.asarray(shift, float)
    for _ in range(periods):
        yield steer(arm, arm.hand + move / periods, np.zeros(3), np.zeros(3), OPEN)
    yield from grasp(arm)
    if not arm.world.touching(arm.label, body):
        raise GaveUp(f"{body} slipped out of the loosened jaw")


def narrow_direction(arm: Arm, body: str) -> Vec3:
    """The level direction along which a body is narrowest, as a unit vector."""
    directions = [about_z(math.radians(angle)) @ np.array([1.0, 0.0, 0.0]) for angle in range(0, 180, 10)]
    solid = solids(arm.world)[body]
    return directions[int(np.argmin([solid.reach(arm.world, u) for u in directions]))]


def extent(arm: Arm, body: str, direction: Vec3) -> float:
    """Extent of a body from its middle in a direction, a unit vector [m]."""
    return solids(arm.world)[body].reach(arm.world, direction)


def _across(arm: Arm, velocity: Vec3, skew: float) -> Mat3:
    """Orientation of a hand that points down and closes at an angle to a velocity; unchanged for a body at rest."""
    speed = math.hypot(velocity[0], velocity[1])
    if speed < STOPPED_SPEED:
        return arm.hand_rot
    return closing_along(arm, about_z(skew) @ (np.array([velocity[0], velocity[1], 0.0]) / speed))
