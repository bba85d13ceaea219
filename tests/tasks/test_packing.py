"""A packing without gaps exists, only such a packing counts, and an invalid scenario gets no certificate."""

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play_shortcut,
    spared,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import load_task
from scengen.assets import guillotine
from scengen.params import values, with_values
from scengen.tasks.packing import Packing, Spot

TASK = load_task("packing")
NOMINAL = Packing()
cuts = st.fixed_dictionaries(
    {
        "count": st.sampled_from([3, 4]),
        "frame": st.integers(2, 3),
        "left": st.integers(2, 4),
        "right": st.integers(2, 4),
        "low": st.integers(2, 4),
        "rise": st.integers(1, 3),
        "top": st.integers(2, 4),
        "mirror": st.integers(0, 1),
        "heading": st.floats(-90.0, 90.0),
        "unit": st.floats(0.016, 0.02),
        "clearance": st.floats(0.0002, 0.002),
    }
).map(lambda drawn: with_values(NOMINAL, drawn))


@dataclass(frozen=True, kw_only=True)
class Packed(Packing):
    """All pieces lie as they were cut, but for a few that lie elsewhere."""

    amiss: tuple[int, ...] = ()

    def start(self, i):
        return super().start(i) if i in self.amiss else self.goal(i)

    def constraints(self):
        yield from ()


def free(scenario, world):
    """Area of the bin's floor on which no piece lies flat [m^2]."""
    lying = sum(piece.area for i, piece in enumerate(scenario.pieces) if scenario.lies(world, i))
    return scenario.bin.area - lying


def joints(scenario):
    """Area that stays free [m^2]: pieces are smaller by the clearance along their outlines, 4 c^2 counted too often."""
    outline = sum(2 * (slot.bounds.width + slot.bounds.height) for slot in scenario.cut.pieces)
    c = scenario.clearance
    return c * scenario.unit * float(outline) - 4 * c * c * scenario.count


# --- the plan that comes with every scenario ---------------------------------------------


@given(cuts)
@settings(deadline=None, max_examples=40)
def test_every_cut_closes_exactly_and_a_few_arrangements_do(scenario):
    assert guillotine.closes(scenario.cut.pieces, scenario.cut.rect)
    assert sum(slot.area for slot in scenario.cut.pieces) == scenario.cut.rect.area
    assert 1 <= scenario.features()["solutions"] <= 100


@given(cuts)
@settings(deadline=None, max_examples=12)
def test_the_pieces_in_their_slots_touch_nothing_but_the_floor_and_reach_the_goal(scenario):
    packed = with_values(Packed(), values(scenario))
    world = load(TASK, packed)
    assert all(contact.dist > -1e-5 for contact in world.data.contact[: world.data.ncon])
    assert packed.success(world)
    assert free(packed, world) == pytest.approx(joints(packed), rel=1e-9)


def test_the_number_of_solutions_of_the_training_scenarios_lies_between_2_and_32():
    found = {TASK.draw("id", 0, i).scenario.features()["solutions"] for i in range(40)}
    assert min(found) == 2 and max(found) <= 32


def test_whole_units_are_exact():
    for slot in Packing(count=4, left=3, rise=3).cut.pieces:
        assert all(type(side) is Fraction and side.denominator == 1 for side in slot.sides)


# --- goal --------------------------------------------------------------------------------


def test_without_one_of_its_pieces_a_packing_has_a_gap_of_the_size_of_that_piece():
    for i in range(3):
        scenario = Packed(amiss=(i,))
        world = load(TASK, scenario)
        assert not scenario.success(world)
        assert free(scenario, world) - joints(scenario) == pytest.approx(scenario.pieces[i].area)


