"""Films show the actions that they are given, and the default view shows what matters in every task."""

import itertools
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible
from PIL import Image

from scengen import cli, list_tasks, load_task
from scengen.assets.box import Cube, Domino
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.control.loop import Loop
from scengen.envs.observations import CAMERAS
from scengen.look.looks import PLAIN
from scengen.means import MISSED, SHOWN
from scengen.pictures import film, render, views
from scengen.pictures.view import view
from scengen.pool import Pool
from scengen.scenario import Shortcut
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.certify import certify
from scengen.validate.rebuilt import rebuild, world_of

CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)))
drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")


@pytest.fixture(scope="module")
def row():
    return next(Pool.open(REFERENCE).rows())


@pytest.fixture(scope="module")
def scenario(row):
    return load_task(row.task).scenario(row.params)


def on_screen(world, camera, points, aspect):
    """Where points appear for MuJoCo's own camera, in shares of the half picture: all within 1 are seen."""
    scene = mujoco.MjvScene(world.model, maxgeom=1000)
    everything = mujoco.mjtCatBit.mjCAT_ALL.value
    mujoco.mjv_updateScene(world.model, world.data, mujoco.MjvOption(), None, camera, everything, scene)
    eye, ahead, up = (np.mean([getattr(c, part) for c in scene.camera], axis=0) for part in ("pos", "forward", "up"))
    away = points - eye
    half = np.tan(np.radians(world.model.vis.global_.fovy) / 2)
    across = np.stack([away @ np.cross(ahead, up) / aspect, away @ up], axis=1)
    return across / (away @ ahead * half)[:, None]


@pytest.mark.parametrize("task", list_tasks())
def test_the_default_view_holds_everything_that_stands_on_the_table(task):
    """All corners in the scene of nominal values, and the hands; it is as near as that and `CLOSEST` allow."""
    loaded = load_task(task)
    world = world_of(loaded.family(), loaded.embodiment)
    model, data = world.model, world.data
    others = {world.body("world"), world.body("table"), *world.own}
    points = [arm.hand for arm in world.arms]
    for geom in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[geom]] not in others:
            frame, box = data.geom_xmat[geom].reshape(3, 3), model.geom_aabb[geom]
            points += [data.geom_xpos[geom] + frame @ (box[:3] + box[3:] * signs) for signs in CORNERS]
    assert len(points) > 8
    for aspect in (4 / 3, 1.0):
        eye = views.fitted(world, aspect)
        seen = np.abs(on_screen(world, eye, np.array(points), aspect)).max()
        assert seen < 1.0 and (seen > 0.8 or eye.distance == views.CLOSEST)


@drawing
def test_a_strip_begins_at_the_start_and_ends_when_the_witness_does(row, scenario):
    """Seen through the scene's own camera, above the captions."""
    take, above = film.Take.witness(row, scenario), slice(0, 45)
    picture = film.strip(take, frames=3, width=96, height=72, camera="agentview")
    picture, below = picture[:72], picture[72:]
    assert picture.shape == (72, 288, 3) and (below == film.timeline(take.ways, take.seconds, 288)).all()
    with render.camera(row.scene_xml, row.embodiment, 96, 72) as eye:
        assert (picture[above, :96] == eye.take("agentview")[above]).all()
        for action in row.witness:
            eye.world.step_filtered(action)
        assert (picture[above, -96:] == eye.take("agentview")[above]).all()
        assert not (picture[above, :96] == picture[above, -96:]).all()


def test_captions_tell_time_and_the_moment_of_success(row, scenario):
    take = film.Take.witness(row, scenario)
    told = list(take.moments(take.world(), take.even(3)))
    (witness,) = [check for check in row.certificate.checks if check.name == "witness"]
    assert len(repr(take)) < 1500, "neither the scene nor the actions"
    assert told[0] == "0.00 s" and told[-1] == f"{take.seconds:.2f} s, success at {witness.numbers['seconds']:.2f} s"


def test_ways_say_when_each_mean_was_decided(row, scenario):
    take = film.Take.witness(row, scenario)
    (witness,) = [check for check in row.certificate.checks if check.name == "witness"]
    ways = {way.name: way for way in take.ways}
    assert {way.found for way in ways.values()} == {SHOWN} and ways.keys() == scenario.means().keys()
    assert 0.0 < ways["each tile struck the next"].seconds <= witness.numbers["seconds"] < take.seconds
    assert ways["the robot touched the first tile alone"].seconds == pytest.approx(witness.numbers["seconds"])
    idle = replace(take, actions=np.zeros((30, 7), np.float32))
    assert str(idle.ways[2]) == "- each tile struck the next (not shown by 0.30 s)"


