"""Writes docs/tasks: a page for each task, from its family, its task file and one certificate. `make docs`

`python tools/task_pages.py [task ...]` writes the pages of the named tasks only. docs/tasks.png shows the first
scene of all tasks. Pictures need OpenGL.
"""

import inspect
import io
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scengen import list_tasks, load_task
from scengen.agents import facts
from scengen.evidence import ledger
from scengen.pictures.film import Take, strip
from scengen.pictures.render import Picture, camera
from scengen.samplers.axis import spell
from scengen.samplers.dists import Fixed
from scengen.samplers.task import ID, Task
from scengen.validate.certify import Certified, certify
from scengen.validate.rebuilt import rebuild

FOLDER = Path("docs/tasks")
AXES = Path("docs/axes.md")
ATTACKS = Path("docs/attacks.md")
SCENARIO = 0
"""Index of the training scenario that is shown."""
FRAMES = 8
"""Number of pictures in a film strip."""
WIDTH = 320
"""Width of a picture in a film strip [pixels]."""
HEIGHT = 240
"""Height of a picture in a film strip [pixels]."""
OVERVIEW = Path("docs/tasks.png")
"""Picture that shows the first scene of all tasks."""
COLUMNS = 4
"""Scenes in a row of the overview."""
SMALL = (300, 225)
"""Width and height of a scene in the overview [pixels]."""
LABEL = 24
"""Height of the text under a scene in the overview [pixels]."""


def main(*names: str) -> None:
    """Write the pages."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or list_tasks():
        task = load_task(name)
        scenario = task.draw(ID, 0, SCENARIO).scenario
        certified = certify(scenario, task.horizon, embodiment=task.embodiment)
        if certified.certificate.verdict != "certified":
            sys.exit(f"{name}: scenario {SCENARIO} is {certified.certificate.reason}")
        take = Take(scenario, certified.scene_xml, task.embodiment, certified.witness)
        _save(FOLDER / f"{name}.jpg", strip(take, FRAMES, WIDTH, HEIGHT))
        (FOLDER / f"{name}.md").write_text(page(task, certified, take.seconds))
        print(f"wrote {FOLDER / name}.md", flush=True)
    Image.fromarray(overview()).save(OVERVIEW, optimize=True)


def overview() -> Picture:
    """First states of one training scenario of every task, each under its code and name, in the order of the paper."""
    scenes = []
    for task in sorted(map(load_task, list_tasks()), key=lambda task: (task.code[0] != "T", task.code)):
        scene_xml = rebuild(task.draw(ID, 0, SCENARIO).scenario)
        with camera(scene_xml, task.embodiment, *SMALL) as view:
            scenes.append(labelled(view.take(), f"{task.code} {task.name}"))
    empty = np.full_like(scenes[0], 255)
    scenes += [empty] * (-len(scenes) % COLUMNS)
    return np.vstack([np.hstack(scenes[k : k + COLUMNS]) for k in range(0, len(scenes), COLUMNS)])


def labelled(picture: Picture, text: str) -> Picture:
    """A picture above a line of text."""
    line = Image.new("RGB", (picture.shape[1], LABEL), "white")
    ImageDraw.Draw(line).text((6, LABEL // 2), text, "black", ImageFont.load_default(LABEL * 2 // 3), anchor="lm")
    return np.vstack([picture, np.asarray(line)])


def page(task: Task, certified: Certified, seconds: float) -> str:
    """The page of one task."""
    return "\n".join(
        [
            *_story(task),
            f"![Witness of scenario {SCENARIO}: {FRAMES} pictures in {seconds:g} s]({task.name}.jpg)",
            "",
            f"*Witness of training scenario {SCENARIO}: {seconds:g} s, from the upper left to the lower right.*",
            "",
            *_facts(task),
            *_understanding(task),
            *_parameters(task),
            *_axes(task),
            *_plans(certified),
            *_attacks(task),
            "",
        ]
    )


def _story(task: Task) -> Iterator[str]:
    """Docstring of the family's module. Its sketch is indented, so Markdown shows it as it is."""
    told = inspect.getdoc(inspect.getmodule(task.family)) or ""
    title, _, rest = told.partition("\n")
    yield from (f"# {title.rstrip('.')}", "", rest.strip("\n"), "")


