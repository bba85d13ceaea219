"""T33: nothing is worked out; the cup holds a piece over one place after the other and feels where it goes in."""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace

from hand import Hand

from scengen.assets.guillotine import Ell, Rect
from scengen.errors import GaveUp
from scengen.geometry import UP, Vec3, yaw_of
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.fitting import AIM_PACE, bring, take
from scengen.skills.motion import COARSE, Pace, retreat, until
from scengen.skills.suction import carry, let_go
from scengen.tasks.packing import Packing

OVERLAP = 0.45
"""Overlap of two pieces that a compliant hand pushes apart [units]."""
MAX_LEAN = math.radians(0.5)
"""Tilt at which a piece in the cup is stopped by an edge [rad]; at 3 deg it comes off."""

GENTLY = Pace(0.02, 0.0, 3.0)
"""Pace at which a piece is lowered."""


def feel(scenario: Packing, world: World, i: int, pos: Vec3, yaw: float) -> Plan:
    """Lower piece `i` until it lies, leans or does not go on, and raise it again unless it lies."""
    arm, name = world.arm, f"piece_{i}"
    aim = carry(arm, name, pos + (scenario.thickness + 0.003) * UP, yaw, AIM_PACE)
    yield from until(aim, lambda: not arm.sealed)
    lean, lowest, since = world.tilt(name) + MAX_LEAN, float(world.pos(name)[2]), world.time

    def stopped() -> bool:
        nonlocal lowest, since
        if world.pos(name)[2] < lowest - 0.0007:
            lowest, since = float(world.pos(name)[2]), world.time
        return scenario.lies(world, i) or not arm.sealed or world.tilt(name) > lean or world.time > since + 0.35

    with suppress(GaveUp):
        yield from until(carry(arm, name, pos - 0.002 * UP, yaw, GENTLY, 0.0005), stopped)
    if arm.sealed and not scenario.lies(world, i):
        with suppress(GaveUp):
            yield from retreat(arm, 0.05, Pace(0.1, 0.01, 1.0))


def goes_in(piece: Ell, place: Ell, others: Mapping[int, tuple[Ell, Ell]], bin: Rect) -> bool:
    """Whether a piece cut as `piece` goes into `place` beside others, each a piece and its place."""
    mine = area(piece, place)
    free = all(
        min(a[2], b[2]) - max(a[0], b[0]) <= OVERLAP or min(a[3], b[3]) - max(a[1], b[1]) <= OVERLAP
        for other in others.values()
        for a in mine
        for b in area(*other)
    )
    return free and all(
        min(x0, y0) >= -OVERLAP and x1 <= float(bin.width) + OVERLAP and y1 <= float(bin.height) + OVERLAP
        for x0, y0, x1, y1 in mine
    )


def area(piece: Ell, place: Ell) -> list[tuple[float, ...]]:
    """The two rectangles of a piece that lies in a place: their least x and y, and their largest [units]."""
    (width, height, upright, lying), (x, y) = map(float, piece.sides), map(float, place.middle)
    parts = []
    for right, upper in ((width / 2, lying - height / 2), (upright - width / 2, height / 2)):
        ends = [complex(-width / 2, -height / 2) * 1j**place.quarter, complex(right, upper) * 1j**place.quarter]
        xs, ys = sorted(end.real + x for end in ends), sorted(end.imag + y for end in ends)
        parts.append((xs[0], ys[0], xs[1], ys[1]))
    return parts


def try_places(scenario: Scenario, world: World) -> Plan:
    """Try arrangements piece by piece, and leave out those that contradict what went in and what did not."""
    assert isinstance(scenario, Packing)
    arm, lying, held = world.arm, dict[int, Ell](), None
    cuts = [replace(scenario, deal=deal, mirror=mirror) for mirror in (1, 0) for deal in range(6)]
    while cuts:
        arrangement = max(cuts, key=lambda c: sum(c.cut.pieces[i] == slot for i, slot in lying.items()))
        todo = [i for i in range(scenario.count) if lying.get(i) != arrangement.cut.pieces[i]]
        if not todo:
            return
        astray = [i for i in todo if i in lying]  # they are in the way of the others
        i = min(astray or ([held] if held in todo else todo), key=lambda i: arrangement.cut.pieces[i].area)
        place, (pos, yaw) = arrangement.cut.pieces[i], arrangement.goal(i)
        if held is not None and (
            held != i or abs(math.remainder(yaw - yaw_of(world.rot(f"piece_{i}")), math.tau)) > 1.9
        ):
            yield from put_aside(scenario, world, held)
        held = None
        lying.pop(i, None)
        with suppress(GaveUp):
            if not arm.sealed:
                yield from take(arm, f"piece_{i}", scenario.face(i), yaw)
            yield from bring(arm, f"piece_{i}", pos, yaw)
            yield from scenario.insert(world, i, pos, yaw) if len(cuts) == 1 else feel(scenario, world, i, pos, yaw)
        went = scenario.lies(world, i)

        def expected(c: Packing, i=i, place=place) -> bool:
            return goes_in(c.cut.pieces[i], place, {j: (c.cut.pieces[j], at) for j, at in lying.items()}, c.cut.rect)

        cuts = [c for c in cuts if expected(c) == went]
        if went:
            lying[i] = place
        elif arm.sealed:
            held = i
            continue
        yield from let_go(arm)


def put_aside(scenario: Packing, world: World, i: int) -> Plan:
    """Put the held piece back where it was at the start."""
    pos, yaw = scenario.start(i)
    with suppress(GaveUp):
        yield from carry(world.arm, f"piece_{i}", pos + 0.05 * UP, yaw, COARSE)
        yield from carry(world.arm, f"piece_{i}", pos + 0.002 * UP, yaw, Pace(0.2, 0.01, 1.5))
    yield from let_go(world.arm)


HANDS = {"try_places": Hand(try_places)}
