"""find the two or three parameters that make a scenario fail its certificate"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from ...attack.check import attacked
from ...certificate import Check
from ...errors import BadConfig
from ...ood.analysis.shrink import centre, shrink
from ...ood.analysis.space import scale
from ...ood.analysis.tables import shrunk_table
from ...params import Value, values, with_values
from ...pool.names import Name
from ...runs.progress import ProgressBar
from ...samplers.task import Task
from ...scenario import Scenario
from ...validate.certify import certify
from ...validate.settings import CertifySettings
from ...work.limits import at_least
from ...work.targets import try_file
from . import OK, Arguments, err, out, say, write_json
from .settings import read_task


@dataclass(frozen=True)
class ShrinkSettings:
    """Settings of `scengen axis shrink`; conf/command/axis_shrink.yaml explains them."""

    split: str
    sampler: str
    seed: int
    index: int
    json: str | None


def command(arguments: Arguments) -> int:
    settings, task, certify_settings = read_task("axis shrink", arguments, ShrinkSettings)
    at_least(settings, seed=0, index=0)
    try_file(settings.json)
    scenario = _scenario(task, settings)
    failed = certify(scenario, task.horizon, certify_settings, task.embodiment, adversary=attacked).certificate.failed
    where = Name(task.name, settings.split, settings.index, scenario.id)
    if failed is None:
        raise BadConfig(
            f"{where} passes every check of certify={certify_settings.name}; give a scenario that fails one"
        )
    say(f"{where} fails {failed.name}: {failed.reason}")
    scales = {name: scale(task, name) for name in task.known}
    with ProgressBar(err, f"shrink {where}", None) as progress_bar:
        found = shrink(
            values(scenario),
            centre(task.training),
            scales,
            _same_failure(task, certify_settings, failed, progress_bar.show),
        )
    out.print(shrunk_table(found, {name: p.unit for name, p in task.known.items()}))
    nearest = with_values(scenario, found.values)
    say(f"{len(found.causes)} of {len(task.known)} parameters matter; {found.tries} scenarios were judged")
    if settings.json:
        write_json(
            settings.json,
            {"check": failed.name, "reason": failed.reason, "tries": found.tries, "values": values(nearest)}
            | {"causes": [asdict(cause) for cause in found.causes]},
        )
    return OK


def _scenario(task: Task, settings: ShrinkSettings) -> Scenario:
    """The scenario of an index: the first feasible try, or the first try if none is feasible."""
    tries = list(task.proposals(settings.split, settings.seed, settings.index, task.design(settings.sampler)))
    return (tries[0] if tries[-1].refutation else tries[-1]).scenario


def _same_failure(
    task: Task, certify_settings: CertifySettings, failed: Check, progress: Callable[[int, str], None]
) -> Callable[[Mapping[str, Value]], bool]:
    """A function that says whether a scenario fails the same check, and no cheaper check before it."""
    start, judged = task.family(), 0

    def fails(candidate: Mapping[str, Value]) -> bool:
        nonlocal judged
        judged += 1
        progress(judged, "scenarios judged")
        scenario = with_values(start, candidate)
        certificate = certify(
            scenario, task.horizon, certify_settings, task.embodiment, failed.name, attacked
        ).certificate
        checks = [c for c in certificate.checks if c.passed is False]
        return bool(checks) and checks[0].name == failed.name

    return fails