def _facts(task: Task) -> Iterator[str]:
    yield f"> {task.instruction}"
    yield ""
    yield f"Paper: {task.code}, category {task.category}. Version {task.version}. "
    yield f"Time limit {task.horizon:g} s. Robot: `{task.embodiment}`. "
    yield f"Family: `{task.family.__module__}.{task.family.__name__}`; distributions: `conf/task/{task.name}.yaml`."
    yield ""


def _understanding(task: Task) -> Iterator[str]:
    """Sub-goals in one of the right orders, and the questions with their answers in the scenario that is shown."""
    sheet, told = facts.load(task), task.draw(ID, 0, SCENARIO).scenario.facts()
    yield from ("## What it takes", "")
    rows = []
    for name, subgoal in sheet.order.items():
        before = [f"`{one}`" for one, giver in sheet.order.items() if set(giver.gives) & set(subgoal.needs)]
        notes = [note for note in ("senses", "optional", "repeats") if getattr(subgoal, note)]
        rows.append((f"`{name}`", subgoal.outcome, ", ".join(before), ", ".join(notes)))
    yield from _table(("sub-goal", "outcome", "after", "notes"), rows)
    yield f"What a model is asked ([how](../agents.md)), and the answers in training scenario {SCENARIO}:"
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


def _axes(task: Task) -> Iterator[str]:
    """Every axis with its new distributions, and its figures in docs/axes.md."""
    yield from ("## OOD axes", "")
    rows = []
    for axis in task.axes.values():
        goes = "; ".join(f"`{name}`: {spell(dist)}" for name, dist in axis.replace.items())
        rows.append((f"`{axis.name}`", goes, " ".join(axis.why.split()), axis.source))
    yield from _table(("axis", "new distributions", "why", "source"), rows)
    yield from _measured(AXES, task)


def _attacks(task: Task) -> Iterator[str]:
    """Results of the adversary."""
    yield from ("## Attacks", "")
    found = list(_measured(ATTACKS, task))
    yield from found or (f"The adversary has not attacked this task: {ledger.not_measured(task.name)}.", "")


def _measured(page: Path, task: Task) -> Iterator[str]:
    """Lines of a task in the table of another page, if there are any."""
    lines = page.read_text().splitlines() if page.is_file() else []
    mine = [i for i, line in enumerate(lines) if line.startswith(f"| {task.name} |")]
    if mine:
        head = max(i for i in range(mine[0]) if lines[i].startswith("| task |"))
        yield f"Measurements ([columns](../{page.name})):"
        yield ""
        yield from (*lines[head : head + 2], *(lines[i] for i in mine), "")


def _plans(certified: Certified) -> Iterator[str]:
    """Results of shortcuts and ablations in the scenario that is shown."""
    certificate = certified.certificate
    yield from ("## Shortcuts that must fail", "")
    told = certificate["shortcuts"].numbers
    rows = [(f"`{name}`", how, *_end(end)) for name, both in told.items() for how, end in both.items()]
    yield from _table(("shortcut", "actions", "outcome", "reason", "after"), rows)
    yield from ("## Ablations in which the witness must fail", "")
    rows = [(f"`{name}`", *_end(end)) for name, end in certificate["ablations"].numbers.items()]
    yield from _table(("ablation", "outcome", "reason", "after"), rows)


def _end(numbers: Mapping[str, Any]) -> tuple[str, ...]:
    return numbers["outcome"], numbers["reason"], f"{numbers['seconds']:g} s"


def _table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield "|---" * len(head) + "|"
    yield from (f"| {' | '.join(row)} |" for row in rows)
    yield ""


def _save(path: Path, picture: Picture) -> None:
    content = io.BytesIO()
    Image.fromarray(picture).save(content, "jpeg", quality=85, optimize=True)
    path.write_bytes(content.getvalue())


if __name__ == "__main__":
    main(*sys.argv[1:])
