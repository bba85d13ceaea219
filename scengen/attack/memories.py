"""Tier of memories: one training solution for all scenarios, carried to each by the pose of a body.

A policy that has memorised one demonstration and sees the pose of a body acts like this. The solutions come from
training draws of another seed. There, the best ones are chosen; the attack measures them on the scenarios that it is
about.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import GaveUp, UnknownName
from ..geometry import Mat3, Vec3, about_z, polar
from ..robots import panda
from ..samplers.task import Task
from ..scenario import Plan, Scenario
from ..sim.world import World
from ..validate.rebuilt import world_of
from ..validate.rollout import run
from .macros import Macro
from .phases import Trace
from .player import Attempt, Player
from .priors import GUESSES
from .solution_memory import HandPath, PathPart, SolutionMemory, remember, upright

MEMORY = "memory"
"""Tier of memories."""
PARTS = "parts"
"""Way of carrying a solution: each part of its path relative to the body that the hand goes to then."""
POSE = "pose"
"""Way of carrying a solution: the whole path with place and yaw of one body."""
PLACE = "place"
"""Way of carrying a solution: the whole path with the place of one body."""
BEARING = "bearing"
"""Way of carrying a solution: the whole path turned about the robot's first axis to the bearing of one body."""
SOLUTIONS = 4
"""Number of training solutions, each carried in four ways: 16 candidates."""
FIRST_JUDGES = 2
"""Number of draws on which every candidate is played."""
FURTHER_JUDGES = 4
"""Number of further draws on which the best candidates are played."""
FINALISTS = 4
"""Number of candidates that are played on the further draws."""


@dataclass(frozen=True)
class Memory:
    """A training solution, and the way in which it is carried to other scenarios."""

    name: str
    """Number of the training draw, way and body."""
    solution: SolutionMemory
    way: str
    """`PARTS`, `POSE`, `PLACE` or `BEARING`."""
    body: str
    """Name of the body whose pose carries the solution; empty for `PARTS`."""
    pos: Vec3
    """Position of the body at the start of the solution [m]."""
    rot: Mat3
    """Orientation of the body at the start of the solution."""

    def follow(self, world: World) -> Plan:
        """The solution carried to a world, in which nothing has happened or some memories have failed.

        Raises:
            GaveUp: the scene lacks a body of the solution: some tasks have more bodies in one scenario than in another.
        """
        try:
            yield from self._carried(world).follow(world)
        except UnknownName as error:
            raise GaveUp(f"the solution is one for another scene: {error}") from None

    def _carried(self, world: World) -> SolutionMemory:
        if self.way == PARTS:
            return self.solution
        here = world.pos(self.body)
        if self.way == BEARING:
            turn = about_z(polar(here - panda.BASE)[0] - polar(self.pos - panda.BASE)[0])
            return carried(self.solution, turn, panda.BASE, panda.BASE)
        turn = np.eye(3)
        if self.way == POSE:
            turn = upright(world.rot(self.body) @ self.rot.T)
        return carried(self.solution, turn, self.pos, here)


def carried(solution: SolutionMemory, turn: Mat3, before: Vec3, here: Vec3) -> SolutionMemory:
    """A solution whose whole path is turned about a point, which is moved.

    Args:
        turn: rotation of the path.
        before: the point in the scenario of the solution [m].
        here: the point in the other scenario [m].
    """

    def moved(path: HandPath) -> HandPath:
        actions = np.array(path.actions)
        actions[:, :3], actions[:, 3:6] = actions[:, :3] @ turn.T, actions[:, 3:6] @ turn.T
        whole = PathPart(0, None, np.zeros(3), np.eye(3))
        return replace(
            path, actions=actions, hands=here + (path.hands - before) @ turn.T, rots=turn @ path.rots, parts=(whole,)
        )

    return replace(solution, paths=tuple(map(moved, solution.paths)))


def candidates(scenario: Scenario, world: World, found: Trace, number: int) -> Iterator[Memory]:
    """The ways of carrying one solution.

    Args:
        number: number of the training draw.
    """
    solution = remember(scenario, world, found.actions)
    world.reset()
    handled = next((body for body in found.handled if body in world.free_bodies), "")
    goal = next((body for body in found.concerned if body not in ("table", "world", handled)), handled)
    for way, body in ((PARTS, ""), (POSE, handled), (PLACE, handled), (BEARING, goal)):
        if way == PARTS:
            yield Memory(f"{number} {way}", solution, way, "", np.zeros(3), np.eye(3))
        elif body and (way != BEARING or len(world.arms) == 1):
            yield Memory(f"{number} {way} of {body}", solution, way, body, world.pos(body), world.rot(body))


def fit(task: Task, found: Sequence[Memory], draws: Sequence[Scenario]) -> list[Memory]:
    """The memories in the order of their success on some draws, the best one first."""
    solved = dict.fromkeys((memory.name for memory in found), 0)

    def judge(memories: Sequence[Memory], scenarios: Sequence[Scenario]) -> list[Memory]:
        for scenario in scenarios:
            world = world_of(scenario, task.embodiment)
            for memory in memories:
                played = run(scenario, world, memory.follow, task.horizon, until_settled=True, raw=True)
                solved[memory.name] += played.solved
        return sorted(memories, key=lambda memory: -solved[memory.name])

    first = judge(found, draws[:FIRST_JUDGES])
    best = [memory for memory in first if solved[memory.name]][:FINALISTS] or first[:1]
    return judge(best, draws[FIRST_JUDGES : FIRST_JUDGES + FURTHER_JUDGES])


def remembered(player: Player) -> Iterator[Attempt]:
    """The best memory, and the best two and three one after the other in one episode."""
    names = list(player.memories)
    for count in (n for n in GUESSES if n <= len(names)):
        yield Attempt(f"{MEMORY}_{count}", tuple(Macro("memory", name) for name in names[:count]))
