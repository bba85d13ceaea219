"""What policies see is turned, bit by bit and everywhere, what they do is not; and the picture misleads."""

import math
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np
import pytest
from controls import (
    each_refuted_for_its_own_reason,
    load,
    not_certified,
    play,
    play_shortcut,
    replayed,
)
from helpers import REFERENCE, env_class, pictures_are_possible

from scengen import load_task
from scengen.assets.bar import Bar
from scengen.certificate import Certificate
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.export import recording
from scengen.export.lerobot import DatasetWriter
from scengen.export.recording import record
from scengen.orientation import VIEW_CENTRE
from scengen.pool import Pool
from scengen.pool.writing import write_pool
from scengen.runs.generate import row_of
from scengen.sim.arm import IDLE
from scengen.skills.jaw import release
from scengen.tasks.mirror_pick_place import LIFT_HEIGHT, MIN_PICTURE_OFFSET, VIEWS, MirrorPickPlace
from scengen.validate.certify import Certified
from scengen.validate.rebuilt import rebuild

TASK = load_task("mirror_pick_place")
NOMINAL = MirrorPickPlace()
PLAIN, HALF, FLIPPED, _, QUARTER = range(len(VIEWS))
WITH_EYES = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
CAMERAS = ["rgb_exo_right_cam", "rgb_gripper_cam"]
POSES = ["robot0_eef_pos", "cube_pos", "cube_quat", "seen_cube_pos"]


def row_with(view):
    """A row as in a pool, of one scene in every view; nobody has certified it."""
    draw = TASK.draw("id", 0, 0)
    text = rebuild(draw.scenario)
    witness = np.tile(IDLE, (100, 1)).astype(np.float32)
    row = row_of(TASK, draw, Certified(Certificate("quick", ()), text, witness, ""))
    return replace(row, params={**row.params, "view": view}, id=f"{view:012d}", horizon=2.0)


@pytest.fixture(scope="module")
def pools(tmp_path_factory):
    """A pool with one row for each view of the same scene, by view."""
    folder, about = tmp_path_factory.mktemp("views"), Pool.open(REFERENCE).manifest.without_files()
    return [write_pool(folder / str(view), about, [row_with(view)]).folder for view in range(len(VIEWS))]


def first_look(folder, **arguments):
    """What the Gymnasium environment shows at its start, and in its own picture."""
    env = PoolEnv(TASK.name, folder, [*CAMERAS, *POSES], "rgb_array", **{"width": 48, "height": 48, **arguments})
    with closing(env):
        return env.reset()[0], env.render(), env.observation_space


# --- what is turned, and what is not ----------------------------------------------------


@WITH_EYES
def test_gymnasium_turns_every_picture_by_half_bit_by_bit_and_nothing_else(pools):
    (plain, shown, _), (turned, rendered, _) = (first_look(pools[v], width=64) for v in (PLAIN, HALF))
    assert (rendered == np.rot90(shown, 2)).all() and shown.std() > 5
    for name in CAMERAS:
        assert (turned[name] == np.rot90(plain[name], 2)).all() and not (turned[name] == plain[name]).all()
    for name in set(POSES) - {"seen_cube_pos"}:
        assert (turned[name] == plain[name]).all()
    assert plain["seen_cube_pos"] == pytest.approx(plain["cube_pos"])
    assert turned["seen_cube_pos"][:2] == pytest.approx(2 * VIEW_CENTRE - plain["cube_pos"][:2])


@WITH_EYES
def test_gymnasium_shows_the_other_views_in_the_shapes_of_its_space(pools):
    plain, _, _ = first_look(pools[PLAIN])
    for view in (FLIPPED, QUARTER):
        seen, _, space = first_look(pools[view])
        assert space.contains(seen)
        assert all((seen[name] == VIEWS[view].apply(plain[name])).all() for name in CAMERAS)


def test_gymnasium_refuses_quarter_turns_of_pictures_that_are_not_square(pools):
    with pytest.raises(BadConfig, match="turned by a quarter and must be square"):
        PoolEnv(TASK.name, [pools[HALF], pools[QUARTER]], CAMERAS, width=64, height=48)
    PoolEnv(TASK.name, pools[QUARTER], POSES, width=64, height=48)  # without pictures there is nothing to refuse


