"""The board turns once, when the peg is in line; who does not follow it, in place and direction, does not get in."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    solution,
)

from scengen import load_task
from scengen.assets.peg import Peg
from scengen.assets.slot_board import PLATE_THICKNESS, SlotBoard
from scengen.episode import Episode
from scengen.geometry import about_z, axes, between
from scengen.sim.world import World
from scengen.tasks.recover_peg_insert import (
    ALIGN_ANGLE,
    HINGE,
    INSERTED_SHARE,
    MAX_INSERTED_SHARE,
    MIN_INSERTED_SHARE,
    SIDE_TOLERANCE,
    RecoverPegInsert,
)
from scengen.validate.rollout import Jitter, run

TASK = load_task("recover_peg_insert")
NOMINAL = RecoverPegInsert()
NO_TURN = math.radians(0.05)


def put(world: World, before: float, askew: float = 0.0, aside: float = 0.0, above: float = 0.0, back: int = 1) -> None:
    """Hold the peg level with its top `before` the mouth [m], `askew` against the slot [rad], and off its axis [m].

    `back` = -1 puts it at the other side of the board.
    """
    rot, mouth = NOMINAL.slot(world)
    middle = mouth + rot @ np.array([NOMINAL.board.depth / 2, 0.0, 0.0])
    along = about_z(askew) @ (back * rot[:, 0])
    nose = middle - back * (NOMINAL.board.depth / 2 + before) * rot[:, 0] + aside * rot[:, 1]
    pos, turn = nose - NOMINAL.peg.length * along, axes(np.array([0.0, 0.0, 1.0]), along)
    free = world.data.joint("peg_free")
    free.qpos[:3] = pos + np.array([0.0, 0.0, above])
    mujoco.mju_mat2Quat(free.qpos[3:], turn.ravel())
    mujoco.mj_forward(world.model, world.data)


@pytest.fixture(scope="module")
def world():
    return load(TASK, NOMINAL)


# --- when it turns ------------------------------------------------------------------------


@pytest.mark.parametrize("back", [1, -1])
@pytest.mark.parametrize(
    ("pose", "counts"),
    [
        ({"before": NOMINAL.distance - 1e-4}, True),
        ({"before": NOMINAL.distance + 1e-4}, False),
        ({"before": -1e-4}, False),
        ({"before": 0.02, "askew": ALIGN_ANGLE - 1e-3}, True),
        ({"before": 0.02, "askew": -ALIGN_ANGLE - 1e-3}, False),
        ({"before": 0.02, "aside": SIDE_TOLERANCE - 1e-4}, True),
        ({"before": 0.02, "aside": -SIDE_TOLERANCE - 1e-4}, False),
        ({"before": 0.02, "above": SIDE_TOLERANCE + 1e-4}, False),
        ({"before": 0.02, "above": -NOMINAL.board.centre}, False),
    ],
)
def test_in_line_is_near_straight_and_in_front(world, pose, counts, back):
    put(world, **pose, back=back)
    assert NOMINAL.in_line(world) == counts


@pytest.mark.parametrize("back", [1, -1])
def test_a_peg_that_is_partly_in_the_board_is_not_in_line(world, back):
    """Negative control: the same nose, as far behind the board, is in line once the whole peg is behind it."""
    depth, length = NOMINAL.board.depth, NOMINAL.peg.length
    put(world, -depth - NOMINAL.distance / 2, back=back)
    assert not NOMINAL.in_line(world)
    put(world, -depth - NOMINAL.distance / 2 - length, back=back)
    assert NOMINAL.in_line(world)


@pytest.fixture(scope="module")
def history():
    """The oracle in the nominal scenario, as the controller gets it, and what it sees before and after every period."""
    world = load(TASK, NOMINAL)
    episode, seen = Episode(NOMINAL, world, TASK.horizon), []
    for action in solution(TASK, NOMINAL).actions:
        line, turned = NOMINAL.in_line(world), world.memory["turned"]
        state = world.state()
        episode.step(action)
        seen.append((line, turned, world.memory["turned"], world.hinge(HINGE)[0], world.data.ctrl[0:].copy(), state))
    return seen


def test_the_board_turns_once_and_when_the_peg_comes_into_line(history):
    lines, before, after, angles, *_ = zip(*history, strict=True)
    first = lines.index(True)
    assert after.index(1.0) == first and not any(before[: first + 1]) and all(after[first:])
    turn = math.radians(NOMINAL.turn)
    assert max(map(abs, angles[:first])) < NO_TURN
    assert angles[first + 20] == pytest.approx(turn, rel=0.02)
    assert max(abs(angle - turn) for angle in angles[first + 30 :]) < math.radians(0.5)


def test_in_the_middle_of_the_turn_an_episode_can_be_continued_bit_by_bit(history):
    angles = [row[3] for row in history]
    middle = next(i for i, angle in enumerate(angles) if angle > math.radians(NOMINAL.turn) / 2)
    actions = solution(TASK, NOMINAL).actions[middle : middle + 60]
    ends = []
    for used in (False, True):
        world = load(TASK, NOMINAL)
        if used:
            for action in solution(TASK, NOMINAL).actions[:100]:
                world.step_filtered(action)
        world.restore(history[middle][-1])
        episode = Episode(NOMINAL, world, TASK.horizon)
        for action in actions:
            episode.step(action)
        ends.append(world.digest)
    straight = load(TASK, NOMINAL)
    episode = Episode(NOMINAL, straight, TASK.horizon)
    for action in solution(TASK, NOMINAL).actions[: middle + 60]:
        episode.step(action)
    assert set(ends) == {straight.digest}


# --- the goal -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved():
    return after_oracle(TASK, NOMINAL)


@pytest.mark.parametrize(
    ("share", "counts"),
    [
        (MIN_INSERTED_SHARE - 0.005, False),
        (MIN_INSERTED_SHARE + 0.005, True),
        (INSERTED_SHARE, True),
        (MAX_INSERTED_SHARE - 0.005, True),
        (MAX_INSERTED_SHARE + 0.005, False),
    ],
)
def test_so_much_of_its_length_must_be_beyond_the_mouth(solved, share, counts):
    put(solved, -share * NOMINAL.peg.length)
    assert NOMINAL.inserted_share(solved) == pytest.approx(share)
    assert NOMINAL.success(solved) == counts


@pytest.mark.parametrize("off", [{"aside": 0.016}, {"above": 0.016}, {"above": -0.016}])
def test_above_or_beside_the_slot_is_not_in_it(solved, off):
    put(solved, -INSERTED_SHARE * NOMINAL.peg.length, **off)
    assert not NOMINAL.success(solved)


def test_from_behind_counts_as_well_and_without_the_turn_nothing_does(solved, world):
    share = (1.0 - INSERTED_SHARE) * NOMINAL.peg.length + NOMINAL.board.depth
    put(solved, -share, back=-1)
    assert NOMINAL.success(solved)
    world.reset()
    put(world, -INSERTED_SHARE * NOMINAL.peg.length)
    assert NOMINAL.inserted_share(world) == pytest.approx(INSERTED_SHARE) and not NOMINAL.success(world)


# --- who gets in --------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [10.0, -10.0])
def test_a_peg_that_is_shifted_but_not_turned_meets_the_back_plate(turn):
    scenario = replace(NOMINAL, turn=turn)
    world, deepest = load(TASK, scenario), 0.0
    episode = Episode(scenario, world, TASK.horizon)
    for action in scenario.shortcuts()["shift_without_turning"].plan(world):
        episode.step(world.filter(action))
        deepest = max(deepest, float(scenario.ends(world)[1][0]))
    assert deepest == pytest.approx(scenario.board.depth - PLATE_THICKNESS, abs=0.005)


@pytest.mark.parametrize("name", ["ignore_the_turn", "turn_the_wrong_way"])
def test_who_is_beside_the_mouth_does_not_even_get_so_far(name):
    world = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, name, world).solved
    assert NOMINAL.inserted_share(world) < 0.2


def test_the_oracle_copes_with_a_peg_that_sits_askew_and_with_late_and_noisy_actions():
    jitter = Jitter("askew", position=0.006, turn=4.0, mass=0.1, friction=0.2, noise=0.05, latency=2)
    world = jitter.disturbed(load(TASK, NOMINAL), NOMINAL.DISTURBED)
    assert run(NOMINAL, world, NOMINAL.oracle, TASK.horizon, jitter=jitter).solved


@pytest.mark.parametrize("changed", [{"turn": -10.0}, {"board": SlotBoard(pivot=-0.07)}, {"distance": 0.01}])
def test_a_memorised_motion_serves_no_other_turn_pin_or_moment(changed):
    other = replace(NOMINAL, **changed)
    assert other.infeasible() is None
    assert not replayed(TASK, NOMINAL, other).solved


def test_where_there_is_no_slot_nothing_goes_in():
    (name, (end, world)), *others = ablated(TASK, NOMINAL).items()
    assert name == "no_slot" and not others
    assert not end.solved and NOMINAL.inserted_share(world) < 0.1


# --- invalid scenarios --------------------------------------------------------------------


def test_each_constraint_refutes_for_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, side=0),
            replace(NOMINAL, board=SlotBoard(slot=0.024)),
            replace(NOMINAL, turn=7.0),
            replace(NOMINAL, turn=20.0, board=SlotBoard(slot=0.034)),
            replace(NOMINAL, peg=Peg(width=0.04), board=SlotBoard(slot=0.046, width=0.05, chamfer=0.0075)),
            replace(NOMINAL, board=SlotBoard(roof=0.020)),
            replace(NOMINAL, peg=Peg(length=0.09)),
            replace(NOMINAL, peg=Peg(length=0.16)),
            replace(NOMINAL, mouth_y=0.36),
            replace(NOMINAL, peg_y=0.08),
            replace(NOMINAL, mouth_x=0.31, mouth_y=0.26),
        ]
    )


def test_the_turn_must_be_more_than_the_slot_lets_pass():
    steepest = math.degrees(NOMINAL.board.steepest(NOMINAL.peg.width))
    for beyond, valid in ((3.01, True), (2.99, False)):
        assert (replace(NOMINAL, turn=-steepest - beyond).infeasible() is None) == valid


def test_no_certificate_where_the_turn_leaves_the_way_in_open():
    not_certified(TASK, replace(NOMINAL, turn=5.0), "feasible", "leaves the way in open")


def test_no_certificate_where_the_oracle_ignores_the_turn():
    not_certified(TASK, mistaken(RecoverPegInsert, "ignore_the_turn")(), "solved")


def test_mirrored_scenes_are_mirror_images():
    left, right = (load(TASK, replace(NOMINAL, side=side)) for side in (1, -1))
    mirror = np.diag([1.0, -1.0, 1.0])
    for body in ("peg", "board"):
        assert right.com(body) == pytest.approx(mirror @ left.com(body))
    flipped = mirror @ left.rot("board") @ mirror
    assert np.abs(between(flipped, right.rot("board"))).max() < 1e-6
