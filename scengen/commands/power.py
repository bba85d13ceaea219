"""the smallest drop in success that a number of seeds and rollouts can tell from chance"""

from dataclasses import asdict, dataclass

from ..analysis.tables import plan_table
from ..config import read, typed
from ..errors import BadConfig
from ..evaluate.power import Plan, seeds_for
from . import OK, Arguments, out, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen plan`; meanings stand in conf/command/power.yaml."""

    seeds: int = 20
    rollouts: int = 5
    success: float = 0.7
    drop: float | None = None
    correlation: float = 0.5
    twins: float = 0.0
    comparisons: int = 1
    significance: float = 0.05
    power: float = 0.8
    json: str | None = None


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("plan", arguments).settings)
    if not 0 < settings.success <= 1:
        raise BadConfig(f"success = {settings.success:g}; it must lie above 0 and at most at 1")
    if settings.drop is not None and not 0 < settings.drop <= settings.success:
        raise BadConfig(f"drop = {settings.drop:g}; it must lie above 0 and at most at success = {settings.success:g}")
    asked = {k: v for k, v in asdict(settings).items() if k not in ("success", "drop", "json")}
    plan = Plan(**asked)
    smallest = plan.smallest_drop(settings.success)
    out.print(plan_table(plan))
    found = "no drop, not even to 0," if smallest is None else f"a drop of {smallest:.2f} or more"
    out.print(
        f"from {settings.success:g}, {found} is found with probability {plan.power:g}; "
        f"the {plan.seeds * plan.rollouts} rollouts count as {plan.effective:.0f} independent ones",
        highlight=False,
    )
    result = {**asked, "success": settings.success, "effective": plan.effective, "smallest_drop": smallest}
    if settings.drop is not None:
        needed = seeds_for(plan, settings.success, settings.drop)
        chance = plan.chance(settings.success, settings.success - settings.drop)
        told = "more than 100000 seeds" if needed is None else f"{needed} seeds"
        out.print(
            f"a drop of {settings.drop:g} is found with probability {chance:.2f}; for {plan.power:g} it takes {told}",
            highlight=False,
        )
        result |= {"drop": settings.drop, "chance": chance, "seeds_needed": needed}
    if settings.json:
        write_json(settings.json, result)
    return OK
