"""A pile stands if the cone is its top; what is put on the cone topples, and two piles are none."""

from dataclasses import replace
from itertools import combinations

import pytest
from controls import (
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play,
    play_shortcut,
    replayed,
)

from scengen import load_task
from scengen.assets.shape import FRUSTUM, KINDS, Shape
from scengen.attack.priors import fit
from scengen.geometry import UP, heading
from scengen.means import MISSED
from scengen.sim.arm import IDLE
from scengen.tasks.shape_stack import FALL_ANGLE, Place, ShapeStack

TASK = load_task("shape_stack")
THREE = ShapeStack(count=3)
NAMES = tuple(THREE.pieces)
Y = heading(90.0)
NOT_ON_CONE = "nothing was set on the cone"


def put_up(scenario, spots, seconds=2.0):
    """The world after some time in which nobody acts, with the feet of shapes at these spots [m] at first."""
    world = load(TASK, scenario)
    for name, spot in spots.items():
        at = world.model.jnt_qposadr[world.model.body(name).jntadr[0]]
        world.data.qpos[at : at + 3] = spot
    for _ in range(round(100 * seconds)):
        world.step(IDLE)
    return world


def piled(scenario, *orders):
    """The world with piles in these orders, from the bottom up."""
    spots = {}
    for order in orders:
        spot = scenario.pieces[order[0]].place.spot
        for name in order:
            spots[name], spot = spot, spot + scenario.pieces[name].shape.height * UP
    return put_up(scenario, spots)


# --- the goal -----------------------------------------------------------------------------


@pytest.mark.parametrize("index", range(3))
def test_piled_with_the_cone_on_top_it_stands_and_that_is_the_goal(index):
    scenario = TASK.draw("id", 0, index).scenario
    assert scenario.pieces[scenario.order[-1]].shape.kind == FRUSTUM
    world = piled(scenario, scenario.order)
    assert scenario.success(world) and scenario.failure(world) is None


def test_flat_shapes_may_be_piled_in_any_order():
    """What is requested is a pile that stands, not the one that the oracle builds."""
    four = ShapeStack()
    *flat, cone = four.order
    assert four.success(piled(four, [*reversed(flat), cone]))


@pytest.mark.parametrize("orders", [[(0, 2), (1,)], [(0, 1), (2,)], [(0,), (1,), (2,)]])
def test_two_piles_or_three_are_not_the_goal(orders):
    assert not THREE.success(piled(THREE, *([NAMES[k] for k in order] for order in orders)))


def test_two_shapes_beside_each_other_on_a_third_stand_and_are_no_stack():
    wide = replace(THREE, cone_at=1, cube=Shape(width=0.06))
    on_top = wide.a.spot + wide.cube.height * UP
    under, one, other = NAMES
    world = put_up(wide, {one: on_top + 0.022 * Y, other: on_top - 0.0235 * Y})
    assert world.touching(under, one) and world.touching(under, other) and not world.touching(other, "table")
    assert not wide.success(world)


def test_training_has_three_to_five_of_the_five_shapes_each_at_most_once():
    """Paper, App. B, T30: a random subset. Each set of two to four is drawn beside the cone: 11 sets."""
    drawn = set()
    for index in range(300):
        kinds = [piece.shape.kind for piece in TASK.draw("id", 0, index).scenario.pieces.values()]
        assert 3 <= len(kinds) == len(set(kinds)) <= len(KINDS)
        drawn.add(frozenset(kinds))
    assert drawn == {frozenset({*flat, FRUSTUM}) for count in (2, 3, 4) for flat in combinations(range(FRUSTUM), count)}


# --- ways around ----------------------------------------------------------------------------


def has_missed(scenario, world, mean):
    """Whether the episode that was played in a world missed a mean."""
    return world.shown[list(scenario.means()).index(mean)] == MISSED


def test_what_is_put_on_the_cone_does_not_stand_and_was_set_on_the_cone():
    world = load(TASK, THREE)
    assert not play_shortcut(TASK, THREE, "cone_at_the_bottom", world).solved
    assert any(world.tilt(name) > FALL_ANGLE for name in NAMES) and has_missed(THREE, world, NOT_ON_CONE)


def test_a_cone_that_starts_on_the_widest_shape_must_come_off_first():
    perched = ShapeStack(count=3, perched=1)
    assert play(TASK, perched, perched.oracle).solved
    world = load(TASK, perched)
    unmoved = play(TASK, perched, lambda world: perched.pile(world, perched.order), world)
    assert not unmoved.solved and has_missed(perched, world, NOT_ON_CONE)


def test_a_cone_that_is_set_on_a_shape_is_not_what_is_set_on_the_cone():
    world = piled(THREE, THREE.order)
    assert world.touching(THREE.order[-1], THREE.order[-2]) and not THREE.cone_tried(world)


def test_what_lies_on_its_side_was_not_kept_upright():
    world = load(TASK, THREE)
    at = world.model.jnt_qposadr[world.model.body(NAMES[1]).jntadr[0]]
    world.data.qpos[at + 3 : at + 7] = [0.7071, 0.0, 0.7071, 0.0]
    world.data.qpos[at + 2] += 0.05
    world.step(IDLE)
    assert missed(THREE, world, "each shape was kept upright") and not missed(THREE, world, NOT_ON_CONE)


def test_without_the_cone_the_pile_is_not_complete():
    ended = play_shortcut(TASK, THREE, "leave_the_cone")
    assert not ended.solved and "without reaching the goal" in ended.reason


def test_a_fixed_place_of_the_cone_is_right_in_a_third_of_training():
    training, fresh = ([TASK.draw("id", seed, i).scenario for i in range(80)] for seed in (1, 2))
    (prior,) = fit(training, fresh=fresh)
    assert 0.2 < prior.fresh <= 0.38


@pytest.mark.parametrize("split", ["id", *TASK.axes])
def test_three_shortcuts_at_least_are_wrong_everywhere(split):
    for index in range(6):
        scenario = TASK.draw(split, 0, index).scenario
        assert len(scenario.shortcuts()) >= 3 and scenario.infeasible() is None


def test_memorised_actions_are_lost_where_the_shapes_are_higher():
    trained, other = (TASK.draw(split, 0, 0).scenario for split in ("id", "tall"))
    assert not replayed(TASK, trained, other).solved


# --- scenes that must not be certified --------------------------------------------------------


def test_an_oracle_that_does_not_look_at_the_shapes_is_not_certified():
    not_certified(TASK, mistaken(ShapeStack, "as_they_stand")(count=3), "solved", "the oracle failed")


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    each_refuted_for_its_own_reason(
        [
            replace(THREE, cube=THREE.cone),
            replace(THREE, cone=replace(THREE.cone, height=0.027)),
            replace(THREE, cube=Shape(friction=1.0)),
            replace(THREE, cone=replace(THREE.cone, width=0.046, height=0.038)),
            replace(THREE, cube=Shape(width=0.07)),
            replace(THREE, a=Place(y=0.38)),
            replace(THREE, a=Place(y=0.10)),
            replace(THREE, a=Place(x=0.33, y=0.3)),
        ]
    )
