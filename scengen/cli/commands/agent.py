"""let a model understand, plan and act in certified scenarios, graded by code"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from rich.table import Table

from ...agents.acting import RETRIES
from ...agents.comparison import compared, files
from ...agents.page import TITLES, write_page
from ...agents.prices import prices
from ...agents.questioning import ACT, PLAN, UNDERSTAND
from ...agents.replies import kind_of
from ...agents.runner import AgentSettings, Outcome, earlier, prompts, run
from ...agents.tables import agreement, executed_lines, lines, lost_in_twins, markdown, plan_errors, sight_lines
from ...errors import BadConfig
from ...evaluate.table import TableLine, cells, plain
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...work.targets import write
from . import FAILED, OK, Arguments, err, out, remark, say, write_json
from .settings import read

REPORT = "report"
"""Word after the command that grades an earlier run again."""


def command(arguments: Arguments) -> int:
    if arguments and arguments[0] == REPORT:
        return _report(arguments[1:])
    settings = read("agent", arguments, AgentSettings)
    if settings.dry:
        return _dry(settings, search_path(arguments))
    return _shown(settings, _run(settings, search_path(arguments)))


def _run(settings: AgentSettings, search: Sequence[str] = (), ask: bool = True) -> Outcome:
    with ProgressBar(err, f"agent {settings.model}", 1) as progress_bar:
        return run(settings, progress_bar.of, ask, search)


def _report(arguments: Arguments) -> int:
    """Grade an earlier run again from its journal."""
    given = {each.partition("=")[0]: each.partition("=")[2] for each in arguments}
    if len(given) != len(arguments) or not given.get("to") or set(given) - {"to", "runs", "prices"}:
        one, several = "to=FOLDER, the folder of a run", "runs=FOLDER,FOLDER to=FOLDER (and prices=FILE) for several"
        raise BadConfig(f"scengen agent report needs {one}; or {several}")
    folder = Path(given["to"])
    if "runs" in given:
        return _compared(folder, given["runs"].strip("[]").split(","), given.get("prices"))
    if "prices" in given:
        raise BadConfig("prices= belongs to runs=; a run has its own: scengen agent prices=...")
    settings = replace(earlier(folder), to=str(folder), dry=False)
    return _shown(settings, _run(settings, ask=False))


def _compared(folder: Path, runs: Sequence[str], given: str | None) -> int:
    """Print and write the tables of several runs."""
    found = compared([Path(run) for run in runs], given)
    for grid in found:
        shown = Table(title=grid.title, title_justify="left")
        for name in grid.head:
            shown.add_column(name, overflow="fold")
        for row in grid.texts:
            shown.add_row(*row)
        out.print(shown)
    for name, content in files(found).items():
        write(folder / name, content)
    say(f"wrote table.md, table.tex and report.html into {folder}")
    return OK


def _shown(settings: AgentSettings, found: Outcome) -> int:
    """Print and write the tables of a run."""
    folder, printed = settings.folder, {}
    if not found.results:
        raise BadConfig(f"nothing was graded: {found.stopped or found.refused[-1]}")
    for stage in sorted({result["stage"] for result in found.results}):
        rows, title = lines(found.results, stage), f"{settings.title}: {TITLES[stage]}, right [%]"
        _print(title, rows)
        sight, unseen = sight_lines(found.results, found.priors) if stage == UNDERSTAND else ([], [])
        if sight:
            _, _, inside, outside = sight[-1].cells
            say(f"beyond the best answers without a look [%]: ID {inside}, OOD {outside}")
        if unseen:
            say(f"no question needs a look: {', '.join(unseen)}")
        lost, known = lost_in_twins(found.results, stage)
        if known:
            say(f"right in training, not in the twin: {lost} of {known}")
        write(folder / f"table-{stage}.md", markdown(title, rows))
        printed[stage] = {"table": plain(rows), "lost_in_twins": [lost, known]}
        if stage == UNDERSTAND:
            printed[stage]["beyond_blind"] = [asdict(line) for line in sight]
        if stage == PLAN and (agreed := agreement(found.results)):
            printed[stage] |= {"executed": plain(executed_lines(found.results)), "agreement": asdict(agreed)}
            _show_executed(settings, found)
    if errors := plan_errors(found.results):
        say("plans with errors: " + ", ".join(f"{kind} {count}" for kind, count in sorted(errors.items())))
    formats = [(r["stage"], kind_of(r["format_error"])) for r in found.results if r["format_error"]]
    for (stage, kind), count in sorted(Counter(formats).items()):
        say(f"{TITLES[stage]}: {count} replies had no valid form ({kind})")
    if misread := sum(result["grades"]["refused"] for result in found.results if result["stage"] == ACT):
        say(f"{TITLES[ACT]}: {misread} calls had no valid form; after {RETRIES + 1} of them in a row the robot holds")
    for note, count in sorted(found.notes.items()):
        say(f"{note} ({count} calls)")
    versions = {result["task"]: result["task_version"] for result in found.results}
    read_as = {"strict": settings.strict, "notes": dict(found.notes), "refused": len(found.refused)}
    played = {"model": settings.model, "perturbation": str(settings.perturbation)}
    about = {**played, "task_versions": versions, **read_as, "stages": printed}
    write_json(str(folder / f"table-{settings.stage}.json"), about)
    page = write_page(folder, found.results, settings.title, found.priors)
    cost = "" if found.cost is None else f", cost {found.cost:.4g}"
    say(f"{found.calls} new calls, {found.tokens} tokens{cost}; wrote {page} and its tables")
    if found.refused:
        count = len(found.refused)
        remark(f"{count} scenarios are in no table, as requests were refused; the last one: {found.refused[-1]}")
    if found.stopped:
        remark(f"stopped early: {found.stopped}")
    return FAILED if found.stopped or found.refused else OK


def _show_executed(settings: AgentSettings, found: Outcome) -> None:
    """Print and write what became of the plans of stage 2."""
    rows, agreed = executed_lines(found.results), agreement(found.results)
    assert agreed
    if rows:
        title = f"{settings.title}: {TITLES[PLAN]} carried out, goal reached [%]"
        _print(title, rows)
        write(settings.folder / "table-2-executed.md", markdown(title, rows))
        for what, reached, all_ in (
            ("right", agreed.right_reached, agreed.right),
            ("wrong", agreed.wrong_reached, agreed.wrong),
        ):
            if all_:
                say(f"{what} plans that reach the goal: {reached} of {all_}")
    if agreed.no_moves:
        say(f"not carried out, as their sub-goals have no moves: plans of {', '.join(agreed.no_moves)}")


def _print(title: str, rows: Sequence[TableLine]) -> None:
    """Print a table."""
    shown = Table("", "split", "ID", "OOD", "difference", title=title, title_justify="left")
    for row in rows:
        shown.add_row(*cells(row))
    out.print(shown)


def _dry(settings: AgentSettings, search: Sequence[str]) -> int:
    """Write all first prompts and estimate the cost; nothing is asked."""
    count, tokens = 0, (0, 0)
    for work, turns, (asked, answered) in prompts(settings, search):
        name = f"{work.task.name}-{work.row.split}-{work.row.index}-{count}"
        text = "\n".join(f"--- {turn.role}, {len(turn.pictures)} pictures\n{turn.text}" for turn in turns)
        write(settings.folder / "prompts" / f"{name}.txt", text + "\n")
        for number, picture in enumerate(picture for turn in turns for picture in turn.pictures):
            write(settings.folder / "prompts" / f"{name}-{number}.jpg", picture)
        count, tokens = count + 1, (tokens[0] + asked, tokens[1] + answered)
    per = {1: 1, 2: 3, 3: 24 * (1 + settings.explore)}[settings.stage]
    say(f"{count} prompts in {settings.folder / 'prompts'}; nothing was asked")
    total = f"{per * tokens[0]} tokens of prompts, {per * tokens[1]} of answers"
    known = prices(settings.prices, settings.model, settings.max_cost)
    cost = f", cost {known.of((per * tokens[0], per * tokens[1])):.4g}" if known else ""
    say(f"estimate without repeated attempts: {count * per} calls, {total}{cost}")
    return OK
