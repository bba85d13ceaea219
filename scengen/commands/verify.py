"""replay every stored witness, without any oracle"""

from dataclasses import asdict, dataclass
from functools import partial

from .. import config
from ..config import read, search_path
from ..errors import BadConfig, at_least
from ..pool import Pool
from ..runs.progress import ProgressBar
from ..validate.verify import verify
from . import FAILED, OK, Arguments, err, one, say, warn, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen verify`; meanings stand in conf/command/verify.yaml."""

    pool: str | list[str]
    json: str | None
    workers: int
    expired: str


def command(arguments: Arguments) -> int:
    settings = read("verify", arguments, Settings)
    if settings.expired not in ("fail", "report"):
        raise BadConfig(f"expired = {settings.expired}; it must be fail or report")
    at_least(settings, workers=1)
    pool = Pool.open(one(settings.pool))
    with ProgressBar(err, f"verify {pool.folder}", len(pool)) as progress_bar:
        find_task = partial(config.task, search=search_path(arguments))
        report = verify(pool, find_task, settings.workers, settings.expired == "fail", progress_bar.show)
    result = {"pool_sha256": pool.sha256, **asdict(report)}
    if settings.json:
        write_json(settings.json, result)
    for failure in report.failed:
        warn(f"FAILED {failure['id']}: {failure['reason']}")
    remarks = [f"{n} {what}" for n, what in ((report.expired, "expired"), (report.drifted, "end in other bits")) if n]
    verdict = "all hold" if report.holds else f"{len(report.failed)} failed"
    say(f"{pool.folder}: {report.checked} checked, {', '.join([verdict, *remarks])}")
    return OK if report.holds else FAILED
