"""Self-test of an installation: whether this machine reproduces the stored behaviour of tasks."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from .. import compose
from ..errors import ScengenError
from ..samplers.task_files import behaviour_file
from ..work.parallel import Limits, Workers, each
from .behaviour import SELF_TEST, Behaviour, is_core
from .comparison import Compared, compare

LIMITS = Limits(600.0, 4000)
"""Time [s] and memory [MB] of one task: the slowest takes 30 s, and 500 MB."""


@dataclass(frozen=True)
class Reproduced:
    """Result for one task."""

    task: str
    compared: Compared | None
    """Comparison with the stored behaviour; None if there is none."""
    why: str = ""
    """Reason why there is none."""


@dataclass(frozen=True)
class Reproducer:
    """Compares tasks with their stored behaviour."""

    search: tuple[str, ...] = ()
    """Overrides that add folders of other packages, see `task_files.search_path`."""
    full: bool = False
    """Whether all rollouts are played that a change of the code repeats; otherwise those of `SELF_TEST`."""

    def __call__(self, name: str) -> Reproduced:
        try:
            stored = Behaviour.read(behaviour_file(name, self.search))
            wanted = is_core if self.full else SELF_TEST.__contains__
            return Reproduced(name, compare(compose.load_task(name, self.search), stored, wanted))
        except ScengenError as error:
            return Reproduced(name, None, str(error))


def reproduced(
    names: Sequence[str],
    workers: Workers,
    search: Sequence[str] = (),
    limits: Limits | None = LIMITS,
    full: bool = False,
    progress: Callable[[int], None] = lambda done: None,
) -> Iterator[Reproduced]:
    """Compare tasks with their stored behaviour, in the order in which they are done.

    Args:
        search, full: see `Reproducer`.
        progress: called with the number of tasks that have been compared.
    """
    found = each(Reproducer(tuple(search), full), names, workers, limits, lambda name, why: Reproduced(name, None, why))
    for done, one in enumerate(found, 1):
        progress(done)
        yield one