@WITH_EYES
def test_robosuite_turns_colour_and_depth_bit_by_bit_whichever_row_comes_first(monkeypatch):
    eyes = {"camera_names": "agentview", "camera_heights": 48, "camera_widths": 48, "camera_depths": True}
    env = env_class(TASK.name)(scenario=row_with(PLAIN), hard_reset=False, **eyes)
    plain = env.reset()
    for view in (HALF, QUARTER):
        env.scenario = TASK.scenario(row_with(view).params)
        seen = env.reset()
        for name in ("agentview_image", "agentview_depth"):  # robosuite's first row is at the bottom by default
            assert (seen[name][::-1] == VIEWS[view].apply(plain[name][::-1])).all(), name
            assert not (seen[name] == plain[name]).all()
        assert (seen["cube_pos"] == plain["cube_pos"]).all() and (seen["object-state"] == plain["object-state"]).all()
        assert seen["seen_cube_pos"] == pytest.approx(VIEWS[view].seen_at(plain["cube_pos"]))
    monkeypatch.setattr("robosuite.macros.IMAGE_CONVENTION", "opencv")
    (colour,), _ = env._create_camera_sensors("agentview", cam_w=48, cam_h=48, cam_d=False, cam_segs=None)
    assert (colour({}) == seen["agentview_image"][::-1]).all()
    env.close()


@WITH_EYES
def test_robosuite_refuses_quarter_turns_of_pictures_that_are_not_square():
    with pytest.raises(BadConfig, match="must be square"):
        env_class(TASK.name)(scenario=row_with(QUARTER), camera_widths=64, camera_heights=48)


