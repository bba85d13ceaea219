"""A chain falls alike whichever way it points, pushing behind it is a real bypass, and lacks the means."""

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    not_certified,
    play_shortcut,
    replayed,
    unguarded,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import load_task
from scengen.assets.box import Domino
from scengen.episode import OTHERWISE
from scengen.tasks.domino_single import SLAB_DISPLACEMENT, DominoSingle
from scengen.validate.rollout import AT_REST

TASK = load_task("domino_single")
ELLIPTIC, PYRAMID = mujoco.mjtCone.mjCONE_ELLIPTIC, mujoco.mjtCone.mjCONE_PYRAMIDAL


def cascade(chain, cone=ELLIPTIC, impratio=20.0):
    """Where the slab ends, along, across and above the chain [m], when the starter is given a spin, without robot."""
    scene = chain.build()
    scene.option.cone, scene.option.impratio = cone, impratio
    model = scene.compile()
    data = mujoco.MjData(model)
    spin = model.joint("tile_0_free").dofadr[0] + 4
    data.qvel[spin] = 4.0  # rad/s about the tile's own y axis
    mujoco.mj_step(model, data, 1250)
    offset = data.body("slab").xipos - chain.spot(chain.count)
    across = np.array([-chain.u[1], chain.u[0], 0.0])
    return np.array([offset @ chain.u, offset @ across, offset[2]])


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize(("gap_ratio", "reaches"), [(0.3, True), (0.9, True), (1.5, True), (1.9, True), (2.1, False)])
def test_a_falling_tile_reaches_the_next_one_if_it_is_taller_than_the_gap(gap_ratio, reaches):
    """Tiles of 80 x 40 mm: two widths of gap are one height."""
    chain = DominoSingle(count=3, gap_ratio=gap_ratio)
    assert (cascade(chain)[0] >= SLAB_DISPLACEMENT) == reaches == (chain.infeasible() is None)


@pytest.mark.parametrize("heading", [30.0, 45.0, 90.0, 135.0, 180.0])
def test_turning_the_whole_scene_turns_the_end(heading):
    straight, turned = (cascade(DominoSingle(count=4, gap_ratio=1.2, heading=h)) for h in (0.0, heading))
    assert straight[0] > 0.05
    assert np.linalg.norm(turned - straight) < 0.0005


@pytest.mark.parametrize("yaw", [2.0, 8.0])
def test_mirroring_the_whole_scene_mirrors_the_end(yaw):
    """Less exact than a turn: which corners of two touching boxes make contacts is not chosen symmetrically."""
    left, right = (cascade(DominoSingle(count=4, gap_ratio=1.2, slab_yaw=y)) for y in (yaw, -yaw))
    assert np.linalg.norm(left * [1, -1, 1] - right) < 0.004


def test_under_the_default_cone_the_end_would_depend_on_the_heading():
    """Why every scene carries its own cone: MuJoCo's default is four-sided, and its corners show."""
    straight, turned = (cascade(DominoSingle(count=4, gap_ratio=1.2, heading=h), PYRAMID, 1.0) for h in (0.0, 45.0))
    assert np.linalg.norm(turned - straight) > 0.002


@given(count=st.integers(2, 15), gap_ratio=st.floats(0.2, 2.5), thickness=st.floats(0.006, 0.04))
@settings(max_examples=40, deadline=None)
def test_all_gaps_are_equal_and_a_stouter_starter_leaves_the_face_that_is_pushed_where_it_is(
    count, gap_ratio, thickness
):
    chain, even = (
        DominoSingle(count=count, gap_ratio=gap_ratio, starter=Domino(thickness=t)) for t in (thickness, 0.012)
    )
    middles = np.array([chain.spot(i) @ chain.u for i in range(count + 1)])
    halves = np.array([piece.thickness / 2 for piece in chain.pieces])
    assert (middles - halves)[1:] - (middles + halves)[:-1] == pytest.approx(chain.gap)
    assert (middles - halves)[0] == pytest.approx(even.spot(0) @ even.u - 0.006)


# --- the bypass ---------------------------------------------------------------------------


ALONE, IN_PLACE = "the robot touched the first tile alone", "the first tile fell where it stood"
CASCADE = "each tile struck the next"
BYPASSES = {
    "push_the_slab": "the robot touched the slab",
    "push_the_last_tile": f"{OTHERWISE}: {ALONE}; {CASCADE}",
    "push_the_second_tile": f"{OTHERWISE}: {ALONE}; {CASCADE}",
    "carry_the_starter_to_the_slab": f"{OTHERWISE}: {IN_PLACE}; {CASCADE}",
    "carry_the_starter_to_the_last_tile": f"{OTHERWISE}: {IN_PLACE}; {CASCADE}",
}


@pytest.mark.parametrize("name", BYPASSES)
def test_every_way_around_the_chain_reaches_the_goal_and_does_not_count(name):
    ended = play_shortcut(TASK, DominoSingle(), name)
    assert (ended.outcome, ended.reason) == ("failure", BYPASSES[name])
    assert CASCADE in play_shortcut(TASK, unguarded(DominoSingle)(), name).lacks


class Free(unguarded(DominoSingle)):
    """Whoever moves the slab, by whatever means, has reached the goal."""

    def means(self):
        return {}


def test_without_failures_and_means_it_is_not_certified():
    not_certified(TASK, Free(), "shortcuts", "reaches the goal")


def test_without_the_tiles_between_the_witness_moves_no_slab():
    ((ended, world),) = ablated(TASK, DominoSingle()).values()
    assert ended.reason == AT_REST and world.touching_bodies("slab") == {"table"}


def test_a_memorised_push_is_lost_where_the_chain_runs_diagonally():
    trained, other = (TASK.draw(split, 0, 0).scenario for split in ("id", "diagonal"))
    assert not replayed(TASK, trained, other).solved


# --- scenes that must not be certified ---------------------------------------------------


def test_what_is_refuted_is_refuted_for_reasons_of_its_own():
    """Certificates of manipulated scenes are tested in tests/validate/test_certify.py."""
    chains = DominoSingle(gap_ratio=2.2), DominoSingle(x=0.35), DominoSingle(count=2, x=0.34, y=0.34, heading=-135.0)
    each_refuted_for_its_own_reason(chains)
