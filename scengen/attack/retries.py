"""Tier of costless retries: one move is repeated while a number is swept, all in one episode.

A task in which a failed attempt costs nothing requires patience instead of insight.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..geometry import UP, Vec3
from ..sim.arm import Arm
from .macros import Macro
from .player import Attempt, Player, in_turn
from .solids import TABLE, Solid, handles, sides
from .variations import phase

RETRY = "retry"
"""Tier of repeated moves."""

TILTS = (65.0, 40.0, 20.0)
"""Angles by which a held body is tipped, one way and the other [deg]: the hand reaches about 70."""
FACE_SHARES = (0.9, -0.9, 0.45, -0.45, 0.0)
"""Places on a face, as shares of its half length, in the order in which they are tried."""
FIRST_RELEASE = -0.03
"""Place of the first release along the face, from that of the witness [m]."""
RELEASE_STEP = 0.020
"""Distance from one release to the next [m]. About 7 mm of it are lost: a body that returns is caught a little before
it turns round."""
RELEASES = 5
"""Number of releases: each takes 1.4 s, and the time limit allows no more."""
SHIFTS = (0.010, 0.025, -0.010, -0.025)
"""Displacements of a phase of the witness [m]."""


def retries(player: Player) -> Iterator[Attempt]:
    """All families of attempts in turn, for every arm, each with the most promising attempts first."""
    makers = (carried, tipped, dropped_again, shaken, placed, bare)
    families = [_by(arm, make(player, arm)) for make in makers for arm in player.world.arms]
    return in_turn([*families, shifted(player)])


def _by(arm: Arm, attempts: Iterator[Attempt]) -> Iterator[Attempt]:
    """Attempts with all their moves made by one arm."""
    for attempt in attempts:
        yield replace(attempt, macros=tuple(replace(macro, arm=arm.number) for macro in attempt.macros))


def carried(player: Player, arm: Arm) -> Iterator[Attempt]:
    """Every graspable free body is picked, then pushed against, placed on and pressed on every other body."""
    for one, other in _pairs(player, arm):
        for pick in picks(player, arm, one):
            pushes = tuple(Macro("push", other.name, (angle, 0.75, 0.0, 0.12, 0.2)) for angle in _angles(player, other))
            yield Attempt(RETRY, (pick, *pushes[:2]))
            yield Attempt(RETRY, (pick, *pushes[2:]))
            for share in FACE_SHARES[-1], *FACE_SHARES[:2]:
                yield Attempt(RETRY, (pick, Macro("place", other.name, (share, 0.0, 0.06, 0.1))))
            yield Attempt(RETRY, (pick, *(Macro("press", other.name, (u, 0.0, 0.4, 0.1)) for u in FACE_SHARES[:3])))


def bare(player: Player, arm: Arm) -> Iterator[Attempt]:
    """Every body is pushed from all sides, high and low, then pressed, with the empty hand."""
    for solid in _targets(player):
        for height in (0.8, 0.3):
            pushes = [Macro("push", solid.name, (angle, height, 0.0, 0.12, 0.2)) for angle in _angles(player, solid)]
            yield Attempt(RETRY, tuple(pushes[:2]))
            yield Attempt(RETRY, tuple(pushes[2:]))
        yield Attempt(RETRY, tuple(Macro("press", solid.name, (u, 0.0, 0.5, 0.1)) for u in FACE_SHARES[:3]))


def placed(player: Player, arm: Arm) -> Iterator[Attempt]:
    """Every graspable free body is put down at several places of a face, one after the other, from each end on."""
    for one, other in _pairs(player, arm):
        for pick in picks(player, arm, one)[:1]:
            for across, sign in ((True, 1.0), (False, 1.0), (False, -1.0), (True, -1.0)):
                moves: list[Macro] = []
                for share in FACE_SHARES:
                    place = (0.0, sign * share) if across else (sign * share, 0.0)
                    moves += [pick, Macro("place", other.name, (*place, 0.0, 0.08)), Macro("wait", "", (0.8,))]
                yield Attempt(RETRY, tuple(moves))


def tipped(player: Player, arm: Arm) -> Iterator[Attempt]:
    """The body in the hand of the witness is tipped one way and the other."""
    for k in _holding(player, arm):
        for axis in _axes(player, arm, k):
            for tilt in TILTS[:2]:
                yield Attempt(RETRY, _seesawing(axis, math.radians(tilt)), k)
                yield Attempt(RETRY, _seesawing(-axis, math.radians(tilt)), k)
        for axis in _axes(player, arm, k):
            steps = [math.radians(tilt) for tilt in reversed(TILTS)]
            yield Attempt(RETRY, tuple(move for tilt in steps for move in _seesawing(axis, tilt)), k)


def shaken(player: Player, arm: Arm) -> Iterator[Attempt]:
    """The body in the hand of the witness is shaken sideways and up, with the wrist at rest and turning."""
    for spin in (1.0, 0.0):
        for k in _holding(player, arm):
            for along in (*_axes(player, arm, k), UP):
                for period in (0.3, 0.6):
                    shake = Macro("shake", "", (*map(float, along), spin, period, 3.0))
                    yield Attempt(RETRY, (shake, Macro("wait", "", (0.5,))), k)


def dropped_again(player: Player, arm: Arm) -> Iterator[Attempt]:
    """A body is released at other places along the face beneath, caught when it returns, and released again."""
    for k, body in player.trace.releases(arm.number):
        for along in _tangents(player, k, body):
            again = (Macro("release", "", (0.15, 0.0)), Macro("catch", body, (2.5,)), _move(along, RELEASE_STEP))
            moves = (_move(along, FIRST_RELEASE), *again * RELEASES)
            yield Attempt(RETRY, moves, k)


def shifted(player: Player) -> Iterator[Attempt]:
    """A phase of the witness is repeated with several displacements, each time from its beginning."""
    for k in reversed(range(player.phases)):
        for axis in range(3):
            moves = []
            for step in SHIFTS:
                displaced = [0.0, 0.0, 0.0]
                displaced[axis] = step
                moves.append(phase(player, k, shift=tuple(displaced)))
            yield Attempt(RETRY, tuple(moves), k)


# --- bodies and directions --------------------------------------------------------------------


def _pairs(player: Player, arm: Arm) -> Iterator[tuple[Solid, Solid]]:
    """Solids that can be grasped, each with a target; those that matter in the witness come first."""
    taken, targets = handles(player.solids, arm.suction), _targets(player)
    known = player.trace.handled
    ranked = sorted(taken, key=lambda solid: known.index(solid.body) if solid.body in known else len(known))
    found = [(i + k, one, other) for i, one in enumerate(ranked) for k, other in enumerate(targets)]
    for _, one, other in sorted(found, key=lambda ranked: ranked[0]):
        if one.body != other.body:
            yield one, other


def _targets(player: Player) -> list[Solid]:
    """Whole bodies without the table, those nearest to the goal first, then parts of bodies."""
    near = player.trace.concerned
    found = [solid for solid in player.solids.values() if solid.body != TABLE]
    order = {solid.name: near.index(solid.body) if solid.body in near else len(near) for solid in found}
    return sorted(found, key=lambda solid: (solid.name != solid.body, order[solid.name]))


def picks(player: Player, arm: Arm, solid: Solid) -> list[Macro]:
    """A macro that picks a solid at the start, across its side with the most clearance; none if no jaw fits."""
    player.rewind()
    fits = [0] if arm.suction else sides(player.world, player.solids, solid)[:1]
    return [Macro("pick", solid.name, (0.6, 0.0, float(which), 0.2)) for which in fits]


def _angles(player: Player, solid: Solid) -> list[float]:
    """Directions along the level axes of a solid, both ways, the shorter axis first [rad]."""
    player.rewind()
    angles = [math.atan2(along[1], along[0]) for along, _ in solid.level_axes(player.world)]
    return [angle + turn for angle in angles for turn in (0.0, math.pi)]


def _holding(player: Player, arm: Arm) -> list[int]:
    """At most three stages of the witness at which a body has been in the hand for a phase, the middle one first."""
    holds = [stage.holds[arm.number] for stage in player.trace.stages[: player.phases]]
    found = [k for k in range(1, len(holds)) if holds[k] and holds[k - 1]]
    found = found or [k for k in range(1, len(holds)) if holds[k]]
    return sorted(found, key=lambda k: abs(k - found[len(found) // 2]))[:3]


def _axes(player: Player, arm: Arm, k: int) -> Sequence[Vec3]:
    """The level axes of the body that is held at a stage, the longer one last."""
    player.rewind(k)
    body = player.trace.stages[k].holds[arm.number]
    assert body is not None
    return [along for along, _ in player.solids[body].level_axes(player.world)]


def _tangents(player: Player, k: int, body: str) -> list[Vec3]:
    """The uphill direction of the face that a body touches at a stage; two level directions if the face is level."""
    player.rewind(k)
    world = player.world
    data, index = world.data, world.body(body)
    normals = [UP]
    for contact in data.contact[: data.ncon]:
        bodies = [int(world.model.geom_bodyid[g]) for g in contact.geom]
        fixed = any(world.model.body_weldid[b] == 0 for b in bodies)
        if index in bodies and fixed and contact.dist <= 0.002:
            normals.append(np.array(contact.frame[:3]))
    normal = max(normals, key=lambda n: float(np.linalg.norm(n[:2])) if abs(n[2]) > 0.3 else -1.0)
    normal = normal * math.copysign(1.0, normal[2])
    uphill = UP - normal * normal[2]
    if float(np.linalg.norm(uphill)) < 0.05:
        return [np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])]
    uphill = uphill / np.linalg.norm(uphill)
    return [uphill]


def _seesawing(axis: Vec3, tilt: float) -> tuple[Macro, ...]:
    """Tip about an axis, wait, tip the other way, wait, and tip back."""
    one, other = (tuple(map(float, tilt * axis)), tuple(map(float, -2 * tilt * axis)))
    pause = Macro("wait", "", (0.8,))
    return (
        Macro("turn", "", (*one, 1.0)),
        pause,
        Macro("turn", "", (*other, 1.5)),
        pause,
        Macro("turn", "", (*one, 1.5)),
    )


def _move(along: Vec3, way: float) -> Macro:
    return Macro("move", "", (*map(float, way * along), 0.08))
