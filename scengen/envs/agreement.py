"""Agreement of certificates with robosuite: replays a witness in both simulations and compares the outcomes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..episode import Actions, Outcome
from ..geometry import Vec3
from ..pool import Pool, PoolRow
from ..sim.world import World
from ..validate.playable import scene_errors
from ..validate.rollout import replay
from ..work.parallel import Limits, Workers, each
from .robosuite import RobosuiteEnv, env_class


@dataclass(frozen=True)
class Comparison:
    """Outcomes of one witness in scengen and in robosuite."""

    task: str
    id: str
    ours: Outcome | Literal["unknown"]
    """Outcome in scengen; unknown if the comparison crashed or reached a limit."""
    theirs: Outcome | Literal["unknown"]
    """Outcome in robosuite; unknown if the comparison crashed or reached a limit."""
    reason: str
    """Reason of robosuite's outcome, or of an unknown one; empty for a success."""
    apart: float
    """Largest distance between the positions of a grip site in both at equal times [m]."""
    later: float
    """Time by which robosuite's episode was decided later [s]."""

    @property
    def agrees(self) -> bool:
        return self.ours == self.theirs != "unknown"


def compare_all(
    pools: Sequence[Pool],
    workers: Workers,
    progress: Callable[[int], None],
    first: int | None = None,
    search: tuple[str, ...] = (),
    limits: Limits | None = None,
) -> list[Comparison]:
    """Compare every scenario of some pools, or the `first` ones of each; ordered by task and id.

    Args:
        progress: function that gets the number of compared scenarios.
        first: number of scenarios of each pool; all of them if None.
        search: folders of other packages with tasks, see `task_files.search_path`.
        limits: limits for each scenario; None to work in this process.

    Raises:
        ScengenError: a pool is damaged, or was made with another version of MuJoCo or robosuite.
    """
    found = []
    for comparison in each(partial(compare, search=search), _rows(pools, first), workers, limits, _lost):
        found.append(comparison)
        progress(len(found))
    return sorted(found, key=lambda comparison: (comparison.task, comparison.id))


def compare(row: PoolRow, search: tuple[str, ...] = ()) -> Comparison:
    """Replay one witness in scengen and in robosuite."""
    env = env_class(row.task, search)(
        scenario=row,
        use_object_obs=False,
        use_camera_obs=False,
        has_offscreen_renderer=False,
        hard_reset=False,
        ignore_done=True,
    )
    settle = row.certificate.settle or 0.0
    with scene_errors(f" of {row.name}"):
        world = _TracedWorld.load(row.scene_xml, row.embodiment)
    ours = replay(env.scenario, world, row.witness, row.horizon, settle)
    theirs, reason, seconds, path = _replay_in_robosuite(env, row.witness, settle)
    env.close()
    together = min(len(path), len(world.path))
    apart = np.linalg.norm(np.array(path[:together]) - np.array(world.path[:together]), axis=-1)
    later = round(seconds - ours.seconds, 6) + 0.0  # never -0.0
    return Comparison(row.task, row.id, ours.outcome, theirs, reason, float(apart.max()), later)


def _lost(row: PoolRow, reason: str) -> Comparison:
    return Comparison(row.task, row.id, "unknown", "unknown", reason, 0.0, 0.0)


@dataclass
class _TracedWorld(World):
    """A world that records the positions of its hands."""

    path: list[list[Vec3]] = field(default_factory=list)

    def step_filtered(self, filtered: NDArray[np.float32]) -> None:
        super().step_filtered(filtered)
        self.path.append([arm.hand for arm in self.arms])


def _replay_in_robosuite(
    env: RobosuiteEnv, actions: Actions, settle: float
) -> tuple[Outcome, str, float, list[list[Vec3]]]:
    """Outcome of recorded actions in robosuite, its reason, the time of the decision [s], and the paths of the hands.

    As in `rollout.replay`, the robot is idle after the last action, and the goal must hold for `settle` seconds.
    """
    rows, path = iter(actions), list[list[Vec3]]()

    def step() -> None:
        row = next(rows, None)
        env.step(env.world.idle if row is None else row)
        path.append([arm.hand for arm in env.world.arms])

    env.reset()
    while env.episode.outcome is None:
        step()
    reached = env.world.time
    if env.episode.outcome == "success":
        for _ in range(round(settle / Loop.PERIOD)):
            step()
    return *env.episode.settled(), reached, path


def _rows(pools: Sequence[Pool], first: int | None) -> Iterator[PoolRow]:
    for pool in pools:
        yield from islice(pool.check().rows(), first)
