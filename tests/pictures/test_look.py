"""Looks change pictures alone: the physics keeps its bits, and colours stay what they are."""

import itertools
import re
from collections import defaultdict
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible

import scengen
from scengen import list_tasks
from scengen.compose import load_task
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig, UnknownName
from scengen.evaluate.policies import make_policy
from scengen.look.colour import CHROMATIC, chroma, lab, turn
from scengen.look.finish import OF_COLOURS, OF_PARTS
from scengen.look.looks import LOOKS, PLAIN, ROOM, look_named, look_of, look_told
from scengen.perturb.drawn import arrays
from scengen.perturb.kinds import kind_of
from scengen.pictures.render import Camera
from scengen.pictures.views import things
from scengen.pool import Pool
from scengen.sim.embodiment import compose
from scengen.sim.world import World
from scengen.validate.rebuilt import rebuild
from scengen.validate.rollout import run

drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
VIEWS = ("agentview", "frontview", "sideview", "birdview")
MIN_PIXELS = 30
"""Least number of pixels of a colour whose median is compared."""
MAX_TURN = 25.0
"""Largest difference of the hue of a thing in a picture from that of its stored colour [deg]."""
APART = 30.0
"""Distance of stored colours from which on pictures must show two colours."""
MIN_DISTANCE = 12.0
"""Least distance of such colours in pictures: five times what people just see."""
MIN_FROM_TABLE = (8.0, 5.0)
"""Least distance of a colour of a thing in pictures from the table, under the key light and in its shade."""


def scene(name):
    task = load_task(name)
    return rebuild(task.draw("id", 0, 0).scenario), task.embodiment


def pixels_by_colour(eye):
    """Median colour of things by their stored colour, from the camera that shows most of it; and the table's."""
    model, found = eye.world.model, defaultdict(list)
    kept = [geom for geom in things(eye.world) if model.geom_rgba[geom, 3] == 1.0]
    for view in VIEWS:
        picture, geoms = lab(eye.take(view) / 255.0), eye.geoms(view)
        for geom in kept:
            found[tuple(model.geom_rgba[geom, :3].round(2).tolist()), view].append(picture[geoms == geom])
        found["table", view].append(picture[geoms == model.geom("table_top").id])
    best = {}
    for (colour, _), parts in found.items():
        every = np.concatenate(parts)
        if len(every) >= max(MIN_PIXELS, len(best.get(colour, ()))):
            best[colour] = every
    return {colour: np.median(every, axis=0) for colour, every in best.items()}


def lit(name, change=lambda model: None):
    """The world of a task with everything uncovered, under a light that was changed."""
    text, embodiment = scene(name)
    world = World.load(text, embodiment, ROOM)
    change(world.model)
    for body in world.free_bodies:
        if body.startswith("lid"):  # uncover what is below
            world.data.qpos[world.model.joint(f"{body}_free").qposadr[0] + 2] += 5.0
    mujoco.mj_forward(world.model, world.data)
    return world


def colours(name):
    """Colours of the things of a task in its pictures, with the key light and in its shade."""
    world = lit(name)
    with closing(Camera(world, 256, 256)) as eye:
        yield pixels_by_colour(eye)
        world.model.light_diffuse[world.model.light_castshadow.astype(bool)] = 0.0
        yield pixels_by_colour(eye)


@drawing
@pytest.mark.parametrize("name", list_tasks())
def test_colours_stay_recognisable_also_in_shade(name):
    for found, away in zip(colours(name), MIN_FROM_TABLE, strict=True):
        table = found.pop("table")
        check_recognisable(found, found)
        for colour, seen in found.items():
            assert np.linalg.norm(seen - table) > away, (colour, seen, table)


def check_recognisable(found, hued):
    """Hues of the colours `hued` that have one stay, and things of different colours stay different."""
    for colour, seen in found.items():
        if colour in hued and chroma(lab(colour)) >= CHROMATIC:
            assert turn(seen, lab(colour)) <= MAX_TURN, (colour, seen)
    for one, other in itertools.combinations(found, 2):
        if np.linalg.norm(lab(one) - lab(other)) >= APART:
            assert np.linalg.norm(found[one] - found[other]) >= MIN_DISTANCE, (one, other)


@drawing
@pytest.mark.parametrize("name", list_tasks())
def test_colours_stay_recognisable_in_warm_and_cold_light(name):
    """Red stays red and yellow yellow at the highest level of `light_colour`, whichever way it goes."""
    with closing(Camera(lit(name), 256, 256)) as eye:
        hued = {colour for colour, seen in pixels_by_colour(eye).items() if chroma(seen) >= CHROMATIC}
    shift, effect = kind_of("light_colour").strengths[-1], kind_of("light_colour").effect
    for sign in (-1.0, 1.0):
        values = {"factor": [1.0 + sign * shift, 1.0, 1.0 - sign * shift]}
        with closing(Camera(lit(name, lambda model, values=values: effect.on_model(model, values)), 256, 256)) as eye:
            found = pixels_by_colour(eye)
        found.pop("table")
        check_recognisable(found, hued)


