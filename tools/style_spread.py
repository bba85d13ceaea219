"""What styles add to the hand's path once the scene is accounted for, as rows of docs/demonstrations.md.

    python tools/style_spread.py 100 domino_single seesaw_balance

N scenarios of a task are played without a style, and in the styles of `scengen demos`. A path is the hand's place at
50 equal shares of the time. A Gaussian process learns from three quarters of the scenarios how the path follows from
the parameters; printed is the root mean square of what it leaves in the others: without a style, in styles, and their
ratio. Then the distance of the styled path from the one without a style in the same scene.
"""

import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from scengen import load_task
from scengen.demos.generate import SEED
from scengen.demos.styles import NOMINAL, WEIGHTS, chosen, in_style
from scengen.errors import Infeasible
from scengen.params import values
from scengen.samplers.task import Task
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import run

SHARES = 50
"""Number of moments of a path."""
COMPONENTS = 12
"""Number of principal components of the paths that are learned."""


def path(task: Task, scenario: Scenario, style: str) -> NDArray[np.float64] | None:
    """Places of the hands at equal shares of the time [m], shape (SHARES, arms, 3); None if the goal is not reached."""
    key, seen = (task.name, scenario.id, 0), list[NDArray[np.float64]]()

    def plan(world: World) -> Plan:
        for action in in_style(scenario.oracle, style, *key)(world):
            seen.append(np.concatenate([arm.hand for arm in world.arms]))
            yield action

    played = run(scenario, world_of(scenario, task.embodiment), plan, task.horizon, False)
    if not played.solved:
        return None
    places, shares = np.array(seen), np.linspace(0.0, len(seen) - 1, SHARES)
    found = [np.interp(shares, np.arange(len(seen)), column) for column in places.T]
    return np.array(found).T.reshape(SHARES, -1, 3)


def pairs(task: Task, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Parameters that vary, each in units of its spread, and the paths without and in a style of n scenarios."""
    params, plain, styled = list[list[float]](), list[Any](), list[Any]()
    for index in range(3 * n):
        try:
            scenario = task.draw("id", SEED, index).scenario
        except Infeasible:
            continue
        style = chosen(list(WEIGHTS), task.name, scenario.id, 0)
        both = [path(task, scenario, name) for name in (NOMINAL, style)]
        if all(one is not None for one in both):
            params.append([float(v) for v in values(scenario).values() if isinstance(v, (int, float))])
            plain.append(both[0])
            styled.append(both[1])
        if len(params) == n:
            break
    found = np.array(params)
    spread = found.std(axis=0)
    moved = spread > 1e-9
    return (found[:, moved] - found[:, moved].mean(axis=0)) / spread[moved], np.array(plain), np.array(styled)


def left(params: NDArray[np.float64], paths: NDArray[np.float64]) -> float:
    """Root mean square of what the parameters do not explain of the paths of a quarter of the scenarios [m]."""
    flat = paths.reshape(len(paths), -1)
    mean = flat.mean(axis=0)
    scores, sizes, directions = np.linalg.svd(flat - mean, full_matrices=False)
    count = min(COMPONENTS, len(sizes))
    scores, learns = scores[:, :count] * sizes[:count], np.arange(len(flat)) % 4 != 0
    told = np.zeros((np.count_nonzero(~learns), count))
    for number in range(count):
        scale = scores[learns, number].std()
        scales = np.full(params.shape[1], 3.0)  # one for each parameter
        kernel = ConstantKernel(1.0) * RBF(scales, (0.3, 1e3)) + WhiteKernel(0.01, (1e-8, 1.0))  # pyright: ignore[reportArgumentType]
        model = GaussianProcessRegressor(kernel).fit(params[learns], scores[learns, number] / scale)
        told[:, number] = scale * model.predict(params[~learns])
    rest = (flat[~learns] - mean - told @ directions[:count]).reshape(-1, 3)
    return float(np.sqrt((rest**2).sum(axis=1).mean()))


def main(n: str, *tasks: str) -> None:
    """Print a row for each task."""
    warnings.simplefilter("ignore", ConvergenceWarning)
    for name in tasks:
        params, plain, styled = pairs(load_task(name), int(n))
        before, now = 1e3 * left(params, plain), 1e3 * left(params, styled)
        apart = 1e3 * float(np.sqrt(((plain - styled).reshape(-1, 3) ** 2).sum(axis=1).mean()))
        print(f"| `{name}` | {len(params)} | {before:.1f} | {now:.1f} | {now / before:.1f} | {apart:.1f} |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
