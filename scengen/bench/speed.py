"""Measurement of the costs that scengen promises, as ratios within one run: `scengen bench`.

Both sides of a ratio work in turn in short slices, of which only the processor time counts. What else the machine does
slows both alike then.
"""

import functools
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import mujoco
import numpy as np
from rich.table import Table

from .. import compose
from ..control.loop import ACTION, Loop
from ..envs.gym import PoolEnv
from ..envs.observations import PROPRIOCEPTION
from ..episode import Actions, Episode
from ..pictures.render import NoPictures
from ..pool import Pool, PoolRow
from ..robots import panda
from ..runs.generate import GenerateSettings, generate
from ..scenario import Scenario
from ..sim.embodiment import JAW
from ..sim.world import World
from ..validate.playable import stored_world
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import run
from ..validate.settings import QUICK
from .look_cost import look_ratios
from .quiet import disturbance, scheduled
from .timing import SLICE, Measure, Promise, Side, alternated, ratio, step_with
from .vector_speed import vector_ratios

PERIODS = 200
"""Number of control periods of the comparison with robosuite: two seconds."""
CAMERA_PERIODS = 20
"""Number of control periods with a camera, which takes a hundred times as long without a graphics card."""


PROMISES = {
    "rollout_to_raw": Promise(
        1.25, "at most", "a rollout (oracle, filter, controller, contacts, goal) / mj_step of the same states"
    ),
    "two_arms_to_raw": Promise(
        1.25, "at most", "a control period of two arms (controllers, contacts) / mj_step of the same states"
    ),
    "two_arms_to_one": Promise(
        2.3, "at most", "a control period of two arms / of one in the same scene, each arm moving alike"
    ),
    "robosuite_to_ours": Promise(
        8.0, "at least", "robosuite's env.step / our control period, on the same compiled Lift model"
    ),
    "scenario_to_first_step_ms": Promise(20.0, "at most", "from parameter values to the first physics step, warm (ms)"),
    "env_step_to_raw": Promise(
        1.4, "at most", "the Gymnasium environment's step, proprioception only / mj_step of the same states"
    ),
    "vector_to_raw": Promise(
        1.15, "at most", "a step of 16 slots in one thread, proprioception only / mj_step of the same 16 simulations"
    ),
    "vector_two_threads": Promise(
        1.7, "at least", "steps in a second of 16 slots in two threads / of one Gymnasium environment"
    ),
    "vector_to_async": Promise(
        3.0, "at least", "steps in a second of 16 slots, one thread a core / of AsyncVectorEnv with 16 processes"
    ),
    "room_picture_to_plain": Promise(1.4, "at most", "a picture of 256 x 256 pixels in the room / in the plain look"),
    "room_start_to_plain": Promise(
        1.5, "at most", "a scenario's text to its first picture, in the room / in the plain look"
    ),
    "env_reset_ms": Promise(20.0, "at most", "the Gymnasium environment's reset of a loaded scenario (ms)"),
}
"""Promised limits, by measure."""


def bench(repeats: int) -> tuple[list[Table], dict[str, Any], str]:
    """Measure everything `repeats` times and take the medians of the ratios.

    Returns:
        Tables, the result, and why the machine was not quiet; an empty text if it was. Measures of robosuite and of
        pictures are missing where it, or OpenGL, is not installed.
    """
    load, begin = os.getloadavg()[0], scheduled()
    found = {
        "rollout_to_raw": rollout_to_raw(repeats),
        **two_arms(repeats),
        **({} if _no_robosuite() else {"robosuite_to_ours": robosuite_to_ours(repeats)}),
        "scenario_to_first_step_ms": scenario_to_first_step(repeats),
        **gym_costs(repeats),
    }
    with _pool() as pool:
        row = next(pool.rows())
        found |= vector_ratios(str(pool.folder), row, repeats)
        with suppress(NoPictures):
            found |= look_ratios(row, repeats)
    ran, waited = (now - before for now, before in zip(scheduled(), begin, strict=True))
    table = Table("measure", "median", "spread", "limit", "what", title="bench", title_justify="left")
    for name, measure in found.items():
        promise = PROMISES[name]
        kept = "holds" if promise.holds(measure.median) else "MISSED"
        limit = f"{promise.side} {promise.limit:g}: {kept}"
        table.add_row(name, f"{measure.median:.2f}", f"{measure.spread:.2f}", limit, promise.what)
    periods = costs(repeats)
    beside = Table("control period of 10 ms", "cost (ms)", "times MuJoCo", title="environments", title_justify="left")
    for name, value in periods.items():
        beside.add_row(name, f"{value:.2f}", f"{value / next(iter(periods.values())):.1f}")
    ratios = {name: measure for name, measure in found.items() if not name.endswith("_ms")}
    noise = disturbance(load, waited / max(ran + waited, 1.0), ratios)
    result = {name: measure.median for name, measure in found.items()}
    spreads = {name: measure.spread for name, measure in found.items()}
    parts = parts_of_a_rollout(repeats)
    share = Table("a control period of a rollout", "times MuJoCo", title="parts of a rollout", title_justify="left")
    for name, value in parts.items():
        share.add_row(name, f"{value:.2f}")
    values = {"control_period_ms": periods, "rollout_parts": parts, "spread": spreads, "disturbed_by": noise}
    return [table, beside, share], {**result, **values}, noise


