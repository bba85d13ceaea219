"""The page of a task as Markdown: its family and task file, its figures in the ledger, and its films, if they are made.

The documentation shows all of it, and the web site its sections.
"""

import html
import inspect
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from ..agents import facts
from ..errors import BadConfig
from ..evidence import ledger
from ..evidence.behaviour import Behaviour
from ..measures import figures
from ..samplers import task_files
from ..samplers.axis import spell
from ..samplers.dists import Fixed
from ..samplers.split import ID
from ..samplers.task import Task
from .exhibit import FRAMES, Exhibit, Pair

SCENARIO = 0
"""Index of the training scenario that is shown."""
Figures = Mapping[str, Mapping[str, str]]
"""Figures of each axis by title."""
PLAYED = f"{ID} 0 "
"""Beginning of the names of the stored rollouts that are shown: those in the first training draw."""


def page(task: Task, measured: Figures, films: Path | None = None) -> str:
    """The page of a task, Markdown.

    Args:
        task: the task.
        measured: figures of its axes, as from `measures.figures.axes`.
        films: folder that `scengen site` has written, relative to the pages.
    """
    made = Exhibit.read(films / "tasks" / task.name) if films else None
    return "\n".join(
        [
            *_story(task),
            *_films(made),
            *_facts(task),
            *_heading("Means", _means(task), "means"),
            *_heading("Sub-goals and questions", understanding(task), "agents"),
            *_heading("Parameters", parameters(task)),
            *_axes(task, made, measured),
            *_heading("Certification", certification(task), "axes"),
            *_plans(task),
            *_heading("Attacks", attacks(task), "attacks"),
            *_heading("Trained policies", policies(task), "baselines"),
        ]
    )


def _heading(title: str, section: Iterable[str], about: str = "") -> Iterator[str]:
    """A section below its heading, with a link to the page that explains it."""
    link = (f"[What this section shows](../{about}.md).", "") if about else ()
    yield from (f"## {title}", "", *section, *link)


def _story(task: Task) -> Iterator[str]:
    """Docstring of the family's module below a short title. Its sketch is indented, so Markdown shows it as it is."""
    told = inspect.getdoc(inspect.getmodule(task.family)) or ""
    title, _, rest = told.partition("\n")
    yield from (f"# {task.name}", "", f"**{title.rstrip('.')}.**", "", rest.strip("\n"), "")
    yield from (f"![Witness of a training scenario in {FRAMES} pictures]({task.name}.jpg)", "")
    yield from ("*A solution of a training scenario, from the upper left to the lower right.*", "")


def _means(task: Task) -> Iterator[str]:
    """What the intended solution does, and without which a goal does not count under strict rules."""
    means = task.nominal.means()
    yield "A goal counts under strict rules if all of these are true:" if means else "The family states none."
    yield from ("", *(f"* {name}" for name in means), "")


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


def understanding(task: Task, search: Sequence[str] = ()) -> Iterator[str]:
    """Sub-goals in one of the right orders, and the questions with their answers in the scenario that is shown.

    Nothing for a task without a sheet of facts.
    """
    try:
        sheet = facts.load(task, search)
    except BadConfig:
        return
    told = task.draw(ID, 0, SCENARIO).scenario.facts()
    rows = []
    for name, subgoal in sheet.order.items():
        before = [f"`{one}`" for one, giver in sheet.order.items() if set(giver.gives) & set(subgoal.needs)]
        notes = [note for note in ("senses", "optional", "repeats") if getattr(subgoal, note)]
        rows.append((f"`{name}`", subgoal.outcome, ", ".join(before), ", ".join(notes)))
    yield from _table(("sub-goal", "outcome", "after", "notes"), rows)
    yield "Questions for a model, and the answers in the training scenario of the picture:"
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


def parameters(task: Task) -> Iterator[str]:
    """Parameters with their units, bounds and ranges in training."""
    rows = []
    for p in task.known.values():
        dist = task.training[p.name]
        spread = "" if dist == Fixed(p.nominal) else spell(dist)
        hidden = ", hidden" if p.hidden else ""
        rows.append((f"`{p.name}`{hidden}", p.unit, f"{p.low:g} to {p.high:g}", f"{p.nominal:g}", spread))
    yield from _table(("parameter", "unit", "bounds", "nominal", "training"), rows)
    yield "If *training* is empty, the parameter has its nominal value in training."
    yield ""


def _axes(task: Task, made: Exhibit | None, measured: Figures) -> Iterator[str]:
    """A section for every axis: its distributions, its pictures compared with training, and its figures."""
    yield from _heading("OOD axes", (), "axes")
    pairs = {pair.axis: pair for pair in made.pairs} if made else {}
    for axis in task.axes.values():
        yield from (f"### {axis.name}", "", " ".join(axis.why.split()), "")
        for name, dist in axis.replace.items():
            yield f"* `{name}`: {spell(task.training[name])} in training, {spell(dist)} here"
        yield f"* source: {axis.source or 'none given'}"
        yield ""
        if axis.name in pairs:
            yield from _pair(task, pairs[axis.name])
        cells = measured[axis.name]
        yield from (f"<details><summary>Measured: {html.escape(cells['verdict'])}</summary>", "")
        yield from (*_table(("figure", "value"), cells.items()), "</details>", "")


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


def certification(task: Task) -> Iterator[str]:
    """Certification of all splits."""
    found = figures.certified(task.name)
    splits = [split for split in (ID, *task.axes) if split in found]
    if not splits:
        yield from (f"Certification: {ledger.not_measured(task.name)}.", "")
        return
    rows = [(split, *figures.certification(task.name, found[split])) for split in splits]
    yield from _table(("split", *figures.CERTIFIED), rows)


def _plans(task: Task) -> Iterator[str]:
    """How shortcuts and ablations end in the first training draw of the stored behaviour."""
    played = Behaviour.read(task_files.behaviour_file(task.name)).rollouts
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


def attacks(task: Task) -> Iterator[str]:
    """Results of the adversary."""
    if report := figures.attack(task.name):
        cells = dict(zip(figures.ATTACK, figures.attack_cells(report), strict=True))
        yield from (f"{cells['refuting']} ways around the task in {cells['rollouts']} rollouts:", "")
        yield from _table(("tier", "hits"), cells.items())
    else:
        yield from (f"The adversary has not attacked this task: {ledger.not_measured(task.name)}.", "")


def policies(task: Task) -> Iterator[str]:
    """Success of trained policies."""
    if rows := [*figures.policies(task)]:
        yield from _table(figures.POLICY, rows)
    else:
        yield from (f"Trained policies: {ledger.not_measured(task.name)}.", "")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    yield figures.table(head, rows)
