"""A world that records which contacts it is asked about, such as those on which a goal and its rules depend."""

from dataclasses import dataclass, field
from typing import Self

from .world import World


@dataclass(frozen=True)
class Question:
    """A question to a world, and its answer."""

    kind: str
    """Name of the method of `World` that was called."""
    names: tuple[str, ...]
    """Arguments of the call: bodies, or labels of arms."""
    answer: bool | frozenset[str]
    """Answer to the question."""


@dataclass
class RecordingWorld(World):
    """A world that answers like any other, and records questions about contact."""

    asked: list[Question] = field(default_factory=list, init=False)
    """Questions since the world was made, in order. `asked.clear()` empties the list; copies and pickles start
    empty."""

    @classmethod
    def twin(cls, world: World) -> Self:
        """A recording world of the same scene in the same state as another one."""
        twin = cls.of(world.model, world.scripted)
        twin.restore(world.state())
        return twin

    def touching(self, a: str, b: str) -> bool:
        """`World.touching`, recorded."""
        answer = super().touching(a, b)
        self.asked.append(Question("touching", (a, b), answer))
        return answer

    def touched(self, a: str, b: str) -> bool:
        """`World.touched`, recorded."""
        answer = super().touched(a, b)
        self.asked.append(Question("touched", (a, b), answer))
        return answer

    def touching_bodies(self, body: str) -> set[str]:
        """`World.touching_bodies`, recorded."""
        answer = super().touching_bodies(body)
        self.asked.append(Question("touching_bodies", (body,), frozenset(answer)))
        return answer
