"""whether certification has bent a pool's distribution: what was accepted against what was proposed"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from ..analysis.bias import Bias, acceptance_map, bias
from ..analysis.redraw import Proposed, proposed
from ..analysis.space import measured
from ..analysis.tables import bias_table, map_table
from ..config import read, typed
from ..pool import Pool
from ..runs.progress import Bar
from . import OK, Arguments, err, one, out, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen bias`; meanings stand in conf/command/bias.yaml."""

    pool: str | list[str] = ""
    json: str | None = None


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("bias", arguments).settings)
    pool = Pool.open(one(settings.pool)).check()
    with Bar(err, f"draw {pool.folder} again", pool.manifest["indices"]) as bar:
        drawn = proposed(pool, lambda done, total: bar.show(done))
    feasible = [p for p in drawn if p.feasible]
    stages = {
        "feasible": ("feasible draws against all draws: what the family's constraints leave out", drawn),
        "certified": ("certified against feasible draws: what the certifier leaves out", feasible),
    }
    result = {}
    for name, (title, among) in stages.items():
        table, accepted = _table(among), np.array([getattr(p, name) for p in among])
        found = bias(table, accepted)
        if not accepted.all():
            out.print(bias_table(found, f"{title} ({found.accepted} of {found.proposed})"))
            moved = [m.name for m in found.marginals if m.name in among[0].quantiles]  # features follow from these
            if len(moved) > 1:
                out.print(map_table(acceptance_map((moved[0], moved[1]), table, accepted)))
        result[name] = {**asdict(found), "flagged": found.flagged, "effective": found.effective}
        out.print(_verdict(name, found), highlight=False)
    if settings.json:
        write_json(settings.json, result)
    return OK


def _table(among: Sequence[Proposed]) -> dict[str, np.ndarray]:
    rows = [measured(p.scenario) for p in among]
    return {name: np.array([row[name] for row in rows], float) for name in rows[0]}


def _verdict(stage: str, found: Bias) -> str:
    if found.accepted == found.proposed:
        return f"{stage}: all of them, so that nothing was bent"
    bent = f"BENT in {', '.join(found.flagged)}" if found.flagged else "no sign of selection"
    return (
        f"{stage}: {bent}; along the worst marginal the {found.accepted} are worth {found.effective:.1f} unbiased ones"
    )