def test_a_timeline_marks_where_a_mean_was_shown_and_missed():
    picture = film.timeline([film.Way("a", SHOWN, 1.0), film.Way("b", MISSED, 2.0)], 2.0, 400)
    green, red = (np.argwhere((picture == colour).all(axis=2)) for colour in ((30, 140, 60), (200, 40, 40)))
    assert green[:, 1].max() < 320 < 370 < red[:, 1].max() and green[:, 0].max() < red[:, 0].min()


@drawing
def test_a_caption_is_written_into_the_lower_left_corner():
    grey = np.full((48, 200, 3), 90, np.uint8)
    written = film.captioned(grey, "1.00 s")
    changed = np.argwhere((written != grey).any(axis=2))
    assert len(changed) > 20 and changed[:, 0].min() > 20 and changed[:, 1].max() < 100


@pytest.mark.parametrize(("opacity", "hidden"), [(1.0, True), (0.3, False)])
def test_the_clearest_view_sees_past_a_wall(opacity, hidden):
    """A cube with a wall between it and the first view; a transparent wall hides nothing."""
    turn = np.radians(views.VIEWS[0][0])
    scene = table()
    place(scene, Cube(), "cube", [0.0, 0.0, TABLE_TOP])
    between = -0.1 * np.array([np.cos(turn), np.sin(turn)])
    wall = Domino(height=0.2, width=0.1, rgba=(0.5, 0.5, 0.5, opacity))
    place(scene, wall, "wall", [*between, TABLE_TOP], turn, free=False)
    world = World.load(scene_text.emit(scene)[0])
    first, best = views.fitted(world, 1.0), views.clearest(world, 1.0)
    assert ((best.azimuth, best.elevation) != (first.azimuth, first.elevation)) == hidden


def test_no_collision_hull_of_any_arm_is_in_the_picture():
    task = load_task("plate_shelf_hobi")
    model = World.load(rebuild(task.family()), task.embodiment, look=PLAIN).model
    render.hide_hulls(model)
    names = [model.body(body).name for body in model.geom_bodyid]
    for number in (0, 1):
        arm = np.array([name.startswith((f"robot{number}_", f"gripper{number}_")) for name in names])
        hulls, meshes = arm & (model.geom_group == 0), arm & (model.geom_group == 1)
        assert hulls.sum() > 10 and not model.geom_rgba[hulls, 3].any()
        assert meshes.sum() > 10 and model.geom_rgba[meshes, 3].all()


@pytest.mark.parametrize("free", [False, True])
def test_on_the_floor_only_what_stands_fast_is_in_the_view(free):
    """What is free down there has fallen off the table."""
    scene = table()
    place(scene, Cube(), "cube", [0.0, 0.0, TABLE_TOP])
    place(scene, Cube(), "low", [0.3, 0.7, 0.0], free=free)
    world = World.load(scene_text.emit(scene)[0])
    low = world.com("low") + 0.025 * CORNERS
    seen = np.abs(on_screen(world, views.clearest(world, 1.0), low, 1.0)).max() <= 1.0
    assert seen == (not free)


def test_the_view_is_chosen_over_all_states(row, scenario):
    """Of states that are all the start it is the view of the start; the world is left in the last of them."""
    world = World.load(row.scene_xml)
    start, at_start = world.state(), views.clearest(world, 1.0)
    world.step_filtered(row.witness[0])
    chosen = views.clearest(world, 1.0, [world.state(), start])
    assert (world.state() == start).all() and chosen.elevation == at_start.elevation


def test_a_hand_that_acts_is_in_the_picture(row):
    world, states = World.load(row.scene_xml), []
    for number, action in enumerate(row.witness):
        world.step_filtered(action)
        states += [world.state()] if number % 60 == 0 else []
    view, acting = views.clearest(world, 4 / 3, states), 0
    for state in states:
        world.restore(state)
        hands = views.acting(world)
        acting += len(hands)
        assert not len(hands) or np.abs(on_screen(world, view, hands, 4 / 3)).max() <= 1.0
    assert acting > 2


@drawing
def test_an_unfinished_row_of_a_strip_is_white(row, scenario):
    take = film.Take(scenario, row.scene_xml, row.embodiment, row.witness[:5])
    picture = film.strip(take, frames=6, width=64, height=48)
    assert picture.shape == (96, 256, 3)
    assert (picture[48:, 128:] == 255).all() and not (picture[48:, :128] == 255).all()


@drawing
def test_a_video_lasts_as_long_as_the_witness(row, tmp_path):
    import av

    target = tmp_path / "sub" / "film.mp4"
    arguments = ["show", "film", f"pool={REFERENCE}", f"id={row.id}", f"to={target}", "fps=2", "width=64", "height=48"]
    assert cli.run([*arguments, "camera=rgb_gripper_cam"]) == 0
    with av.open(str(target)) as file:
        times = [float(frame.time) for frame in file.decode(video=0)]
    assert times == pytest.approx(np.arange(0, len(row.witness) / 100, 0.5))


