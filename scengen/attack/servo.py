"""Tier of feedback plans: pursue, press down, block, cradle, and carry to the place where the witness leaves a body.

The plans are those of `plans`, which know no task. Each attempt is for one body that the robot handles in the witness,
with a few leads, directions and routes. An arm with a suction cup only carries.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product, zip_longest

import numpy as np

from ..geometry import Vec3
from ..sim.arm import Arm
from .macros import Macro
from .player import Attempt, Player, in_turn
from .retries import picks
from .solids import handles

SERVO = "servo"
"""Tier of feedback plans."""

PURSUIT_LEADS = (0.1, 0.0, 0.2, 0.35)
"""Times by which a pursuing hand is ahead of a body [s]."""
BLOCK_LEADS = (0.3, 0.15, 0.6)
"""Times by which fingers that press or block are ahead of a body [s]."""
PITCHES = (math.radians(20.0), math.radians(8.0))
"""Angles by which a cradling hand looks above the horizontal [rad]."""
SIDES = (0.0, math.radians(50.0), math.radians(-50.0))
"""Directions from which a body is cradled, from that of the robot's base [rad]."""
ROLLS = (math.radians(135.0), math.radians(-135.0), math.radians(90.0), math.radians(-90.0))
"""Directions in which a hand on its side looks [rad]: 0 is away from the robot."""
ELEVATIONS = (math.radians(30.0), math.radians(10.0))
"""Angles by which a hand on its side looks above the horizontal [rad]."""
STOP_PITCHES = (math.radians(30.0), 0.0)
"""Angles by which a hand that stops a swinging body looks higher than where the witness takes it [rad]."""
QUARTER = math.pi / 2
"""Turn of the hand that puts its narrow side across the way [rad]."""
HIGH_ROUTE = (0.2, 0.0, 0.0)
"""The way to carry a body high over everything; see `ROUTES`."""
ROUTES = (
    (0.005, QUARTER, 0.0),
    (0.12, 0.0, 0.0),
    (0.005, 0.0, 0.0),
    HIGH_ROUTE,
    (0.02, 0.0, 0.2),
    (0.02, 0.0, -0.2),
    (0.12, QUARTER, 0.0),
)
"""Ways to carry a body: height above its goal [m], turn of the hand [rad], and the largest distance to the left of the
straight way [m]. They go through a gap, over an obstacle, straight, high, and around both sides."""
CARRIED = tuple(dict.fromkeys((HIGH_ROUTE, *ROUTES)))
"""The same ways, the one over everything first: there the height of the drop matters most."""
RAISE = 0.008
"""Height above its way at which a body is carried along it [m]: the fingers keep off the table."""
DROPS = (0.0, 0.04, 0.12)
"""Heights from which a carried body is let go [m]."""
IDLE_TIME = 2.0
"""Time without action after which bodies that move by themselves are known [s]."""
MIN_MOTION = 0.03
"""Displacement in this time above which a body moves by itself [m]."""


def servo(player: Player) -> Iterator[Attempt]:
    """All attempts, for every arm and every handled body in turn, the most promising ones first."""
    arms = player.world.arms
    jaws, cups = ([arm for arm in arms if arm.suction is sucks] for sucks in (False, True))
    bodies = [body for body in player.trace.handled if body in player.solids and player.solids[body].free]
    restless = moving(player)
    of_one = in_turn(
        [
            made(player, arm, body)
            for arm, body in product(jaws, bodies)
            for made in ((chased, carried, cradled) if body in restless else (carried, cradled))
        ]
        + [carried(player, arm, body) for arm, body in product(cups, bodies)]
    )
    swinging = [body for body in player.trace.handled if body not in bodies and body in restless]
    of_hinged = [made(player, arm, body) for arm, body in product(jaws, swinging) for made in (met, stopped)]
    of_all = in_turn([all_carried(player, arm, bodies) for arm in arms]) if len(bodies) > 1 else iter(())
    yield from in_turn([of_all, of_one, *of_hinged])