def core(repeats: int) -> dict[str, Measure]:
    """The measures that hold for every version of MuJoCo, and need no robosuite."""
    return {
        "rollout_to_raw": rollout_to_raw(repeats),
        "env_step_to_raw": gym_costs(repeats)["env_step_to_raw"],
        "scenario_to_first_step_ms": scenario_to_first_step(repeats),
    }


def rollout_to_raw(repeats: int) -> Measure:
    """Ratio of the time of an oracle rollout to that of the bare mj_step calls through the same states."""
    task = compose.load_task("domino_single")
    scenario = task.draw("id", 0, 0).scenario
    world, bare = world_of(scenario), world_of(scenario)
    recorded = run(scenario, world, scenario.oracle, task.horizon).actions
    rollout = _rollout(scenario, world, task.horizon, len(recorded))
    return ratio(alternated([rollout, _bare(bare, recorded)], repeats))


def _rollout(scenario: Scenario, world: World, horizon: float, periods: int) -> Side:
    """An oracle rollout."""

    def rollout() -> Iterator[None]:
        world.reset()
        plan, episode = scenario.oracle(world), Episode(scenario, world, horizon)
        for number in range(periods):
            action = next(plan, world.idle) if episode.outcome is None else world.idle
            episode.step(world.received(action))
            if number % SLICE == SLICE - 1:
                yield

    return rollout


def parts_of_a_rollout(repeats: int) -> dict[str, float]:
    """Processor time of a control period of an oracle rollout, part by part, over the bare mj_step calls: 1 and more.

    Each side does what the previous one does, and one thing more.
    """
    task = compose.load_task("domino_single")
    scenario = task.draw("id", 0, 0).scenario
    world, bare, played, judged, planned = (world_of(scenario) for _ in range(5))
    actions = run(scenario, world, scenario.oracle, task.horizon).actions

    def replayed() -> Iterator[None]:
        world.reset()
        for start in range(0, len(actions), SLICE):
            world.loop.replay(actions[start : start + SLICE])
            yield

    def called() -> Iterator[None]:
        played.reset()
        yield from _sliced(played.step_filtered, actions)

    def episode() -> Iterator[None]:
        judged.reset()
        yield from _sliced(Episode(scenario, judged, task.horizon).step, actions)

    sides = {
        "MuJoCo: five bare mj_step": _bare(bare, actions),
        "and controller, suction, contact tables: one compiled call for ten periods": replayed,
        "and a call from Python for each period": called,
        "and events, goal and rules": episode,
        "and plan and filter: a rollout": _rollout(scenario, planned, task.horizon, len(actions)),
    }
    found = list(zip(*alternated(list(sides.values()), repeats), strict=True))
    ratios = (ratio(zip(times, found[0], strict=True)).median for times in found)
    return dict(zip(sides, ratios, strict=True))


def two_arms(repeats: int) -> dict[str, Measure]:
    """Ratios of the time of a control period of two arms to the bare mj_step calls, and to a period of one arm."""
    text = rebuild(compose.load_task("domino_single").draw("id", 0, 0).scenario)
    one, two, bare = (World.load(text, "+".join([JAW] * arms)) for arms in (1, 2, 2))
    single = _waving()
    double = np.hstack([single, single])

    def play(world: World, actions: Actions) -> Side:
        def steps() -> Iterator[None]:
            world.reset()
            yield from _sliced(world.step_filtered, actions)

        return steps

    found = alternated([play(two, double), play(one, single), _bare(bare, double)], repeats)
    return {
        "two_arms_to_raw": ratio((pair, raw) for pair, _, raw in found),
        "two_arms_to_one": ratio((pair, lone) for pair, lone, _ in found),
    }


def gym_costs(repeats: int) -> dict[str, Measure]:
    """Costs of the Gymnasium environment without cameras: its step over bare mj_step calls, and its reset [ms]."""
    with _pool() as pool:
        env, row = PoolEnv("domino_single", pool.folder, PROPRIOCEPTION), next(pool.rows())
    env.reset()
    resets = [1000 * _seconds(env.reset) for _ in range(repeats)]
    ratios = alternated([_steps_of(env, row.witness), _bare(stored_world(row), row.witness)], repeats)
    return {"env_step_to_raw": ratio(ratios), "env_reset_ms": Measure(tuple(resets))}