@drawing
def test_a_shortcut_is_filmed_and_its_end_is_told(row, tmp_path, capsys):
    target = tmp_path / "film.png"
    arguments = [
        "show",
        "film",
        f"pool={REFERENCE}",
        f"id={row.id}",
        f"to={target}",
        "frames=2",
        "width=64",
        "height=48",
    ]
    assert cli.run([*arguments, "of=push_the_slab"]) == 0
    assert "push_the_slab: failure" in capsys.readouterr().out
    assert Image.open(target).size == (128, 48)


@drawing
def test_show_draws_the_same_strip_as_film(row, scenario, tmp_path):
    target = tmp_path / "film.png"
    assert cli.run(["show", f"pool={REFERENCE}", f"id={row.id}", f"to={target}"]) == 0
    assert (np.array(Image.open(target)) == film.strip(film.Take.witness(row, scenario))).all()


def test_every_shortcut_of_a_scenario_can_be_filmed_and_fails(row, scenario):
    for name in scenario.shortcuts():
        take, rollout = film.shortcut(row, scenario, name)
        assert not rollout.solved and len(take.actions) > 10


def test_a_film_shows_of_every_shortcut_what_the_certificate_saw(row, scenario, monkeypatch):
    """Those that are simulated to rest get three time limits in both."""
    (check,) = [check for check in row.certificate.checks if check.name == "shortcuts"]
    for name, told in check.numbers.items():
        for raw, seen in ((False, told["filtered"]), (True, told["raw"])):
            _, rollout = film.shortcut(row, scenario, name, raw)
            assert vars(rollout).items() >= seen.items()
    patient = {"wait": Shortcut(lambda world: iter(()), to_rest=True)}
    monkeypatch.setattr(type(scenario), "shortcuts", lambda self: patient)
    monkeypatch.setattr("scengen.validate.rollout.REST_TOLERANCE", 0.0)  # nothing is ever at rest
    certificate = certify(scenario, row.horizon, last="shortcuts").certificate
    _, rollout = film.shortcut(row, scenario, "wait")
    assert rollout.seconds == certificate["shortcuts"].numbers["wait"]["filtered"]["seconds"] == 3 * row.horizon


def test_cameras_have_the_papers_names_and_the_models(row):
    world = World.load(row.scene_xml)
    assert set(CAMERAS.values()) <= {world.model.camera(i).name for i in range(world.model.ncam)}


def test_without_a_display_the_viewer_says_so(row, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert cli.run(["show", "view", f"pool={REFERENCE}", f"id={row.id}"]) == 2
    err = capsys.readouterr().err
    assert "no display to open a window on" in err and err.count("\n") == 1


def test_the_viewer_plays_the_witness_until_the_window_is_closed(row, scenario, monkeypatch):
    """With a window that is closed half a second after the witness's goal."""
    window = Window(len(row.witness) - 50)
    monkeypatch.setattr("mujoco.viewer.launch_passive", window.open)
    monkeypatch.setattr("time.sleep", lambda _: None)
    monkeypatch.setenv("DISPLAY", ":0")
    view(row, scenario, replay=True)
    assert window.shown == window.periods and scenario.success(window.world)


class Window:
    """Stands for MuJoCo's window: counts what it shows, and is closed after some control periods."""

    def __init__(self, periods):
        self.periods, self.shown = periods, 0
        self.cam, self.opt = mujoco.MjvCamera(), mujoco.MjvOption()

    def open(self, model, data, **_):
        self.world = World(model, data, Loop(model, data))
        return self

    def is_running(self):
        return self.shown < self.periods

    def sync(self):
        self.shown += 1

    def lock(self):
        return self

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["to=film.gif"], "give a .png file for a film strip or an .mp4 file for a video"),
        (["to=x.png", "of=push_the_slob"], "no shortcut named 'push_the_slob' (did you mean 'push_the_slab'?)"),
        (["to=x.png", "frames=0"], "frames = 0; it must be at least 1"),
        (["to=x.mp4", "fps=24"], "no fps that divides the control rate of 100 Hz named '24'"),
        (["to=x.png", "id=zzz"], "no scenario in"),
    ],
)
def test_bad_input_is_one_line(row, capsys, arguments, says):
    assert cli.run(["show", "film", f"pool={REFERENCE}", f"id={row.id}", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1


@drawing
@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["to=x.png", "camera=rgb_griper"], "no camera named 'rgb_griper'"),
        (["to=x.mp4", "width=63"], "width = 63; the width and height of a video must be even numbers"),
        (["to=/dev/null/x.mp4"], "/dev/null/x.mp4 cannot be written"),
    ],
)
def test_bad_input_that_needs_a_camera_is_one_line(row, capsys, arguments, says):
    assert cli.run(["show", "film", f"pool={REFERENCE}", f"id={row.id}", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err and err.count("\n") == 1