@drawing
def test_a_light_that_takes_colours_away_is_found():
    """The negative control: a lamp of sodium."""
    sodium = {"factor": [1.0, 0.55, 0.0]}
    effect = kind_of("light_colour").effect
    with closing(Camera(lit("domino_single", lambda model: effect.on_model(model, sodium)), 256, 256)) as eye:
        found = pixels_by_colour(eye)
    found.pop("table")
    with pytest.raises(AssertionError):
        check_recognisable(found, found)


def test_the_distances_of_colours_are_those_of_skimage():
    color = pytest.importorskip("skimage.color")
    rgb = np.random.default_rng(0).random((100, 3))
    np.testing.assert_allclose(lab(rgb), color.rgb2lab(rgb), atol=0.1)


def digest(world, actions):
    """Hash of the state after some actions."""
    for action in actions:
        world.step_filtered(action)
    return world.digest


@pytest.mark.parametrize("name", ["domino_single", "seesaw_balance", "ramp_sort", "cube_toss", "bowl_table"])
def test_a_witness_ends_in_the_same_bits_in_every_look(name):
    text, embodiment = scene(name)
    task = load_task(name)
    scenario = task.draw("id", 0, 0).scenario
    witness = run(scenario, World.load(text, embodiment), scenario.oracle, task.horizon).actions
    ends = {digest(World.load(text, embodiment, look), witness) for look in (None, PLAIN, ROOM)}
    assert len(witness) > 100 and len(ends) == 1


def test_a_loose_body_would_be_noticed():
    """The negative control: what rests on the floor by contact changes the bits of everything else."""
    row = Pool.open(REFERENCE).at(0)

    def place(spec):
        ROOM.change(spec)
        body = spec.worldbody.add_body(pos=[2.0, 0.0, 0.1])
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])

    def end(look):
        world = World.load(row.scene_xml, row.embodiment, look)
        for action in row.witness:
            world.step_filtered(action)
        return world.pos("tile_0").tobytes() + world.arm.hand.tobytes()

    assert end(None) == end(ROOM) != end(replace(ROOM, change=place))


def test_the_plain_look_is_the_stored_scene():
    row = Pool.open(REFERENCE).at(0)
    stored = arrays(compose(row.scene_xml, row.embodiment, True).compile())
    shown = arrays(World.load(row.scene_xml, row.embodiment, PLAIN).model)
    differ = {name for name, array in stored.items() if array.tobytes() != shown[name].tobytes()}
    assert all(name.startswith(("text_", "name_", "names")) or name == "paths" for name in differ), differ
    assert (PLAIN.shadow_map, PLAIN.large_shadow_map, PLAIN.smooth_shadows) == (1024, 1024, False)


@pytest.mark.parametrize("look", LOOKS.values(), ids=str)
def test_a_scene_knows_its_look(look):
    row = Pool.open(REFERENCE).at(0)
    assert look_of(World.load(row.scene_xml, row.embodiment, look).model) is look
    assert look_told(str(look)) is look_named(look.name) is look


def test_what_is_no_look_is_refused():
    with pytest.raises(UnknownName, match=r"no look named 'rom' \(did you mean 'room'\?\)"):
        PoolEnv("domino_single", REFERENCE, look="rom")
    assert look_told(None) is PLAIN
    with pytest.raises(BadConfig, match="look = 'room 0'; known are room"):
        look_told("room 0")


def test_finishes_name_parts_and_colours_that_assets_have():
    sources = "".join(path.read_text() for path in Path(scengen.__file__, "../assets").resolve().glob("*.py"))
    assert [part for part in OF_PARTS if f'"{part}' not in sources and part.partition("_")[0] not in sources] == []
    written = [", ".join(f"{x:g}0?" if round(10 * x, 6) % 1 == 0 else f"{x:g}" for x in c) for c in OF_COLOURS]
    assert [colour for colour in written if not re.search(colour, sources)] == []


@drawing
def test_environments_show_the_chosen_look_and_simulate_the_same():
    shown = {}
    for look in LOOKS:
        env = PoolEnv("domino_single", REFERENCE, ["rgb_exo_right_cam"], width=64, height=64, look=look)
        env.reset(seed=0)
        seen, *_ = env.step(np.full(7, 0.3))
        shown[look] = seen["rgb_exo_right_cam"], env.world.digest
        env.close()
    (room, one), (plain, other) = shown["room"], shown["plain"]
    assert one == other and np.abs(room.astype(float) - plain).mean() > 5.0


@drawing
def test_a_policy_of_another_look_is_told():
    class Seeing:
        look = str(PLAIN)

        def reset(self, observation, info, seed): ...

        def act(self, observation): ...

    env = PoolEnv("domino_single", REFERENCE, ["rgb_exo_right_cam"])
    with pytest.warns(UserWarning, match=r"mine was trained with look plain 1 and now sees room 1"):
        make_policy("mine", lambda env: Seeing(), env)
