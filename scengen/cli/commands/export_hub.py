"""verify pools and write them as a folder for the Hugging Face Hub"""

import secrets
from dataclasses import dataclass
from pathlib import Path

from ...attack.check import attacked
from ...errors import BadConfig, PoolError, cut
from ...export.hub import DatasetCard, PublishedPool, check_pools, check_target, own_license, publish
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...validate.verify.pools import LIMITS, Options, Report
from ...validate.verify.recheck import LEVELS
from ...work.limits import at_least
from ...work.parallel import Workers
from ...work.printed import printable
from . import OK, Arguments, err, say, several
from .settings import read
from .verify import verified, without_expired

MAX_FAULT = 300
"""Largest length of a fault in a message [characters]."""


@dataclass(frozen=True)
class PublishSettings:
    """Settings of `scengen export hub`; conf/command/export_hub.yaml explains them."""

    pool: str | list[str]
    to: str
    title: str | None
    license: str | None
    level: str
    sample: int | None
    workers: Workers


def command(arguments: Arguments) -> int:
    settings = read("export hub", without_expired(arguments), PublishSettings)
    if settings.level not in LEVELS:
        raise BadConfig(f"level = {settings.level}; it must be {' or '.join(LEVELS)}")
    at_least(settings, workers=1, sample=1)
    for name in ("title", "license"):
        if (text := getattr(settings, name)) is not None and (not text.strip() or printable(text) != text):
            raise BadConfig(f"{name} = {cut(repr(text))}; it must be one line of text without control characters")
    pools = [Pool.open(folder).check() for folder in several(settings.pool)]
    check_pools(pools)
    check_target(Path(settings.to), pools)
    seed = secrets.randbelow(2**32)
    options = Options(settings.level, settings.sample, True, seed, settings.workers, LIMITS, attacked)
    published = []
    for pool in pools:
        with ProgressBar(err, f"verify {pool.folder}", len(pool), settings.workers) as progress_bar:
            report = verified(pool, options, search_path(arguments), progress_bar.show)
        if not report.holds:
            fault = report.failed[0]
            why = f"{report.names.get(fault['id'], fault['id'])}: {cut(fault['reason'], MAX_FAULT)}"
            verdict = f"{pool.folder} is {report.verdict} at level {report.level}: {why}"
            raise PoolError(f"{verdict}; only pools that verify are published, see scengen verify pool={pool.folder}")
        published.append(PublishedPool(pool, report.settings, _verification(report)))
    tasks = dict.fromkeys(pool.task for pool in pools)
    title = settings.title or f"scengen: {', '.join(tasks)}"
    made = publish(DatasetCard(published, title, settings.license or own_license()), Path(settings.to))
    names = ", ".join(one.name for one in published)
    written = f"wrote {settings.to}" if made else f"{settings.to} holds this data set already"
    say(f"{written}: README.md and {sum(map(len, pools))} scenarios as {names}")
    say(f"datasets.load_dataset({settings.to!r}, {published[0].name!r}) opens one; upload the folder as it is")
    return OK


def _verification(report: Report) -> str:
    """The verification of a pool as text."""
    sample = f", {report.sample['size']} simulated" if report.sample else ""
    return f"level {report.level}{sample}"
