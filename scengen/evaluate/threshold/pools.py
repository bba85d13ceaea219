"""Pools of the levels of a shift: given ones, or fresh scenarios that are certified when they are needed.

Fresh pools never grow: when the scenarios of a level are used up, another pool is drawn from another seed. Scenarios of
different levels are not twins, so that the outcomes of all looks are independent.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...compose import certify_levels
from ...errors import BadConfig, PoolError
from ...pool import Pool
from ...pool.manifest import MANIFEST
from ...runs.generate import GenerateSettings, generate
from ...work.parallel import Workers
from ..scenarios import known
from ..settings import SCENARIOS
from .shift import Shift

LEVEL = "quick"
"""Level of the certificates."""
BLOCK = 6
"""Number of scenarios of a pool of an axis: the first looks at a level, and as many again. A training pool has as many
as in the paper: the policy `replay` remembers them."""
SEEDS_OF_LEVEL = 1000
"""Distance between the seeds of two levels: larger than the number of pools of a level."""


@dataclass(frozen=True, order=True)
class Candidate:
    """A scenario of a level. The order does not depend on where the pools are."""

    seed: int
    """Seed of its draw."""
    index: int
    """Index of its draw; twins have the same seed and index."""
    id: str
    """Id of the scenario."""
    pool_sha256: str
    """Hash of its pool."""
    folder: str
    """Folder of its pool."""


@dataclass
class LevelPools:
    """The pools of a search."""

    shift: Shift
    """The shift."""
    search: Sequence[str] = ()
    """Folders of packages with further tasks."""
    pools: list[Pool] = field(default_factory=list)
    """All pools so far."""
    is_drawn: bool = False
    """Whether they are drawn for the search, and not given."""

    def __post_init__(self) -> None:
        self.about: dict[tuple[str, str], dict[str, object]] = {}
        self._of_level: dict[int, list[Candidate]] = {level: [] for level in range(self.shift.levels + 1)}
        """Scenarios of each level of an axis; those of level 0 serve all levels of a perturbation."""
        for pool in self.pools:
            self._read(pool)

    def candidates(self, level: int) -> Sequence[Candidate]:
        """The scenarios of a level, in the order of their draws, in which they are used."""
        return self._of_level[level if self.shift.is_axis else 0]

    def draw(self, level: int) -> None:
        """Draw further scenarios of a level. Those of a finished search are there already."""

    def _read(self, pool: Pool) -> None:
        """Note the scenarios of a pool that belong to a level."""
        levels = {self.shift.split(level): level for level in range(self.shift.levels, -1, -1)}
        for (folder, id_), told in known(pool, self.search).items():
            level = levels.get(told["split"])
            if told["task"] == self.shift.task.name and level is not None:
                self.shift.check_values(level, told["shifted"], folder)
                self.about[folder, id_] = dict(told)
                self._of_level[level].append(Candidate(told["seed"], told["index"], id_, pool.sha256, folder))
        for candidates in self._of_level.values():
            candidates.sort()


def given(shift: Shift, folders: Sequence[str], search: Sequence[str]) -> LevelPools:
    """The given pools.

    Raises:
        BadConfig: a level has no scenario.
    """
    found = LevelPools(shift, search, [Pool.open(folder).check() for folder in folders])
    for level in range(shift.levels + 1):
        if not found.candidates(level):
            split, name = shift.split(level), shift.task.name
            remedy = "leave pool= out: then scenarios are drawn and certified"
            if shift.is_axis and level and not shift.task.node["axes"][shift.name].get("severities"):
                remedy += f", or generate it with +task.axes.{shift.name}.severities={shift.levels}"
            raise BadConfig(f"these pools hold no scenario of {name}, split {split}; {remedy}")
    return found


@dataclass
class DrawnPools(LevelPools):
    """Pools that are drawn for a search."""

    is_drawn: bool = True
    folder: Path = Path()
    """Folder of the pools."""
    seed: int = 0
    """Seed of the first pool."""
    workers: Workers = 1
    """Number of processes."""
    progress: Callable[[str, int, int], None] = lambda split, done, total: None
    """Called with the split, the number of scenarios that are certified, and their total."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._counts = dict.fromkeys(self._of_level, 0)
        for level in self._of_level if self.shift.is_axis else (0,):
            self.draw(level)

    def draw(self, level: int) -> None:
        """Draw a pool of a level.

        Raises:
            PoolError: too few scenarios could be certified.
        """
        level = level if self.shift.is_axis else 0
        split, number, count = self.shift.split(level), self._counts[level], BLOCK if level else SCENARIOS
        self._counts[level] += 1
        folder = self.folder / (f"{split}-{number}" if number else split)
        if not (folder / MANIFEST).is_file() or len(Pool.open(folder)) < count:
            seed = self.seed + SEEDS_OF_LEVEL * level + number
            asked = GenerateSettings(split=split, n=count, seed=seed, workers=self.workers, pool=str(folder))
            task = self.shift.task
            made = generate(
                task, certify_levels(task)[LEVEL], asked, lambda done, *_: self.progress(split, done, count)
            )
            if made.certified < count:
                why = "; ".join(f"{times}x {reason}" for reason, times in made.reasons.items())[:200]
                raise PoolError(f"{folder}: only {made.certified} of {count} scenarios could be certified ({why})")
        self.pools.append(Pool.open(folder).check())
        self._read(self.pools[-1])
