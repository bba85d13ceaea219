"""The page of a task: its family and task file, its figures in the ledger, and its films, if they are made."""

import html
import inspect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path

import all_axes
import attack_all
import baselines_page
from task_pictures import FRAMES, SCENARIO

from scengen import load_task
from scengen.agents import facts
from scengen.evidence import ledger
from scengen.evidence.behaviour import Behaviour
from scengen.samplers import task_files
from scengen.samplers.axis import spell
from scengen.samplers.dists import Fixed
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.site.exhibit import Exhibit, Pair

PLAYED = f"{ID} 0 "
"""Beginning of the names of the stored rollouts that are shown: those in the first training draw."""


def page(name: str, films: Path | None = None) -> str:
    """The page of a task, Markdown.

    Args:
        name: the task.
        films: folder that `scengen site` has written, as it lies beside the pages.
    """
    task = load_task(name)
    made = Exhibit.read(films / "tasks" / name) if films else None
    return "\n".join(
        [
            *_story(task),
            *_films(made),
            *_facts(task),
            *_understanding(task),
            *_parameters(task),
            *_axes(task, made),
            *_certified(task),
            *_plans(task),
            *_attacks(task),
            *_policies(task),
        ]
    )


def _story(task: Task) -> Iterator[str]:
    """Docstring of the family's module below a short title. Its sketch is indented, so Markdown shows it as it is."""
    told = inspect.getdoc(inspect.getmodule(task.family)) or ""
    title, _, rest = told.partition("\n")
    yield from (f"# {task.name}", "", f"**{title.rstrip('.')}.**", "", rest.strip("\n"), "")
    yield from (f"![Witness of a training scenario in {FRAMES} pictures]({task.name}.jpg)", "")
    yield from ("*A solution of a training scenario, from the upper left to the lower right.*", "")


def _films(made: Exhibit | None) -> Iterator[str]:
    """The player of the films, with a link for each of them."""
    if made is None or not made.clips:
        return
    player = "../films/player.html?film="
    links = (
        f'<a href="{player}{html.escape(clip.address)}" target="film">{html.escape(_title(clip.title))}</a>'
        f" ({html.escape(clip.outcome)}, {clip.seconds:.1f} s)"
        for clip in made.clips
    )
    yield from ("## Films in three dimensions", "")
    yield f"<p>Drag to turn, scroll or pinch to come closer: {' · '.join(links)}.</p>"
    first = player + html.escape(made.clips[0].address)
    yield f'<iframe class="film" name="film" title="Film" loading="lazy" src="{first}"></iframe>'
    yield ""


def _title(clip: str) -> str:
    return "a solution" if clip == "witness" else f"a shortcut, {clip.replace('_', ' ')}"


def _facts(task: Task) -> Iterator[str]:
    yield f"> {task.instruction}"
    yield ""
    yield f"Paper: {task.code}, category {task.category}. Version {task.version}."
    yield f"Time limit {task.horizon:g} s. Robot: `{task.embodiment}`."
    yield f"Family: `{task.family.__module__}.{task.family.__name__}`; distributions: `conf/task/{task.name}.yaml`."
    yield ""


def _understanding(task: Task) -> Iterator[str]:
    """Sub-goals in one of the right orders, and the questions with their answers in the scenario that is shown."""
    sheet, told = facts.load(task), task.draw(ID, 0, SCENARIO).scenario.facts()
    yield from ("## Sub-goals and questions", "")
    rows = []
    for name, subgoal in sheet.order.items():
        before = [f"`{one}`" for one, giver in sheet.order.items() if set(giver.gives) & set(subgoal.needs)]
        notes = [note for note in ("senses", "optional", "repeats") if getattr(subgoal, note)]
        rows.append((f"`{name}`", subgoal.outcome, ", ".join(before), ", ".join(notes)))
    yield from _table(("sub-goal", "outcome", "after", "notes"), rows)
    yield "[Questions for a model](../agents.md), and the answers in the training scenario of the picture:"
    yield ""
    rows = []
    for name, question in sheet.facts.items():
        rows.append((question.kind, facts.spoken_question(name, question), _answer(name, question, told)))
    yield from _table(("kind", "question", "answer"), rows)


def _answer(name: str, question: facts.Question, told: Mapping[str, float | str]) -> str:
    if question.kind == "hidden state":
        return "cannot be seen"
    if name in told:
        value = told[name]
        return value if isinstance(value, str) else f"{value:.3g} {question.unit}".removesuffix(" 1")
    if question.shortcut:
        return question.stuck or f"the reason of `{question.shortcut}` below"
    return question.right if isinstance(question.right, str) else ", ".join(question.right)


