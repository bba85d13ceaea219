"""replay every witness in robosuite and report differences"""

from collections import defaultdict
from dataclasses import asdict, dataclass

from rich.table import Table

from ...errors import BadConfig
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...work.limits import at_least
from ...work.parallel import Limits, Workers
from ...work.targets import try_file
from . import DECLINED, FAILED, OK, Arguments, err, names, out, say, several, warn, write_json
from .settings import read


@dataclass(frozen=True)
class CrosscheckSettings:
    """Settings of `scengen verify robosuite`; conf/command/verify_robosuite.yaml explains them."""

    pool: str | list[str]
    first: int | None
    limit: float
    json: str | None
    workers: Workers
    limit_seconds: float
    limit_mb: int

    def check(self) -> None:
        """Raise `BadConfig` for a value that is not valid."""
        if not 0.0 <= self.limit <= 1.0:
            raise BadConfig(f"limit = {self.limit:g}; it must lie in [0, 1]")
        at_least(self, first=1, workers=1, limit_seconds=1, limit_mb=200)


def command(arguments: Arguments) -> int:
    settings = read("verify robosuite", arguments, CrosscheckSettings)
    settings.check()
    try_file(settings.json)
    pools = [Pool.open(folder) for folder in several(settings.pool)]
    total = sum(min(len(pool), settings.first or len(pool)) for pool in pools)
    if not total:
        raise BadConfig(f"pool = {', '.join(several(settings.pool))}; it holds no scenario; see scengen generate")

    from ...envs.agreement import compare_all  # here, because importing robosuite takes seconds

    limits = Limits(settings.limit_seconds, settings.limit_mb)
    with ProgressBar(err, "crosscheck", total, settings.workers) as progress_bar:
        found = compare_all(pools, settings.workers, progress_bar.show, settings.first, search_path(arguments), limits)
    called, tasks = names(pools, [c.id for c in found if not c.agrees]), defaultdict(list)
    for comparison in found:
        tasks[comparison.task].append(comparison)
        if not comparison.agrees:
            difference = f"{comparison.ours} here, {comparison.theirs} in robosuite: {comparison.reason}"
            warn(f"DIFFERS {called[comparison.id]}: {difference}")
    table = Table(
        "task", "scenarios", "same verdict", "largest distance of hands (mm)", "largest delay of verdicts (s)"
    )
    for task, those in tasks.items():
        apart, later = max(c.apart for c in those), max(abs(c.later) for c in those)
        table.add_row(task, str(len(those)), str(sum(c.agrees for c in those)), f"{1000 * apart:.4f}", f"{later:.2f}")
    out.print(table)
    same = sum(comparison.agrees for comparison in found)
    unknown = sum("unknown" in (comparison.ours, comparison.theirs) for comparison in found)
    holds = same >= settings.limit * total
    if settings.json:
        hashes = {str(pool.folder): pool.sha256 for pool in pools}
        plain = [asdict(comparison) for comparison in found]
        write_json(settings.json, {"pools": hashes, "limit": settings.limit, "same": same, "scenarios": plain})
    limit = f"the limit of {settings.limit:.0%} is {'reached' if holds else 'MISSED'}"
    lost = f", {unknown} are unknown" if unknown else ""
    say(f"{same} of {total} scenarios have the same verdict in robosuite{lost}; {limit}")
    return OK if holds else DECLINED if same + unknown >= settings.limit * total else FAILED
