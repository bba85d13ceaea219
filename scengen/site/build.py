"""Writing of the site: pages of tasks, and the list of tasks."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import jinja2
from markdown_it import MarkdownIt
from markupsafe import Markup

from ..errors import BadConfig, ScengenError
from ..measures import figures
from ..pool import Pool, PoolRow
from ..samplers.axis import spell
from ..samplers.task import Task
from ..work.targets import write
from . import exhibit, films, task_page
from .exhibit import Exhibit, key_of

CATEGORIES = {
    "P1": "Geometry and constrained grasping",
    "P2": "Dynamics and trajectory prediction",
    "P3": "Causal and indirect action",
    "P4": "Tool use and augmented reach",
    "P5": "Hidden state and active discovery",
    "P6": "Reactive replanning",
    "P7": "Stability and equilibrium",
    "M": "Miscellaneous",
    "X": "Beyond the paper",
}
"""Titles of the categories, from the paper's section on tasks; X holds tasks that are not the paper's."""
Progress = Callable[[int, int, str], None]
"""Function that gets the number of finished tasks, the number of all, and what is being made."""


@dataclass(frozen=True)
class Shown:
    """A task to show."""

    task: Task
    pools: Sequence[Pool] = ()
    """Pools whose first scenarios are shown; none to certify a training scenario."""

    @property
    def key(self) -> str:
        """Hash of everything that its exhibit is made from."""
        return key_of(self.task, [pool.sha256 for pool in self.pools])

    def rows(self) -> list[PoolRow]:
        """The scenarios of pools that are shown."""
        return [pool.at(0) for pool in self.pools]


@dataclass
class Built:
    """Work that a run has done."""

    made: list[str] = field(default_factory=list)
    """Tasks whose films and pictures were made."""
    kept: list[str] = field(default_factory=list)
    """Tasks whose films and pictures were up to date."""
    failed: dict[str, str] = field(default_factory=dict)
    """Tasks that could not be shown, and why."""


def build(
    shown: Sequence[Shown],
    to: Path,
    search: Sequence[str] = (),
    progress: Progress = lambda done, total, what: None,
) -> Built:
    """Write the site, or a part of it.

    Films and pictures that are up to date are kept, so that an interrupted run is continued by a repeated call. Tasks
    of earlier runs stay on the list.

    Args:
        shown: tasks whose pages are written.
        to: folder of the site.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        BadConfig: a file cannot be written.
    """
    built = Built()
    for number, each in enumerate(shown):
        name, folder = each.task.name, to / "tasks" / each.task.name
        progress(number, len(shown), name)
        known = Exhibit.read(folder)
        if known is not None and known.key == each.key:
            built.kept.append(name)
            continue
        try:
            rows = each.rows()
            tell = lambda what, number=number, name=name: progress(number, len(shown), f"{name}: {what}")  # noqa: E731
            exhibit.make(each.task, rows, folder, each.key, tell)
            built.made.append(name)
        except BadConfig:  # such as a full disk: the other tasks would fail, too
            raise
        except ScengenError as error:
            built.failed[name] = str(error)
    progress(len(shown), len(shown), "pages")
    _Pages(to, search).write(shown)
    return built


class _Pages:
    """All pages, from what was made."""

    def __init__(self, to: Path, search: Sequence[str]):
        self.to, self.search = to, search
        found = (Exhibit.read(path.parent) for path in sorted(to.glob(f"tasks/*/{exhibit.DESCRIPTION}")))
        self.exhibits = {made.name: made for made in sorted(filter(None, found), key=_order)}
        loader = jinja2.PackageLoader("scengen", "site/templates")
        self._templates = jinja2.Environment(loader=loader, autoescape=True, trim_blocks=True, lstrip_blocks=True)

    def write(self, shown: Sequence[Shown]) -> None:
        """Write everything but films and pictures."""
        for name in ("site.css", "site.js"):
            write(self.to / name, (files("scengen") / "site" / "static" / name).read_text())
        write(self.to / films.PLAYER, films.player())
        for each in shown:
            if each.task.name in self.exhibits:
                self._task(each.task, self.exhibits[each.task.name])
        self._write(
            Path("index.html"), "tasks.html", title="Tasks", exhibits=self.exhibits.values(), categories=CATEGORIES
        )

    def _task(self, task: Task, made: Exhibit) -> None:
        """The page of a task."""
        names = [*self.exhibits]
        place, folder = names.index(task.name), Path("tasks", task.name)
        self._write(
            folder / "index.html",
            "task.html",
            title=f"{task.code} {task.name}",
            task=task,
            made=made,
            category=CATEGORIES.get(task.category, task.category),
            story=rendered([inspect.getdoc(inspect.getmodule(task.family)) or ""]),
            pairs={pair.axis: pair for pair in made.pairs},
            measured=figures.axes(task),
            sections={
                "Certification": rendered(task_page.certification(task)),
                "Attacks": rendered(task_page.attacks(task)),
                "Trained policies": rendered(task_page.policies(task)),
            },
            parameters=rendered(task_page.parameters(task)),
            understanding=rendered(task_page.understanding(task, self.search)),
            spell=spell,
            before=names[place - 1] if place else None,
            after=names[place + 1] if place + 1 < len(names) else None,
        )

    def _write(self, path: Path, template: str, **values: Any) -> None:
        """Write a page with the frame that all pages have."""
        up = "../" * (len(path.parts) - 1)
        write(self.to / path, self._templates.get_template(template).render({"up": up, **values}))


def rendered(lines: Iterable[str]) -> Markup:
    """A docstring or a section as HTML. Indented sketches keep their form."""
    return Markup(MarkdownIt("commonmark", {"html": False}).enable("table").render("\n".join(lines)))


def _order(made: Exhibit) -> tuple[int, str]:
    """The paper's categories first, each with its tasks in the order of their codes."""
    known = [*CATEGORIES]
    return known.index(made.category) if made.category in known else len(known), made.code
