"""Pools of the arm `benign`: fresh training scenarios, whose success differs from training by chance alone."""

from collections.abc import Callable, Sequence

from ..compose import certify_levels, load_task
from ..errors import PoolError
from ..pool import Pool
from ..pool.manifest import MANIFEST
from ..runs.generate import GenerateSettings, generate
from .scenarios import most_scenarios
from .settings import EvaluateSettings

SEED = 7300
"""Seed of the draws: none that people take for training, and not that of editions."""
LEVEL = "quick"
"""Level of the certificates."""
FOLDER = "benign"
"""Folder of the pools, below that of the results."""


def benign_pools(
    settings: EvaluateSettings, search: Sequence[str], progress: Callable[[str, int, int], None]
) -> list[str]:
    """Folders of a pool of fresh training scenarios for each task, as many as are played of the others.

    Args:
        progress: called with the task, the number of scenarios, and their total.

    Raises:
        PoolError: too few scenarios could be certified.
    """
    pools = [Pool.open(folder).check() for folder in settings.folders]
    count, found = most_scenarios(pools, settings, search), []
    for name in dict.fromkeys(pool.task for pool in pools):
        folder = settings.folder / FOLDER / name
        if not (folder / MANIFEST).is_file() or len(Pool.open(folder)) < count:
            task = load_task(name, search)
            asked = GenerateSettings(n=count, seed=SEED, workers=settings.workers, pool=str(folder))
            levels = certify_levels(task)
            made = generate(task, levels[LEVEL], asked, lambda done, *_, name=name: progress(name, done, count))
            if made.certified < count:
                raise PoolError(f"{folder}: only {made.certified} of {count} scenarios could be certified")
        found.append(str(folder))
    return found