@pytest.mark.parametrize(("lift", "tilt", "counts"), [(0.0, 0.0, True), (0.003, 0.0, False), (0.001, 0.05, False)])
def test_a_piece_above_the_floor_or_tilted_does_not_count(lift, tilt, counts):
    scenario = Packed()
    world = load(TASK, scenario)
    start = world.data.joint("piece_1_free").qpos
    start[2] += lift
    start[3:] = [np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    world.loop.restore(world.loop.state())
    assert scenario.success(world) == counts


def test_a_piece_on_the_table_beside_the_bin_does_not_count_and_one_below_the_table_ends_the_episode():
    scenario = Packed(amiss=(0,))
    world = load(TASK, scenario)
    assert not scenario.lies(world, 0) and scenario.failure(world) is None
    world.data.joint("piece_0_free").qpos[:3] = [0.0, 0.6, 0.7]
    world.loop.restore(world.loop.state())
    assert scenario.failure(world) == "a piece fell off the table"


def touching_in_the_bin(scenario, world, i, shift, turn):
    """Whether a piece counts as tried twice if piece `i` touched the floor in its slot, then shifted [m, rad]."""
    for off, yaw in ((0.0, 0.0), (shift, turn)):
        (x, y, z), right = scenario.goal(i)
        place = world.data.joint(f"piece_{i}_free").qpos
        place[:3] = [x + off, y, z]
        place[3:] = [np.cos((right + yaw) / 2), 0.0, 0.0, np.sin((right + yaw) / 2)]
        world.loop.restore(world.loop.state())
        for _ in range(2):  # events see the contacts of the period before
            with world.events():
                scenario.events(world)
            world.step_filtered(world.idle)
    assert scenario.failure(world) is None
    return missed(scenario, world, "no piece was tried in a second place")


@pytest.mark.parametrize(
    ("shift", "turn", "twice"), [(0.0, 0.0, False), (0.5, 0.0, False), (1.2, 0.0, True), (0.0, math.pi / 2, True)]
)
def test_a_piece_that_touched_the_bin_may_be_shifted_by_half_a_unit_and_not_tried_elsewhere(shift, turn, twice):
    assert touching_in_the_bin(NOMINAL, load(TASK, NOMINAL), 1, shift * NOMINAL.unit, turn) == twice


# --- plans -------------------------------------------------------------------------------


@pytest.mark.parametrize("split", ["id", "four_pieces"])
def test_shortcuts_are_played_to_their_end_and_leave_gaps(split):
    scenario = TASK.draw(split, 0, 0).scenario
    world = load(TASK, scenario)
    for name in scenario.shortcuts():
        rollout = play_shortcut(TASK, scenario, name, world)
        assert rollout.reason == "everything came to rest without reaching the goal"
        gap = free(scenario, world) - joints(scenario)
        assert gap > 0.9 * min(piece.area for piece in scenario.pieces)
        assert name != "all_but_one" or gap == pytest.approx(scenario.pieces[-1].area)


def test_with_a_piece_of_the_same_area_that_does_not_fit_the_witness_leaves_pieces_on_top_of_others():
    ((rollout, world),) = ablated(TASK, NOMINAL).values()
    floor = NOMINAL.goal(0)[0][2]
    assert not rollout.solved and max(world.pos(f"piece_{i}")[2] for i in range(3)) > floor + 0.005


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Forged(Packing):
    """One piece is the mirror image of what was cut."""

    @cached_property
    def cut(self):
        (first, *others), rect = super().cut
        return guillotine.Cut((guillotine.mirrored([first], first.bounds)[0], *others), rect)


@dataclass(frozen=True, kw_only=True)
class Lenient(Packing):
    """A part of the pieces will do."""

    def success(self, world):
        return sum(self.lies(world, i) for i in range(self.count)) >= 2


def test_invalid_scenarios_are_refuted_each_for_its_own_reason():
    nearly = {f"spot_{i}": replace(NOMINAL.spots[i], turn=20.0) for i in range(3)}
    each_refuted_for_its_own_reason(
        [
            Forged(),
            Packing(unit=0.015, clearance=0.002),
            Packing(spot_0=Spot(x=-0.08, y=0.14)),
            Packing(spot_0=Spot(x=0.35, y=0.3)),
            Packing(thickness=0.04, density=4000.0, unit=0.025, left=3, spot_0=Spot(x=-0.1, y=0.3)),
            replace(NOMINAL, **nearly),
        ]
    )


def test_two_pieces_that_overlap_are_refuted_as_a_piece_in_the_bin_is():
    in_the_bin, overlapping = Packing(spot_0=Spot(x=-0.08, y=0.14)), Packing(spot_1=Spot(x=0.1, y=-0.25))
    assert in_the_bin.infeasible().reason == overlapping.infeasible().reason


def test_a_turn_is_what_it_takes_to_lie_as_in_the_slot():
    for i, spot in enumerate(NOMINAL.spots):
        assert NOMINAL.goal(i)[1] - NOMINAL.start(i)[1] == pytest.approx(math.radians(spot.turn))


@pytest.mark.parametrize(
    ("scenario", "check", "verdict"),
    [
        (Packed(), "unsolved", "refuted"),
        (Lenient(), "shortcuts", "refuted"),
        (mistaken(Packing, "as_they_lie")(), "solved", "unknown"),
        (spared(Packing)(), "ablations", "refuted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Packing) else str(value),
)
@pytest.mark.slow
def test_what_solves_itself_or_cannot_be_solved_is_not_certified(scenario, check, verdict):
    assert not_certified(replace(TASK, horizon=20.0), scenario, check).verdict == verdict
