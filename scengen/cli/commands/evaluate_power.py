"""compute the smallest drop in success that seeds and rollouts can detect"""

from dataclasses import asdict, dataclass

from ...errors import BadConfig
from ...evaluate.power import PowerAnalysis, seeds_for
from ...ood.analysis.tables import power_table
from ...runs.progress import ProgressBar
from ...work.targets import try_file
from . import OK, Arguments, err, out, say, write_json
from .settings import read


@dataclass(frozen=True)
class PowerSettings:
    """Settings of `scengen evaluate power`; conf/command/evaluate_power.yaml explains them."""

    seeds: int
    rollouts: int
    success: float
    drop: float | None
    correlation: float
    twins: float
    comparisons: int
    significance: float
    power: float
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("evaluate power", arguments, PowerSettings)
    if not 0 < settings.success <= 1:
        raise BadConfig(f"success = {settings.success:g}; it must lie in (0, 1]")
    if settings.drop is not None and not 0 < settings.drop <= settings.success:
        raise BadConfig(
            f"drop = {settings.drop:g}; it must lie in (0, {settings.success:g}], as success is {settings.success:g}"
        )
    try_file(settings.json)
    requested = {k: v for k, v in asdict(settings).items() if k not in ("success", "drop", "json")}
    analysis = PowerAnalysis(**requested)
    smallest = analysis.smallest_drop(settings.success)
    with ProgressBar(err, "simulated experiments", 1) as progress_bar:
        shown = power_table(analysis, progress_bar.of)
    out.print(shown)
    found = "no drop, not even to 0," if smallest is None else f"a drop of {smallest:.2f} or more"
    say(
        f"from {settings.success:g}, {found} is detected with probability {analysis.power:g}; "
        f"the {analysis.seeds * analysis.rollouts} rollouts count as {analysis.effective:.0f} independent ones"
    )
    result = {**requested, "success": settings.success, "effective": analysis.effective, "smallest_drop": smallest}
    if settings.drop is not None:
        needed = seeds_for(analysis, settings.success, settings.drop)
        chance = analysis.chance(settings.success, settings.success - settings.drop)
        count = "more than 100000 seeds" if needed is None else f"{needed} seeds"
        say(f"a drop of {settings.drop:g} is detected with probability {chance:.2f}; {analysis.power:g} needs {count}")
        result |= {"drop": settings.drop, "chance": chance, "seeds_needed": needed}
    if settings.json:
        write_json(settings.json, result)
    return OK
