"""Measurement of the costs that scengen promises, as ratios within one run: `scengen bench`."""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numba import njit
from numpy.typing import NDArray
from rich.table import Table

from .. import compose, task_files
from ..certificate import CHECKS
from ..control import native
from ..control.loop import ACTION, Loop
from ..envs.gym import PoolEnv
from ..episode import Actions
from ..pictures.render import NoPictures
from ..pool import Pool, PoolRow
from ..robots import panda
from ..runs.generate import GenerateSettings, generate
from ..samplers.split import ID
from ..samplers.task import Task
from ..sim.world import JAW, World
from ..validate.certify import Trial
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import Rollout, run
from ..validate.settings import QUICK

PERIODS = 200
"""Number of control periods of the comparison with robosuite: two seconds."""
NEGLIGIBLE_COST = 0.05
"""Processor time below which a check is left out of the cost of a certificate [s]."""
CAMERA_PERIODS = 20
"""Number of control periods with a camera, which takes a hundred times as long without a graphics card."""


@dataclass(frozen=True)
class Promise:
    """A promised limit of a measure."""

    limit: float
    side: str
    """Side of the limit: `at most` or `at least`."""
    what: str
    """Description of the measure."""

    def holds(self, value: float) -> bool:
        """Whether a measured value satisfies the limit."""
        return value <= self.limit if self.side == "at most" else value >= self.limit


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
    "env_reset_ms": Promise(20.0, "at most", "the Gymnasium environment's reset of a loaded scenario (ms)"),
}
"""Promised limits, by measure."""


def bench(repeats: int) -> tuple[list[Table], dict[str, Any]]:
    """Measure everything `repeats` times and take the medians of the ratios.

    Raises:
        ImportError: robosuite's Python code does not run on this machine.
    """
    result = {
        "rollout_to_raw": rollout_to_raw(repeats),
        **two_arms(repeats),
        "robosuite_to_ours": robosuite_to_ours(repeats),
        "scenario_to_first_step_ms": scenario_to_first_step(repeats),
        **gym_costs(repeats),
    }
    table = Table("measure", "value", "limit", "what", title="bench", title_justify="left")
    for name, value in result.items():
        promise = PROMISES[name]
        kept = "holds" if promise.holds(value) else "MISSED"
        table.add_row(name, f"{value:.2f}", f"{promise.side} {promise.limit:g}: {kept}", promise.what)
    periods = costs(repeats)
    beside = Table("control period of 10 ms", "cost (ms)", "times MuJoCo", title="environments", title_justify="left")
    for name, value in periods.items():
        beside.add_row(name, f"{value:.2f}", f"{value / next(iter(periods.values())):.1f}")
    return [table, beside], {**result, "control_period_ms": periods}


def certificates() -> tuple[Table, dict[str, dict[str, float]]]:
    """Processor time of a quick certificate of every task's first training scenario, by check [s]."""
    costs = {name: _certificate(compose.load_task(name)) for name in task_files.tasks()}
    named = [check for check in CHECKS if any(check in cost for cost in costs.values())]
    table = Table("task", *named, "all", title="processor time of a certificate (s)", title_justify="left")
    for name, cost in costs.items():
        cells = (f"{cost[check]:.1f}" if check in cost else "" for check in named)
        table.add_row(name, *cells, f"{sum(cost.values()):.1f}")
    totals = [sum(cost.get(check, 0.0) for cost in costs.values()) for check in named]
    table.add_section()
    table.add_row("all", *(f"{total:.1f}" for total in totals), f"{sum(totals):.1f}")
    return table, costs


def _certificate(task: Task) -> dict[str, float]:
    """Processor time of each check of the first training scenario [s]."""
    trial = Trial(task.draw(ID, 0, 0).scenario, task.horizon, QUICK, task.embodiment)
    cost = {}
    for name in CHECKS:
        begin = time.process_time()
        check = trial.check(name)
        cost[name] = time.process_time() - begin
        if check.passed is False:
            break
    return {name: seconds for name, seconds in cost.items() if seconds >= NEGLIGIBLE_COST}


def rollout_to_raw(repeats: int) -> float:
    """Ratio of the time of an oracle rollout to that of the bare mj_step calls through the same states."""
    task = compose.load_task("domino_single")
    scenario = task.draw("id", 0, 0).scenario
    world = world_of(scenario)

    def rollout() -> Rollout:
        return run(scenario, world, scenario.oracle, task.horizon)

    raw = _bare(world, rollout().actions)
    return statistics.median(_seconds(rollout) / _seconds(raw) for _ in range(repeats))