def chased(player: Player, arm: Arm, body: str) -> Iterator[Attempt]:
    """Pursue, press down and block a body that moves by itself, at once or after it has changed its course.

    Then it is carried to its goal if it is not reached yet.
    """
    rest = bring(player, arm, body, ROUTES[1], 0.0)
    later = Macro("await", body, (), arm.number)
    for chase in chases(arm, body):
        yield Attempt(SERVO, (later, chase, rest))
        yield Attempt(SERVO, (chase, rest))


def stopped(player: Player, arm: Arm, body: str) -> Iterator[Attempt]:
    """Stop a hinged body that moves by itself where it is fastest, and bring it to where the witness takes it.

    Or pursue it, press it down and block it at its current place.
    """
    if place := player.trace.hand_at(arm.number, body):
        lowest = tuple(map(float, fastest_place(player, body)))
        for pitch in STOP_PITCHES:
            yield Attempt(SERVO, (Macro("stop", body, (*lowest, *place, pitch), arm.number),))
    for chase in chases(arm, body):
        yield Attempt(SERVO, (chase,))


def chases(arm: Arm, body: str) -> Iterator[Macro]:
    """Macros that stop a moving body, each with several leads."""
    plans = [("pursue", PURSUIT_LEADS), ("pin", BLOCK_LEADS), ("block", BLOCK_LEADS)]
    for leads in zip_longest(*(leads for _, leads in plans)):
        for (kind, _), lead in zip(plans, leads, strict=True):
            if lead is not None:
                yield Macro(kind, body, (lead,), arm.number)


def met(player: Player, arm: Arm, body: str) -> Iterator[Attempt]:
    """Wait for a hinged body where the witness first touches it, with a jaw that is slightly or wide open."""
    place = player.trace.hand_at(arm.number, body)
    if place is not None:
        for periods in (1.0, 2.0, 0.0):
            yield Attempt(SERVO, (Macro("meet", body, (*place, periods), arm.number),))


def carried(player: Player, arm: Arm, body: str) -> Iterator[Attempt]:
    """Carry a body along the way that it takes in the witness, its narrow side or its broad side across; pick it, touch
    with it the bodies that the goal requires, and carry it to its goal by every route."""
    pick = taking(player, arm, body)
    for skew in (0.0, QUARTER):
        take = turned(player, arm, body, skew, 0.0)
        yield Attempt(SERVO, (take, Macro("along", body, (skew, RAISE), arm.number)))
    asked = must_touch(player, body)
    every = product(range(len(DROPS)), range(len(CARRIED)))
    for drop, route in ((DROPS[i], CARRIED[k]) for i, k in sorted(every, key=sum)):
        goal = bring(player, arm, body, route, drop)
        yield Attempt(SERVO, (pick, goal))
        if asked:
            yield Attempt(SERVO, (pick, *touched_at_goal(player, arm, body, asked), goal))
            yield Attempt(SERVO, (pick, *touched_straight(player, arm, body, asked), goal))


def all_carried(player: Player, arm: Arm, bodies: Sequence[str]) -> Iterator[Attempt]:
    """Every handled body in the order of the witness: take it, touch with it the bodies that the goal requires, carry
    it there."""
    asked = {body: must_touch(player, body) for body in bodies}
    touches = (touched_at_goal, touched_straight, untouched) if any(asked.values()) else (untouched,)
    for route, skew, drop, touch in product(CARRIED, (0.0, QUARTER), DROPS, touches):
        moves: list[Macro] = []
        for body in bodies:
            taken = turned(player, arm, body, skew, 0.2) if skew else taking(player, arm, body)
            moves += [taken, *touch(player, arm, body, asked[body]), bring(player, arm, body, route, drop)]
        yield Attempt(SERVO, tuple(moves))


def touched_at_goal(player: Player, arm: Arm, body: str, others: Sequence[str]) -> list[Macro]:
    """Macros that touch other bodies with the one in the hand, where they touch in the witness, from above."""
    places = [player.trace.place_at(body, body, other) for other in others]
    return [Macro("touch", other, place, arm.number) for other, place in zip(others, places, strict=True)]


def touched_straight(player: Player, arm: Arm, body: str, others: Sequence[str]) -> list[Macro]:
    """Macros that touch other bodies with the one in the hand, straight from where it is."""
    return [Macro("touch", other, (), arm.number) for other in others]


