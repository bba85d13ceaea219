"""The contact sheet: pictures of the scenarios of pools, next to their training twins, in one HTML file."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from markupsafe import Markup

from ..certificate import STAGES
from ..look.looks import ROOM, Look
from ..pool import Pool, PoolRow
from ..samplers.axis import spell
from ..samplers.task import Task
from ..validate.playable import check_row
from ..work.targets import write
from . import film, render
from .page import LARGEST_PAGE, template, thumbnail
from .shared_view import directions_of, twin_scene
from .twins import pair
from .views import VIEWS, Directions

STRIP = (8, 240, 180)
"""Number of pictures of a film strip, and width and height of each [pixels]."""


@dataclass
class SheetEntry:
    """One scenario on the sheet. Pictures are data addresses, or empty."""

    row: PoolRow
    moved: list[str]
    """Descriptions of the parameters that its axes have moved."""
    picture: str = ""
    """Picture of its start."""
    twin: str = ""
    """Picture of its training twin."""
    strip: str = ""
    """Film strip of its witness."""

    @property
    def checks(self) -> list[tuple[str, str]]:
        """Names and results of the checks of its certificate: passed, waived or failed."""
        checks = self.row.certificate.checks
        return [(each.name, "passed" if each.passed else "waived" if each.waived else "failed") for each in checks]


@dataclass(frozen=True)
class Section:
    """A pool on the sheet."""

    pool: Pool
    task: Task
    figures: list[Markup]
    """Figures of its scenarios."""
    checks: list[tuple[str, str]]
    """Names and results of the checks of its first scenario. Figures show those that differ."""


def contact_sheet(
    pools: list[tuple[Pool, Task]],
    path: Path,
    images: int,
    films: bool,
    progress: Callable[[int, int], None] = lambda done, total: None,
    look: Look = ROOM,
) -> str:
    """Write one HTML file that shows the scenes of some pools. Returns a remark, or an empty text.

    Without OpenGL the page has no pictures and a remark about it. For every pool it gives the number of its scenarios
    that are shown. All pictures of a pool are seen from one direction.

    Args:
        pools: pools, each with its task as it was when the pool was made.
        images: largest number of scenarios to show of each pool; fewer if the page would become too large.
        films: whether to show each of them with a film strip of the witness.
        progress: function that gets the number of drawn scenarios and the number of all.
        look: look of the pictures.

    Raises:
        ScengenError: a scene or a witness cannot be played.
    """
    remark, sections, figure = "", list[Section](), template("contact_sheet_figure.html")
    total, size = sum(min(images, len(pool)) for pool, _ in pools), 0
    for number_of_pool, (pool, task) in enumerate(pools):
        section, directions = Section(pool, task, [], []), VIEWS
        share = (LARGEST_PAGE - size) // (len(pools) - number_of_pool)
        for row in islice(pool.rows(), images):
            entry = SheetEntry(row, [moved(task, name, value) for name, value in row.shifted.items()])
            if not remark:
                try:
                    if not section.figures:
                        directions = directions_of(pool, task)
                    if row.shifted:
                        entry.twin, entry.picture = pair(row, twin_scene(pool, task, row), directions, look)[:2]
                    else:
                        entry.picture = thumbnail(row.scene_xml, row.embodiment, directions, look)
                    entry.strip = _strip(task, row, directions, look) if films else ""
                except render.NoPictures as error:
                    remark = str(error)
            section.checks.extend([] if section.checks else entry.checks)
            own = [] if entry.checks == section.checks else entry.checks
            text = Markup(figure.render(entry=entry, checks=own, task=task, unit=_unit))
            if len(text) > share:
                break
            share, size = share - len(text), size + len(text)
            section.figures.append(text)
            progress(sum(len(each.figures) for each in [*sections, section]), total)
        sections.append(section)
    steps = ("proposed", *STAGES)
    page = template("contact_sheet.html").render(sections=sections, steps=steps, remark=remark)
    write(path, page)
    return remark


def _strip(task: Task, row: PoolRow, directions: Directions, look: Look) -> str:
    """Film strip of the witness."""
    take = replace(film.Take.witness(check_row(row), task.scenario(row.params)), directions=directions, look=look)
    return render.address(render.encode(film.strip(take, *STRIP)), "webp")


def moved(task: Task, name: str, value: float) -> str:
    """Description of a moved parameter: `tile height 0.055 m (training 0.07 to 0.09)`."""
    named = name.replace(".", " ").replace("_", " ")
    return f"{named} {value:.4g} {_unit(task, name)} (training {spell(task.training[name])})".replace("  ", " ")


def _unit(task: Task, name: str) -> str:
    """Unit of a parameter; empty for a pure number."""
    return task.known[name].unit.removeprefix("1")
