"""replay every stored witness, without any oracle"""

from dataclasses import asdict, dataclass
from functools import partial

from .. import config
from ..config import read, search_path, typed
from ..errors import BadConfig, at_least
from ..pool import Pool
from ..runs.progress import Bar
from ..validate.verify import verify
from . import FAILED, OK, Arguments, err, one, out, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen verify`; meanings stand in conf/command/verify.yaml."""

    pool: str | list[str] = ""
    json: str | None = None
    workers: int = 1
    expired: str = "fail"


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("verify", arguments).settings)
    if settings.expired not in ("fail", "report"):
        raise BadConfig(f"expired = {settings.expired}; it must be fail or report")
    at_least(settings, workers=1)
    pool = Pool.open(one(settings.pool))
    with Bar(err, f"verify {pool.folder}", len(pool)) as bar:
        find_task = partial(config.task, search=search_path(arguments))
        report = verify(pool, find_task, settings.workers, settings.expired == "fail", bar.show)
    result = {"pool_sha256": pool.sha256, **asdict(report)}
    if settings.json:
        write_json(settings.json, result)
    for failure in report.failed:
        err.print(f"FAILED {failure['id']}: {failure['reason']}", style="red", highlight=False, markup=False)
    remarks = [f"{n} {what}" for n, what in ((report.expired, "expired"), (report.drifted, "end in other bits")) if n]
    verdict = "all hold" if report.holds else f"{len(report.failed)} failed"
    out.print(f"{pool.folder}: {report.checked} checked, {', '.join([verdict, *remarks])}", highlight=False)
    return OK if report.holds else FAILED