def costs(repeats: int) -> dict[str, float]:
    """Cost of a control period of 10 ms in each environment with the same scenario and actions, by name [ms].

    Environments with a camera of 256 x 256 pixels are missing if there is no OpenGL, and those of robosuite without it.
    """
    with _pool() as pool:
        row = next(pool.rows())
        actions = row.witness
        bare = PoolEnv("domino_single", pool.folder, PROPRIOCEPTION)
        seeing = PoolEnv("domino_single", pool.folder, ["rgb_exo_right_cam"])
    brief = actions[:CAMERA_PERIODS]
    world = stored_world(row)
    missing = _no_robosuite()
    sides = {
        "MuJoCo: five bare mj_step": _bare(world, actions),
        "scengen in Gymnasium: proprioception": _steps_of(bare, actions),
        **({} if missing else {"robosuite: proprioception": _steps_of(_robosuite(row, False), actions)}),
    }
    spent = zip(*alternated(list(sides.values()), repeats), strict=True)
    found = {name: statistics.median(times) / len(actions) for name, times in zip(sides, spent, strict=True)}
    if missing:
        found[f"({missing})"] = float("nan")
    try:
        found["scengen in Gymnasium: and one camera"] = _stepping(seeing, brief)
        if not missing:
            found["robosuite: and one camera"] = _stepping(_robosuite(row, True), brief)
    except NoPictures as error:
        found[f"(no cameras: {error})"] = float("nan")
    return {name: 1000 * seconds for name, seconds in found.items()}


@functools.cache
def _no_robosuite() -> str:
    """Reason why robosuite's environments do not run here; empty if they do."""
    try:
        from ..envs import robosuite_models  # noqa: F401  # here, because robosuite takes seconds
    except ImportError as error:
        return str(error)
    return ""


@contextmanager
def _pool() -> Iterator[Pool]:
    """A temporary pool of one scenario."""
    with tempfile.TemporaryDirectory() as folder:
        task, settings = compose.load_task("domino_single"), GenerateSettings(n=1, pool=f"{folder}/pool")
        yield generate(task, QUICK, settings, lambda *_: None).pool


def _robosuite(row: PoolRow, camera: bool) -> Any:
    """The same scenario in robosuite."""
    from ..envs.robosuite import env_class  # here, because robosuite takes seconds and nothing else needs it

    return env_class("domino_single")(
        robots="Panda",
        scenario=row,
        has_renderer=False,
        has_offscreen_renderer=camera,
        use_camera_obs=camera,
        camera_names="agentview",
        camera_heights=256,
        camera_widths=256,
        ignore_done=True,
    )


def _stepping(env: Any, actions: Actions) -> float:
    """Mean time of a step [s]."""
    env.reset()

    def steps() -> None:
        for action in actions:
            env.step(action)

    return _seconds(steps) / len(actions)


def _sliced(step: Callable[[Any], object], actions: Actions) -> Iterator[None]:
    """Take a step for each action, and yield after each slice of them."""
    for number, action in enumerate(actions):
        step(action)
        if number % SLICE == SLICE - 1:
            yield


def _steps_of(env: Any, actions: Actions) -> Side:
    """The steps of an environment. Its reset, which comes before, is not counted."""

    def steps() -> Iterator[None]:
        env.reset()
        return _sliced(env.step, actions)

    return steps


def _bare(world: World, actions: Actions) -> Side:
    """The bare mj_step calls through the states that recorded actions lead to, from the start."""
    substeps = world.loop.substeps
    controls = np.zeros((len(actions) * substeps, world.model.nu))
    world.reset()
    world.loop.replay(actions, controls)

    def raw() -> Iterator[None]:
        world.reset()
        for start in range(0, len(controls), SLICE * substeps):
            part = controls[start : start + SLICE * substeps]
            step_with(world.model._address, world.data._address, world.data.ctrl, part)
            yield

    return raw


def robosuite_to_ours(repeats: int) -> Measure:
    """Ratio of the time of robosuite's env.step to our control period, with the same model and actions."""
    env = _lift()
    model = env.sim.model._model
    loop = Loop(model, mujoco.MjData(model), home=panda.HOME)
    actions = _waving()

    def ours() -> Iterator[None]:
        loop.reset()
        return _sliced(loop.step, actions)

    return ratio(alternated([_steps_of(env, actions), ours], repeats))


def _lift() -> Any:
    """robosuite's own Lift environment, without pictures."""
    from ..envs import robosuite_models  # noqa: F401  # keeps robosuite's import quiet

    # isort: split
    import robosuite  # here, because it takes seconds and nothing else needs it

    return robosuite.make(
        "Lift",
        robots="Panda",
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        control_freq=round(1 / Loop.PERIOD),
        horizon=1_000_000,
    )


def scenario_to_first_step(repeats: int) -> Measure:
    """Time from a draw's values to the end of the first physics step [ms]."""
    task = compose.load_task("domino_single")
    scenarios = [task.draw("id", 0, index).scenario for index in range(4 * repeats + 2)]
    times = []
    for scenario in scenarios:
        start = time.perf_counter()
        world = world_of(scenario)
        mujoco.mj_step(world.model, world.data)
        times.append(1000 * (time.perf_counter() - start))
    return Measure(tuple(times[2:]))


def _waving() -> Actions:
    """Actions of one arm that moves in free space, shape (PERIODS, 7)."""
    return 0.3 * np.sin(0.05 * np.arange(PERIODS)[:, None] + np.arange(ACTION)).astype(np.float32)


def _seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start
