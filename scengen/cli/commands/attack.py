"""search with the built-in adversary for unintended ways to reach a goal"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path

from ... import compose
from ...attack.adversary import LEAKS, TIERS
from ...attack.campaign import AttackReport, AttackSettings, Subject, attack, begun, certified, check_budget, drawn
from ...attack.evidence import spelled
from ...attack.priors import Prior
from ...errors import BadConfig
from ...ood.analysis.leaks import Leaks, leaks
from ...ood.analysis.redraw import task_of
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task import Task
from ...samplers.task_files import search_path
from ...work.targets import try_file, try_folder
from ..tables import attack_table
from . import DECLINED, FAILED, OK, Arguments, err, out, say, say_begun, warn, write_json
from .settings import read

LEAK_DRAWS = 200
"""Number of draws whose observations are searched for hidden parameters."""


def command(arguments: Arguments) -> int:
    settings = read("attack", arguments, AttackSettings)
    settings.check()
    if settings.tiers is not None and not settings.tiers:
        raise BadConfig(f"tiers = []; an attack without tiers finds nothing; give some of {', '.join((*TIERS, LEAKS))}")
    try_file(settings.json)
    try_folder(settings.to)
    task, pool = _task(arguments, settings)
    check_budget("budget", settings.budget, settings.n if pool is None else min(settings.n, len(pool)))
    folder = Path(settings.to or f"generated/attack/{task.name}")
    try_folder(folder)
    say_begun(begun(folder), "attacked scenarios", folder, settings.fresh)
    plain = asdict(_leaks(task, settings)) if settings.observed else None
    if not settings.chosen:
        if settings.json:
            write_json(settings.json, {"task": task.name, "leaks": plain})
        return OK
    subjects = _subjects(task, pool, settings)
    with ProgressBar(err, f"attack {task.name}", len(subjects), settings.workers) as progress_bar:

        def progress(done: int, hits: int) -> None:
            progress_bar.show(done, f"{hits} hits")

        report = attack(task, subjects, settings, folder, progress)
    out.print(attack_table(report))
    names = {one.scenario.id: str(one.name) for one in subjects}
    for line in _remarks(report, names):
        say(line)
    if fair := len(report.hits) - len(report.refuting):
        say(f"{fair} hits have every contact of the oracle: they refute nothing, and show how easy the task is")
    for hit in report.refuting:
        warn(f"REFUTED {names[hit.scenario]} {hit}; {hit.name}.npz")
    above = list(report.above_limits(subjects[0].scenario.answer()))
    for line, shown in above:
        warn(f"TOO EASY {line}" if shown else f"perhaps too easy: {line}; raise n= or budget=")
    easy = [line for line, shown in above if shown]
    cost = f"{report.cpu / max(report.rollouts, 1):.2f} CPU s per rollout"
    say(f"{report.rollouts} rollouts on {len(report.scenarios)} scenarios, {cost}; hits are in {folder}")
    if settings.json:
        write_json(settings.json, {**report.plain(), "too_easy": easy, "leaks": plain})
    return FAILED if report.refuting or easy else DECLINED if report.lost else OK


def _leaks(task: Task, settings: AttackSettings) -> Leaks:
    """Search observations for hidden parameters, and print those that are revealed."""
    with ProgressBar(err, f"observe {task.name}", LEAK_DRAWS, settings.workers) as progress_bar:
        found = leaks(task, settings.split, LEAK_DRAWS, settings.seed, settings.workers, progress_bar.show)
    what = f"{len(found.hidden)} hidden parameters in {found.draws} draws of {found.split}"
    say(f"{what}: observations reveal {len(found.found)}")
    for leak in found.found:
        warn(f"LEAK {leak.stream} reveals {leak.parameter}: explained variance {leak.explained:.2f} on held-out draws")
    return found


def _task(arguments: Arguments, settings: AttackSettings) -> tuple[Task, Pool | None]:
    """The task to attack, and the pool that it was given by, if any.

    Raises:
        ScengenError: neither a task nor a pool was given, or both.
    """
    name, others = compose.chosen_task("attack", arguments), [a for a in arguments if a.startswith("task.")]
    if (name is None) == (settings.pool is None):
        raise BadConfig("attack needs either task=NAME or pool=FOLDER; see scengen attack --help")
    if name is not None:
        return compose.load_task(name, [*search_path(arguments), *others]), None
    pool = Pool.open(str(settings.pool)).check()
    return task_of(pool, search_path(arguments)), pool


def _subjects(task: Task, pool: Pool | None, settings: AttackSettings) -> Sequence[Subject]:
    """The scenarios to attack: draws of the task, or the first ones of the pool.

    Raises:
        ScengenError: there is no scenario to attack.
    """
    if pool is None:
        return drawn(task, settings.split, settings.n, settings.seed)
    if not (subjects := certified(task, islice(pool.rows(), settings.n))):
        raise BadConfig(f"{pool.folder} holds no scenario to attack; choose another pool")
    return subjects


def _remarks(report: AttackReport, names: Mapping[str, str]) -> list[str]:
    """Lines about fixed answers, shortcuts that were not tried, and attacks that did not finish."""
    counts = Counter((one.name, one.raw, one.reason) for one in report.untried)
    untried = [
        f"not tried {times} times: {name} ({spelled(raw)}): {reason}" for (name, raw, reason), times in counts.items()
    ]
    lost = [f"unknown: the attack on {names[id_]} {why}" for id_, _, why in (one.partition(" ") for one in report.lost)]
    return [*map(_fixed_answers, report.priors), *_resumed(report), *untried, *lost]


def _resumed(report: AttackReport) -> Iterator[str]:
    """A line about filtered hits whose actions the filter cannot give from the start of the episode."""
    filtered = [hit for hit in report.hits if not hit.raw]
    if count := sum(hit.resumed for hit in filtered):
        why = "where the filter started at rest; filtered from the start, their actions would be others"
        yield f"{count} of {len(filtered)} filtered hits continue from a state of the witness, {why}"


def _fixed_answers(prior: Prior) -> str:
    values = ", ".join(f"{value:.3g}" for value in prior.values)
    message = f"fixed answers {values}: right in {prior.fitted:.1%} of the draws where they were fitted"
    if prior.fresh is None or prior.bound is None:
        return message
    return f"{message}, in {prior.fresh:.1%} (< {prior.bound:.1%}) of {prior.draws} others"
