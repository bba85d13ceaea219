"""The page of a run: tables, and for each scenario prompt, pictures, reply and grade side by side."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..evaluate.table import cells
from ..pictures.page import template
from ..work.targets import write
from .calls import CALLS, read_calls
from .priors import Prior
from .questioning import ACT, PLAN, UNDERSTAND
from .tables import GRADES, agreement, by_question, executed_lines, lines, lost_in_twins, plan_errors, sight_lines

TITLES = {UNDERSTAND: "Stage 1: understanding", PLAN: "Stage 2: plan", ACT: "Stage 3: action"}
"""Titles of the stages."""
SHOWN = 200
"""Largest number of results on a page; the files hold all."""


def write_page(
    folder: Path, results: Sequence[Mapping[str, Any]], model: str, priors: Mapping[str, Mapping[str, Prior]]
) -> Path:
    """Write `report.html` into the folder of a run; pictures stay in the same folder. Returns its path."""
    calls = read_calls(folder / CALLS)
    by_exam: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for call in calls:
        by_exam.setdefault(_key(call["about"]), []).append(call)
    stages = sorted({result["stage"] for result in results})
    page = template("agent.html").render(
        model=model,
        sections=[
            (TITLES[stage], [cells(line) for line in lines(results, stage)], lost_in_twins(results, stage))
            for stage in stages
        ],
        questions=by_question(results, priors),
        sight=sight_lines(results, priors),
        grades=GRADES,
        errors=plan_errors(results),
        executed=[cells(line) for line in executed_lines(results)],
        agreement=agreement(results),
        results=[
            (result, by_exam.get(_key({**result["about"], "stage": result["stage"]}), [])) for result in results[:SHOWN]
        ],
        left_out=max(0, len(results) - SHOWN),
        titles=TITLES,
        calls=len(calls),
        tokens=(sum(c["reply"]["tokens_in"] for c in calls), sum(c["reply"]["tokens_out"] for c in calls)),
        seconds=sum(c["reply"]["seconds"] for c in calls),
    )
    path = folder / "report.html"
    write(path, page)
    return path


def _key(about: Mapping[str, Any]) -> tuple[Any, ...]:
    named = tuple(about[name] for name in ("task", "split", "scenario", "temperature", "stage"))
    return *named, *(str(about.get(name, "")) for name in ("perturbation", "perturb_seed"))
