"""search with the built-in adversary for unintended ways to reach a goal"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from itertools import islice
from pathlib import Path

from .. import compose
from ..analysis.leaks import Leaks, leaks
from ..analysis.redraw import task_of
from ..attack.adversary import LEAKS, TIERS
from ..attack.campaign import AttackReport, AttackSettings, Subject, attack, certified, drawn
from ..attack.evidence import spelled
from ..attack.priors import Prior
from ..errors import BadConfig
from ..pictures.report import attack_table
from ..pool import Pool
from ..runs.progress import ProgressBar
from ..samplers.task import Task
from ..task_files import search_path
from ..work.targets import try_file, try_folder
from . import BAD_INPUT, FAILED, OK, Arguments, err, out, say, warn, write_json
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
    task, subjects = _subjects(arguments, settings)
    folder = Path(settings.to or f"generated/attack/{task.name}")
    try_folder(folder)
    told = _leaks(task, settings) if settings.observed else None
    if not settings.chosen:
        return OK
    with ProgressBar(err, f"attack {task.name}", len(subjects), settings.workers) as progress_bar:

        def progress(done: int, hits: int) -> None:
            progress_bar.show(done, f"{hits} hits")

        report = attack(task, subjects, settings, folder, progress)
    out.print(attack_table(report))
    names = {one.scenario.id: str(one.name) for one in subjects}
    for line in _remarks(report, names):
        say(line)
    for hit in report.refuting:
        warn(f"REFUTED {names[hit.scenario]} {hit}; {hit.name}.npz")
    cost = f"{report.cpu / max(report.rollouts, 1):.2f} CPU s per rollout"
    say(f"{report.rollouts} rollouts on {len(report.scenarios)} scenarios, {cost}; hits are in {folder}")
    if settings.json:
        write_json(settings.json, {**report.plain(), "leaks": asdict(told) if told else None})
    return FAILED if report.refuting else BAD_INPUT if report.lost else OK


def _leaks(task: Task, settings: AttackSettings) -> Leaks:
    """Search observations for hidden parameters, and print what they tell."""
    with ProgressBar(err, f"observe {task.name}", LEAK_DRAWS, settings.workers) as progress_bar:
        found = leaks(task, settings.split, LEAK_DRAWS, settings.seed, settings.workers, progress_bar.show)
    what = f"{len(found.hidden)} hidden parameters in {found.draws} draws of {found.split}"
    say(f"{what}: observations tell {len(found.found)}")
    for leak in found.found:
        warn(f"LEAK {leak.stream} tells {leak.parameter}: explained variance {leak.explained:.2f} on held-out draws")
    return found


def _subjects(arguments: Arguments, settings: AttackSettings) -> tuple[Task, Sequence[Subject]]:
    """The task and its scenarios to attack.

    Raises:
        ScengenError: neither a task nor a pool was given, or both, or there is no scenario to attack.
    """
    name, others = compose.chosen_task("attack", arguments), [a for a in arguments if a.startswith("task.")]
    if (name is None) == (settings.pool is None):
        raise BadConfig("attack needs either task=NAME or pool=FOLDER; see scengen attack --help")
    if name is not None:
        task = compose.load_task(name, [*search_path(arguments), *others])
        return task, drawn(task, settings.split, settings.n, settings.seed)
    pool = Pool.open(str(settings.pool)).check()
    task = task_of(pool, search_path(arguments))
    if not (subjects := certified(task, islice(pool.rows(), settings.n))):
        raise BadConfig(f"{pool.folder} holds no scenario to attack; choose another pool")
    return task, subjects


def _remarks(report: AttackReport, names: Mapping[str, str]) -> list[str]:
    """Lines about fixed answers, shortcuts that were not tried, and attacks that did not finish."""
    counts = Counter((one.name, one.raw, one.reason) for one in report.untried)
    untried = [
        f"not tried {times} times: {name} ({spelled(raw)}): {reason}" for (name, raw, reason), times in counts.items()
    ]
    lost = [f"unknown: the attack on {names[id_]} {why}" for id_, _, why in (one.partition(" ") for one in report.lost)]
    return [*map(_fixed_answers, report.priors), *untried, *lost]


def _fixed_answers(prior: Prior) -> str:
    values = ", ".join(f"{value:.3g}" for value in prior.values)
    told = f"fixed answers {values}: right in {prior.fitted:.1%} of the draws where they were fitted"
    if prior.fresh is None or prior.bound is None:
        return told
    return f"{told}, in {prior.fresh:.1%} (< {prior.bound:.1%}) of {prior.draws} others"
