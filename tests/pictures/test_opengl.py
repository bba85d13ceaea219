"""Any thread takes pictures, of any sensible size, and no error follows at the end of the process."""

import asyncio
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing

import numpy as np
import pytest
from helpers import REFERENCE, needs_robosuite, pictures_are_possible

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.look.looks import PLAIN
from scengen.pictures.render import Camera
from scengen.pool import Pool
from scengen.sim.world import World

drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")


@pytest.fixture(scope="module")
def world():
    return World.load(Pool.open(REFERENCE).at(0).scene_xml, look=PLAIN)


def filmed(**arguments):
    return PoolEnv("domino_single", REFERENCE, **{"render_mode": "rgb_array", "width": 64, "height": 48, **arguments})


@drawing
@pytest.mark.parametrize("size", [(1920, 1080), (1, 1), (16, 2000), (np.int64(32), 32)])
def test_pictures_may_be_larger_than_the_buffers_of_the_scene(world, size):
    with closing(Camera(world, *size)) as camera:
        picture = camera.take("agentview")
    assert picture.shape == (size[1], size[0], 3) and picture.any()


@drawing
def test_a_large_picture_shows_what_a_small_one_does(world):
    seen = []
    for width, height in ((320, 180), (1920, 1080)):
        with closing(Camera(world, width, height)) as camera:
            seen.append(camera.take("agentview").reshape(180, height // 180, 320, width // 320, 3).mean(axis=(1, 3)))
    assert np.abs(seen[0] - seen[1]).mean() < 3.0


@pytest.mark.parametrize("edge", [1.5, "64", 0, -1, 4097, True, None, float("nan")])
@pytest.mark.parametrize("name", ["width", "height"])
def test_impossible_sizes_are_refused_in_one_line(world, name, edge):
    for make in (lambda **size: Camera(world, **{"width": 64, "height": 64, **size}), filmed):
        with pytest.raises(BadConfig, match=f"{name} = .*; it must be a whole number of pixels from 1 to 4096$"):
            make(**{name: edge})


@drawing
def test_pictures_of_full_hd_are_recorded(tmp_path):
    import av

    target = tmp_path / "large"
    size = ["width=1920", "height=1080", "n=1", "fps=1", "cameras=rgb_ego_cam"]
    assert cli.run(["record", f"pool={REFERENCE}", f"to={target}", *size]) == 0
    with av.open(str(next(target.rglob("*.mp4")))) as file:
        assert next(file.decode(video=0)).to_ndarray(format="rgb24").shape == (1080, 1920, 3)


@drawing
def test_threads_take_turns_with_one_environment():
    with closing(filmed()) as env, ThreadPoolExecutor(2) as threads:
        env.reset(seed=0)
        here = env.render()
        for _ in range(2):
            assert all((picture == here).all() for picture in threads.map(lambda _: env.render(), range(4)))
            assert (env.render() == here).all()
        threads.submit(env.reset, seed=1).result()  # another scene: the first one's context is freed in this thread
        assert (threads.submit(env.render).result() == env.render()).all() and not (env.render() == here).all()


@drawing
def test_steps_and_pictures_in_threads_at_once_leave_the_simulation_as_it_is():
    alone, shared = (filmed(observations=["rgb_ego_cam", "robot0_eef_pos"]) for _ in range(2))
    actions = np.random.default_rng(0).uniform(-1, 1, (12, 7)).astype(np.float32)
    alone.reset(seed=0), shared.reset(seed=0)
    with ThreadPoolExecutor(2) as threads:
        pictures = [threads.submit(shared.render) for _ in actions]
        for action in actions:
            one, other = alone.step(action)[0], threads.submit(shared.step, action).result()[0]
            assert all(np.array_equal(one[name], other[name]) for name in one)
    assert alone.world.digest == shared.world.digest and all(each.result().shape == (48, 64, 3) for each in pictures)
    alone.close(), shared.close()


@drawing
def test_pictures_can_be_taken_under_asyncio():
    async def pictures(env):
        return [await asyncio.to_thread(env.render) for _ in range(3)]

    with closing(filmed()) as env:
        env.reset(seed=0)
        assert all((picture == env.render()).all() for picture in asyncio.run(pictures(env)))


@drawing
def test_closing_one_camera_leaves_the_others_pictures(world):
    one, other = Camera(world, 64, 48), Camera(world, 32, 32)
    before = one.take()
    other.take()
    other.close()
    assert (one.take() == before).all()
    one.close()


UNCLOSED = """
import scengen.envs.gym
env = scengen.envs.gym.PoolEnv("domino_single", {pool!r}, render_mode="rgb_array", width=64, height=64)
env.reset(seed=0)
env.render()
"""
UNCLOSED_ROBOSUITE = """
from scengen.envs.robosuite import env_class
looks = dict(camera_names="agentview", camera_widths=64, camera_heights=64)
other = env_class("domino_single")(pool={pool!r}, **looks)
other.reset()
"""


@drawing
@pytest.mark.parametrize("script", [UNCLOSED, UNCLOSED + UNCLOSED_ROBOSUITE, UNCLOSED_ROBOSUITE + UNCLOSED])
@pytest.mark.slow
def test_a_script_that_closes_nothing_ends_without_an_error(script):
    if UNCLOSED_ROBOSUITE in script:
        needs_robosuite()
    line = [sys.executable, "-c", script.format(pool=str(REFERENCE))]
    ended = subprocess.run(line, capture_output=True, text=True)
    assert ended.returncode == 0 and "Error" not in ended.stderr and "Traceback" not in ended.stderr, ended.stderr


MUJOCO_FIRST = """
import os
os.environ.pop("DISPLAY", None)
os.environ.pop("MUJOCO_GL", None)
import mujoco
import scengen
from scengen.pictures.render import camera
os.environ["MUJOCO_GL"] = {backend!r} or os.environ["MUJOCO_GL"]
row = next(scengen.Pool.open({pool!r}).rows())
with camera(row.scene_xml, row.embodiment, 64, 48) as eye:
    print(eye.take().std() > 10.0)
"""


@drawing
@pytest.mark.parametrize(("backend", "says"), [("", "True"), ("glfw", "set MUJOCO_GL=egl or osmesa")])
def test_mujoco_may_be_imported_before_scengen(backend, says):
    """MuJoCo then has contexts that need a display. Whoever asks for them by name is told so."""
    script = MUJOCO_FIRST.format(backend=backend, pool=str(REFERENCE))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert says in done.stdout + done.stderr
