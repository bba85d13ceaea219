"""test whether certification has changed a pool's distribution"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from ...ood.analysis.bias import Bias, acceptance_map, bias
from ...ood.analysis.redraw import MAX_REDRAWN, Redrawn, redrawn, sampled_indices
from ...ood.analysis.space import measured
from ...ood.analysis.tables import bias_table, map_table
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...work.targets import try_file
from . import OK, Arguments, err, filled, one, out, say, write_json
from .settings import read


@dataclass(frozen=True)
class AuditSettings:
    """Settings of `scengen report audit`; conf/command/report_audit.yaml explains them."""

    pool: str | list[str]
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("report audit", arguments, AuditSettings)
    try_file(settings.json)
    pool = filled(one(settings.pool))
    with ProgressBar(err, f"draw {pool.folder} again", min(pool.manifest.indices, MAX_REDRAWN)) as progress_bar:
        drawn = redrawn(pool, lambda done, total: progress_bar.show(done), search_path(arguments))
    if sampled_indices(pool):
        say(f"a sample: {sampled_indices(pool)}")
    feasible = [p for p in drawn if p.feasible]
    stages = {
        "feasible": ("feasible draws against all draws: losses to the constraints of the family", drawn),
        "certified": ("certified against feasible draws: losses to the certifier", feasible),
    }
    result = {}
    for name, (title, among) in stages.items():
        table, accepted = _table(among), np.array([getattr(p, name) for p in among])
        found = bias(table, accepted)
        if not accepted.all():
            out.print(bias_table(found, f"{title} ({found.accepted} of {found.proposed})"))
            drawn_ones = [m.name for m in found.marginals if m.name in among[0].quantiles]  # features follow from these
            if len(drawn_ones) > 1:
                out.print(map_table(acceptance_map((drawn_ones[0], drawn_ones[1]), table, accepted)))
        result[name] = {**asdict(found), "flagged": found.flagged, "effective": found.effective}
        say(_verdict(name, found))
    if settings.json:
        write_json(settings.json, result)
    return OK


def _table(among: Sequence[Redrawn]) -> dict[str, np.ndarray]:
    """Parameters and features of draws, by name."""
    rows = [measured(p.scenario) for p in among]
    return {name: np.array([row[name] for row in rows], float) for name in rows[0]}


def _verdict(stage: str, found: Bias) -> str:
    """The result of a stage as text."""
    if found.accepted == found.proposed:
        return f"{stage}: all of them, so there is no selection bias"
    found_in = f"selection bias in {', '.join(found.flagged)}" if found.flagged else "no sign of selection bias"
    return (
        f"{stage}: {found_in}; along the worst marginal the {found.accepted} are worth {found.effective:.1f} "
        "unbiased ones"
    )