def two_arms(repeats: int) -> dict[str, float]:
    """Ratios of the time of a control period of two arms to the bare mj_step calls, and to a period of one arm."""
    text = rebuild(compose.load_task("domino_single").draw("id", 0, 0).scenario)
    one, two = (World.load(text, "+".join([JAW] * arms)) for arms in (1, 2))
    single = _waving()
    double = np.hstack([single, single])

    def play(world: World, actions: Actions) -> Callable[[], None]:
        def steps() -> None:
            world.reset()
            for action in actions:
                world.apply(action)

        return steps

    alone, both, raw = play(one, single), play(two, double), _bare(two, double)
    alone()  # the first calls warm up
    both()
    found = [(_seconds(both), _seconds(alone), _seconds(raw)) for _ in range(repeats)]
    return {
        "two_arms_to_raw": statistics.median(pair / bare for pair, _, bare in found),
        "two_arms_to_one": statistics.median(pair / lone for pair, lone, _ in found),
    }


def gym_costs(repeats: int) -> dict[str, float]:
    """Costs of the Gymnasium environment without cameras: its step over bare mj_step calls, and its reset [ms]."""
    with _pool() as pool:
        env, actions = PoolEnv("domino_single", pool.folder), next(pool.rows()).witness
    env.reset()
    raw = _bare(env.world, actions)
    resets = [1000 * _seconds(env.reset) for _ in range(repeats)]
    ratios = [_stepping(env, actions) * len(actions) / _seconds(raw) for _ in range(repeats)]
    return {"env_step_to_raw": statistics.median(ratios), "env_reset_ms": statistics.median(resets)}


def costs(repeats: int) -> dict[str, float]:
    """Cost of a control period of 10 ms in each environment with the same scenario and actions, by name [ms].

    Environments with a camera of 256 x 256 pixels are missing if there is no OpenGL.
    """
    with _pool() as pool:
        row = next(pool.rows())
        actions = row.witness
        bare = PoolEnv("domino_single", pool.folder)
        seeing = PoolEnv("domino_single", pool.folder, ["rgb_exo_right_cam"])
    bare.reset()
    raw, brief = _bare(bare.world, actions), actions[:CAMERA_PERIODS]
    found = {
        "MuJoCo: five bare mj_step": statistics.median(_seconds(raw) / len(actions) for _ in range(repeats)),
        "scengen in Gymnasium: proprioception": statistics.median(_stepping(bare, actions) for _ in range(repeats)),
        "robosuite: proprioception": _stepping(_robosuite(row, False), actions),
    }
    try:
        found["scengen in Gymnasium: and one camera"] = _stepping(seeing, brief)
        found["robosuite: and one camera"] = _stepping(_robosuite(row, True), brief)
    except NoPictures as error:
        found[f"(no cameras: {error})"] = float("nan")
    return {name: 1000 * seconds for name, seconds in found.items()}


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


def _bare(world: World, actions: Actions) -> Callable[[], None]:
    """The bare mj_step calls through the states that recorded actions lead to, from the start."""
    controls = np.zeros((len(actions) * world.loop.substeps, world.model.nu))
    world.reset()
    world.loop.replay(actions, controls)

    def raw() -> None:
        world.reset()
        _step_with(world.model._address, world.data._address, world.data.ctrl, controls)

    raw()
    return raw


def robosuite_to_ours(repeats: int) -> float:
    """Ratio of the time of robosuite's env.step to our control period, with the same model and actions."""
    env = _lift()
    model = env.sim.model._model
    loop = Loop(model, mujoco.MjData(model), home=panda.HOME)
    actions = _waving()

    def theirs() -> None:
        for action in actions:
            env.step(action)

    def ours() -> None:
        for action in actions:
            loop.step(action)

    ratios = []
    for _ in range(repeats + 1):  # the first one warms up
        env.reset()
        loop.reset()
        ratios.append(_seconds(theirs) / _seconds(ours))
    return statistics.median(ratios[1:])


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


def scenario_to_first_step(repeats: int) -> float:
    """Median time from a draw's values to the end of the first physics step [ms]."""
    task = compose.load_task("domino_single")
    scenarios = [task.draw("id", 0, index).scenario for index in range(4 * repeats + 2)]
    times = []
    for scenario in scenarios:
        start = time.perf_counter()
        world = world_of(scenario)
        mujoco.mj_step(world.model, world.data)
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times[2:])


def _waving() -> Actions:
    """Actions of one arm that moves in free space, shape (PERIODS, 7)."""
    return 0.3 * np.sin(0.05 * np.arange(PERIODS)[:, None] + np.arange(ACTION)).astype(np.float32)


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