def _parameters(task: Task) -> Iterator[str]:
    yield from ("## Parameters", "")
    rows = []
    for p in task.known.values():
        dist = task.training[p.name]
        spread = "" if dist == Fixed(p.nominal) else spell(dist)
        hidden = ", hidden" if p.hidden else ""
        rows.append((f"`{p.name}`{hidden}", p.unit, f"{p.low:g} to {p.high:g}", f"{p.nominal:g}", spread))
    yield from _table(("parameter", "unit", "bounds", "nominal", "training"), rows)
    yield "If *training* is empty, the parameter has its nominal value in training."
    yield ""


def _axes(task: Task, made: Exhibit | None) -> Iterator[str]:
    """A section for every axis: its distributions, its pictures beside training, and its figures."""
    yield from ("## OOD axes", "")
    pairs = {pair.axis: pair for pair in made.pairs} if made else {}
    measured = all_axes.of_task(task.name)
    for axis in task.axes.values():
        yield from (f"### {axis.name}", "", " ".join(axis.why.split()), "")
        for name, dist in axis.replace.items():
            yield f"* `{name}`: {spell(task.training[name])} in training, {spell(dist)} here"
        yield f"* source: {axis.source or 'none given'}"
        yield ""
        if axis.name in pairs:
            yield from _pair(task, pairs[axis.name])
        cells = measured[axis.name]
        yield from _details(f"Measured: {cells['verdict']}", ("figure", "value"), cells.items(), "axes")


def _pair(task: Task, pair: Pair) -> Iterator[str]:
    """Pictures of a training scenario and of its twins on an axis."""
    pictures = [("training", pair.twin), *((step.split, step.picture) for step in pair.steps)] if pair.twin else []
    if pictures:
        figures = (
            f'<figure><img src="../films/tasks/{task.name}/{name}" alt="{html.escape(split)}" loading="lazy">'
            f"<figcaption>{html.escape(split)}</figcaption></figure>"
            for split, name in pictures
        )
        yield from (f'<div class="pair">{"".join(figures)}</div>', "")


def _certified(task: Task) -> Iterator[str]:
    """Certification of all splits."""
    yield from ("## Certification", "")
    found = ledger.latest("certified", task.name)
    splits = [split for split in task_files.splits(task.name) if split in found]
    if not splits:
        yield from (f"Certification: {ledger.not_measured(task.name)}.", "")
        return
    rows = [(split, *all_axes.certification(task.name, found[split])) for split in splits]
    yield from _table(("split", *all_axes.CERTIFIED), rows)
    yield from ("[What the columns mean](../axes.md).", "")


def _plans(task: Task) -> Iterator[str]:
    """How shortcuts and ablations end in the first training draw of the stored behaviour."""
    played = _behaviour(task.name).rollouts
    yield from ("## Shortcuts that must fail", "")
    rows = [
        (f"`{name}`", "raw" if raw else "filtered", played[f"{PLAYED}shortcut {name}{raw}"][0])
        for name in dict.fromkeys(one.split(",")[0] for one in _named(played, "shortcut"))
        for raw in ("", ", raw")
        if f"{PLAYED}shortcut {name}{raw}" in played
    ]
    yield from _table(("shortcut", "actions", "outcome"), rows)
    yield from ("## Ablations in which the witness must fail", "")
    rows = [(f"`{name}`", played[f"{PLAYED}ablation {name}"][0]) for name in _named(played, "ablation")]
    yield from _table(("ablation", "outcome"), rows) if rows else ("This task has none.", "")


def _named(played: Iterable[str], kind: str) -> list[str]:
    """Names of the stored rollouts of a kind."""
    start = f"{PLAYED}{kind} "
    return [name.removeprefix(start) for name in played if name.startswith(start)]


@cache
def _behaviour(task: str) -> Behaviour:
    return Behaviour.read(task_files.shipped("conf") / "behaviour" / f"{task}.json")


def _attacks(task: Task) -> Iterator[str]:
    """Results of the adversary."""
    yield from ("## Attacks", "")
    cells = attack_all.of_task(task.name)
    if cells:
        told = f"{cells['refuting']} ways around the task in {cells['rollouts']} rollouts"
        yield from _details(told, ("tier", "hits"), cells.items(), "attacks")
    else:
        yield from (f"The adversary has not attacked this task: {ledger.not_measured(task.name)}.", "")


def _policies(task: Task) -> Iterator[str]:
    """Success of trained policies."""
    yield from ("## Trained policies", "")
    table = baselines_page.of_task(task.name)
    if table:
        yield from (table, "[What the columns mean](../baselines.md).", "")
    else:
        yield from (f"Trained policies: {ledger.not_measured(task.name)}.", "")


def _details(summary: str, head: tuple[str, str], rows: Iterable[tuple[str, str]], about: str) -> Iterator[str]:
    """A table that opens when its summary is clicked."""
    yield from (f"<details><summary>{html.escape(summary)}</summary>", "")
    yield from _table(head, rows)
    yield from (f"[What the figures mean](../{about}.md).", "", "</details>", "")


def _table(head: tuple[str, ...], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    yield from (f"| {' | '.join(row)} |" for row in rows)
    yield ""
