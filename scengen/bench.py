"""The costs that scengen promises, measured as ratios within one run: `scengen bench`."""

import logging
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.table import Table

from . import config
from .envs.gym import ScenarioEnv
from .generate import Settings, generate
from .pool import Pool
from .robots import panda
from .sim import native, scene_text
from .sim.loop import Loop
from .sim.world import World
from .validate.rollout import Episode, Tape, run

BARS = {
    "rollout_to_raw": (1.25, "at most"),
    "robosuite_to_ours": (8.0, "at least"),
    "scenario_to_first_step_ms": (20.0, "at most"),
    "env_step_to_raw": (1.4, "at most"),
    "env_reset_ms": (20.0, "at most"),
}
"""What is promised."""

TICKS = 200
"""Control periods of the comparison with robosuite: two seconds."""


def bench(repeats: int) -> tuple[Table, dict[str, float]]:
    """Measure everything `repeats` times and take medians of ratios.

    Raises:
        ImportError: robosuite's Python code does not run on this machine.
    """
    result = {
        "rollout_to_raw": rollout_to_raw(repeats),
        "robosuite_to_ours": robosuite_to_ours(repeats),
        "scenario_to_first_step_ms": scenario_to_first_step(repeats),
        **environment(repeats),
    }
    table = Table("measure", "value", "bar", "what", title="bench", title_justify="left")
    told = {
        "rollout_to_raw": "a rollout (oracle, filter, controller, contacts, goal) / mj_step of the same states",
        "robosuite_to_ours": "robosuite's env.step / our control period, on the same compiled Lift model",
        "scenario_to_first_step_ms": "from parameter values to the first physics step, warm (ms)",
        "env_step_to_raw": "the Gymnasium environment's step, proprioception only / mj_step of the same states",
        "env_reset_ms": "the Gymnasium environment's reset of a loaded scenario (ms)",
    }
    for name, value in result.items():
        bar, side = BARS[name]
        holds = value <= bar if side == "at most" else value >= bar
        table.add_row(name, f"{value:.2f}", f"{side} {bar:g}: {'holds' if holds else 'MISSED'}", told[name])
    return table, result


def rollout_to_raw(repeats: int) -> float:
    """Time of an oracle rollout over that of the bare mj_step calls through the same states."""
    task = config.task("domino_single")
    scenario = task.draw("id", 0, 0).scenario
    world = World.load(scene_text.emit(scenario.build())[0])

    def rollout() -> Episode:
        return run(scenario, world, scenario.oracle, task.horizon)  # type: ignore[attr-defined]

    raw = _bare(world, rollout().tape)
    return statistics.median(_seconds(rollout) / _seconds(raw) for _ in range(repeats))


def environment(repeats: int) -> dict[str, float]:
    """The Gymnasium environment without cameras: its step over the bare mj_step calls, and its reset [ms]."""
    with tempfile.TemporaryDirectory() as folder:
        composed = config.read("generate", ["task=domino_single", "n=1", f"pool={folder}/pool"])
        assert composed.task is not None
        settings = Settings(n=1, pool=f"{folder}/pool")
        generate(composed.task, composed.resolved, composed.level, settings, lambda *_: None)
        env = ScenarioEnv("domino_single", f"{folder}/pool")
        (row,) = Pool.open(f"{folder}/pool").rows()
    env.reset()
    raw = _bare(env.world, row["witness"])

    def steps() -> None:
        for action in row["witness"]:
            env.step(action)

    ratios, resets = [], []
    for _ in range(repeats):
        resets.append(1000 * _seconds(env.reset))
        ratios.append(_seconds(steps) / _seconds(raw))
    return {"env_step_to_raw": statistics.median(ratios), "env_reset_ms": statistics.median(resets)}


def _bare(world: World, tape: Tape) -> Callable[[], None]:
    """The bare mj_step calls through the states that a tape leads to, from the start."""
    controls = np.zeros((len(tape) * world.loop.substeps, world.model.nu))
    world.reset()
    world.loop.replay(tape, controls)

    def raw() -> None:
        world.reset()
        _step_with(world.model._address, world.data._address, world.data.ctrl, controls)

    raw()
    return raw


def robosuite_to_ours(repeats: int) -> float:
    """Time of robosuite's env.step over that of our control period, same model, same actions."""
    env = _lift()
    model = env.sim.model._model
    loop = Loop(model, mujoco.MjData(model), home=panda.HOME)
    actions = 0.3 * np.sin(0.05 * np.arange(TICKS)[:, None] + np.arange(7)).astype(np.float32)

    def theirs() -> None:
        for action in actions:
            env.step(action)

    def ours() -> None:
        for action in actions:
            loop.tick(action)

    ratios = []
    for _ in range(repeats + 1):  # the first one warms up
        env.reset()
        loop.reset()
        ratios.append(_seconds(theirs) / _seconds(ours))
    return statistics.median(ratios[1:])


def _lift() -> Any:
    """robosuite's own Lift environment without pictures, and without the log lines of its import."""
    logging.disable(logging.WARNING)
    backend = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"  # else robosuite wants OpenGL on import
    try:
        import robosuite  # here, because it takes seconds and nothing else needs it
    finally:
        os.environ.pop("MUJOCO_GL")
        if backend is not None:
            os.environ["MUJOCO_GL"] = backend
        logging.disable(logging.NOTSET)
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)
    return robosuite.make(
        "Lift",
        robots="Panda",
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        control_freq=round(1 / Loop.PERIOD),
        horizon=1_000_000,
    )


def scenario_to_first_step(repeats: int) -> float:
    """Median time from a draw's values to the end of the first physics step [ms]."""
    task = config.task("domino_single")
    scenarios = [task.draw("id", 0, index).scenario for index in range(4 * repeats + 2)]
    times = []
    for scenario in scenarios:
        start = time.perf_counter()
        world = World.load(scene_text.emit(scenario.build())[0])
        mujoco.mj_step(world.model, world.data)
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times[2:])


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


@njit(nogil=True, cache=True)
def _step_with(model: int, data: int, ctrl: NDArray[np.float64], controls: NDArray[np.float64]) -> None:
    """Bare mj_step calls with recorded controls, without Python in between."""
    for row in controls:
        ctrl[:] = row
        native.step(model, data)