@WITH_EYES
def test_recordings_turn_every_picture_bit_by_bit_and_say_so_in_the_calibration(pools, tmp_path, monkeypatch):
    taken, told = [], []
    monkeypatch.setattr(DatasetWriter, "calibrate", lambda self, name, how, row: told.append(how))
    add = DatasetWriter.add
    monkeypatch.setattr(DatasetWriter, "add", lambda self, values, seen: (taken.append(seen), add(self, values, seen)))
    how = {"cameras": CAMERAS[1], "width": 32, "height": 24, "fps": 2}
    for view in (PLAIN, HALF):
        record(recording.RecordSettings(str(pools[view]), str(tmp_path / str(view)), **how), lambda *_: None)
    plain, turned = taken[: len(taken) // 2], taken[len(taken) // 2 :]
    assert len(plain) == len(turned) == 4
    for one, other in zip(plain, turned, strict=True):
        assert (other[CAMERAS[1]] == np.rot90(one[CAMERAS[1]], 2)).all()
    assert told[1]["extrinsics"] == told[0]["extrinsics"]
    assert (told[1]["intrinsics"] == VIEWS[HALF].pixels(32, 24) @ told[0]["intrinsics"]).all()
    with pytest.raises(BadConfig, match="must be square"):
        record(recording.RecordSettings(str(pools[QUARTER]), str(tmp_path / "q"), **how), lambda *_: None)


# --- whom the picture misleads -----------------------------------------------------------


def test_what_is_right_for_a_view_is_no_shortcut_there():
    listed = [set(MirrorPickPlace(view=view).shortcuts()) for view in range(len(VIEWS))]
    shown, taught = {"grasp_as_shown", "steer_as_shown"}, {"grasp_as_taught", "steer_as_taught"}
    assert shown.isdisjoint(listed[PLAIN]) and taught <= listed[PLAIN]
    assert taught.isdisjoint(listed[HALF]) and shown <= listed[HALF]
    assert all(shown | taught <= names for names in listed[FLIPPED:])


def test_who_believes_the_picture_never_touches_the_cube():
    w = load(TASK, NOMINAL)
    assert not play_shortcut(TASK, NOMINAL, "grasp_as_shown", w).solved
    assert not w.touched("robot", "cube")


def test_who_steers_by_the_picture_gets_away_from_the_cube():
    w = load(TASK, NOMINAL)
    before = math.dist(w.arm.hand[:2], NOMINAL.spot[:2])
    play_shortcut(TASK, NOMINAL, "steer_as_shown", w)
    assert math.dist(w.arm.hand[:2], NOMINAL.spot[:2]) > before + 0.1


def test_a_miss_costs_nothing_but_time():
    """As shown first, then at the opposite place, as soon as the fingers have closed on nothing."""

    def feel(world):
        for view in (VIEWS[PLAIN], VIEWS[HALF]):
            yield from NOMINAL._pick(world, NOMINAL._shown_spot(view))
            if world.touching("robot", "cube"):
                return
            yield from release(world.arm)

    assert play(TASK, NOMINAL, feel).solved


def test_what_is_learnt_by_heart_in_one_view_serves_every_other():
    """Why the axes of `view` are said to ask the eye alone: no memory has one."""
    for view in range(len(VIEWS)):
        assert replayed(TASK, NOMINAL, replace(NOMINAL, view=view)).solved


@pytest.mark.parametrize("split", ["far", "small", "long", "high"])
def test_a_memorised_motion_serves_no_other_place_and_nothing_small_long_or_high(split):
    trained, moved = (TASK.draw(name, 0, 1).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


@pytest.mark.parametrize("shape", [{"long": 2.0}, {"high": 2.75}], ids=str)
def test_a_motion_that_lifts_a_cube_lifts_no_bar_and_no_post_in_its_place(shape):
    assert replayed(TASK, NOMINAL, NOMINAL).solved
    assert not replayed(TASK, NOMINAL, replace(NOMINAL, cube=replace(NOMINAL.cube, **shape))).solved


@pytest.mark.parametrize(
    "bar",
    [
        MirrorPickPlace(x=-0.142, y=0.199, yaw=1.6, cube=Bar(edge=0.0595, long=1.92)),
        MirrorPickPlace(x=-0.17, y=-0.083, yaw=5.1, cube=Bar(edge=0.0579, long=1.91)),
    ],
    ids=["left", "right"],
)
def test_near_the_robot_the_hand_turns_to_the_side_on_which_joint_7_has_room(bar):
    """The other way takes joint 7 to its end, or the hand swings aside and comes down on the bar."""
    assert play(TASK, bar, bar.oracle, load(TASK, bar)).solved


# --- goal, constraints, negative controls -------------------------------------------------


@pytest.mark.parametrize(("short", "counts"), [(-0.001, True), (0.001, False)])
def test_the_cube_counts_as_lifted_40_mm_above_its_place_on_the_table(short, counts):
    w = load(TASK, NOMINAL)
    assert play(TASK, NOMINAL, NOMINAL.oracle, w).solved and NOMINAL.success(w)
    w.data.xipos[w.body("cube"), 2] = NOMINAL.spot[2] + NOMINAL.cube.edge / 2 + LIFT_HEIGHT - short
    assert NOMINAL.success(w) == counts


@dataclass(frozen=True, kw_only=True)
class Believes(MirrorPickPlace):
    """The oracle takes the picture for upright."""

    def oracle(self, world):
        yield from super().shortcuts()["grasp_as_shown"].plan(world)

    def shortcuts(self):
        return {}


@dataclass(frozen=True, kw_only=True)
class Touched(MirrorPickPlace):
    """To be near the place that the picture shows is enough, by any means."""

    def success(self, world):
        return math.dist(world.arm.hand, self.orientation.seen_at(self.spot)) < 0.05

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (MirrorPickPlace(x=-0.03, y=0.02), "feasible", "about where it is"),
        (Believes(), "solved", "the oracle failed"),
        (Touched(), "shortcuts", "reaches the goal"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, MirrorPickPlace) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            MirrorPickPlace(y=0.385),
            MirrorPickPlace(cube=Bar(edge=0.07), view=FLIPPED, y=MIN_PICTURE_OFFSET / 2 - 0.001),
            MirrorPickPlace(cube=Bar(mass=1.0, friction=0.1)),
            MirrorPickPlace(x=0.35, y=0.3),
        ]
    )
