"""the two or three parameters that make a scenario fail its certificate"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from ..analysis.shrink import centre, shrink
from ..analysis.space import scale
from ..analysis.tables import shrunk_table
from ..config import read, typed
from ..errors import BadConfig, at_least
from ..params import Value, values, with_values
from ..runs.progress import Bar
from ..samplers.task import ID, Task
from ..scenario import Scenario
from ..validate.certify import Check, certify
from ..validate.settings import CertifySettings
from . import OK, Arguments, err, out, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen shrink`; meanings stand in conf/command/shrink.yaml."""

    split: str = ID
    sampler: str = "iid"
    seed: int = 0
    index: int = 0
    json: str | None = None


def command(arguments: Arguments) -> int:
    composed = read("shrink", arguments)
    settings, task, level = typed("", Settings, composed.settings), composed.task, composed.level
    assert task is not None
    at_least(settings, seed=0, index=0)
    scenario = _proposed(task, settings)
    failed = certify(scenario, task.horizon, level, task.embodiment).certificate.failed
    where = f"{task.name}/{settings.split}/{settings.index}"
    if failed is None:
        raise BadConfig(f"{where} passes every check at level {level.level}; there is nothing to shrink")
    out.print(f"{where} fails {failed.name}: {failed.reason}", highlight=False)
    scales = {name: scale(task, name) for name in task.known}
    with Bar(err, f"shrink {where}", 0) as bar:
        found = shrink(values(scenario), centre(task.training), scales, _fails(task, level, failed, bar.of))
    out.print(shrunk_table(found, {name: p.unit for name, p in task.known.items()}))
    nearest = with_values(scenario, found.values)
    out.print(f"{len(found.causes)} of {len(task.known)} parameters matter; {found.tries} scenarios were judged")
    if settings.json:
        write_json(
            settings.json,
            {"check": failed.name, "reason": failed.reason, "tries": found.tries, "values": values(nearest)}
            | {"causes": [asdict(cause) for cause in found.causes]},
        )
    return OK


def _proposed(task: Task, settings: Settings) -> Scenario:
    """The scenario of an index: the first feasible try, or the first one where none is feasible."""
    tries = list(task.proposals(settings.split, settings.seed, settings.index, task.design(settings.sampler)))
    return (tries[0] if tries[-1].refutation else tries[-1]).scenario


def _fails(
    task: Task, level: CertifySettings, failed: Check, progress: Callable[[int, int], None]
) -> Callable[[Mapping[str, Value]], bool]:
    """Whether a scenario fails the same check, and no cheaper one before it."""
    start, judged = task.family(), 0

    def fails(candidate: Mapping[str, Value]) -> bool:
        nonlocal judged
        judged += 1
        progress(judged, judged + 1)
        certificate = certify(
            with_values(start, candidate), task.horizon, level, task.embodiment, last=failed.name
        ).certificate
        checks = [c for c in certificate.checks if c.passed is False]
        return bool(checks) and checks[0].name == failed.name

    return fails