def untouched(player: Player, arm: Arm, body: str, others: Sequence[str]) -> list[Macro]:
    """No macros: no other body is touched."""
    return []


def cradled(player: Player, arm: Arm, body: str) -> Iterator[Attempt]:
    """Carry a body to its goal from beneath.

    It lies in a hand on its side, so that it rests on the lower finger, or on closed fingers that came from the side of
    the robot or from beside it.
    """
    pick, (x, y, _) = taking(player, arm, body), player.goal_place(body) - player.start_place(body)
    if pick.kind == "pick":  # as deep as the palm lets it: a thing that is held at its end tips out
        pick = replace(pick, numbers=(0.0, *pick.numbers[1:]))
    for direction, elevation in product(ROLLS, ELEVATIONS):
        yield Attempt(
            SERVO,
            (
                pick,
                Macro("roll", body, (direction, elevation), arm.number),
                Macro("ease", "", (float(x), float(y), 0.0), arm.number),
                Macro("roll", body, (direction, -QUARTER), arm.number),
                bring(player, arm, body, ROUTES[2], 0.0),
            ),
        )
    base = math.atan2(*(player.start_place(body) - arm.hand)[[1, 0]])
    for pitch, side in product(PITCHES, SIDES):
        way = player.goal_place(body) - player.start_place(body)
        cradle = Macro("cradle", body, (base + side, pitch, 0.0), arm.number)
        over = Macro("move", "", (float(way[0]), float(way[1]), 0.0, 0.15), arm.number)
        yield Attempt(SERVO, (cradle, over, Macro("move", "", (0.0, 0.0, -0.14, 0.1), arm.number)))
        yield Attempt(SERVO, (cradle,))


def taking(player: Player, arm: Arm, body: str) -> Macro:
    """A macro that picks a body across the side with the most clearance, or else across its narrowest side."""
    grips = [one for one in handles(player.solids, arm.suction) if one.body == body] if arm.suction else []
    found = picks(player, arm, (*grips, player.solids[body])[0])
    return replace(found[0], arm=arm.number) if found else Macro("take", body, (0.0, 0.12), arm.number)


def turned(player: Player, arm: Arm, body: str, skew: float, lift: float) -> Macro:
    """A macro that picks a body with a hand that is turned from the body's narrow side, or from where a cup is.

    Args:
        skew: angle of the turn [rad].
        lift: height by which a jaw lifts the body [m].
    """
    if not arm.suction:
        return Macro("take", body, (skew, lift), arm.number)
    pick = taking(player, arm, body)
    return replace(pick, numbers=(pick.numbers[0], skew, *pick.numbers[2:]))


def bring(player: Player, arm: Arm, body: str, route: tuple[float, float, float], drop: float) -> Macro:
    """A macro that carries a held body to the place where the witness leaves it.

    Args:
        route: one of `ROUTES`.
        drop: height from which the body is let go [m].
    """
    return Macro("bring", body, (*map(float, player.goal_place(body)), *route, drop), arm.number)


def must_touch(player: Player, body: str) -> tuple[str, ...]:
    """Bodies of the scene that a body must have touched for the goal, in the order of the witness."""
    asked = {other for pair in player.latches if body in pair for other in pair} - {body}
    pairs = [pair for _, pair in player.trace.events if body in pair]
    return tuple(dict.fromkeys(other for pair in pairs for other in pair if other in asked and other in player.solids))


def fastest_place(player: Player, body: str) -> Vec3:
    """Place at which a body that is not touched is fastest in the first seconds [m]: the lowest place of a pendulum."""
    world = player.world
    seen = [(float(np.linalg.norm(world.velocity(body)[3:])), *world.com(body)) for _ in player.idle(IDLE_TIME)]
    return np.array(max(seen)[1:])


def moving(player: Player) -> frozenset[str]:
    """Bodies that move by themselves at the beginning of an episode: free ones, and others that the witness touches."""
    world = player.world
    bodies = {*world.free_bodies, *player.trace.handled}
    player.rewind()
    before: dict[str, Vec3] = {body: world.com(body) for body in bodies}
    for _ in player.idle(IDLE_TIME):
        pass
    return frozenset(body for body in bodies if np.linalg.norm(world.com(body) - before[body]) > MIN_MOTION)
