"""Content of the site about a task: films, pictures and pairs of twins, made once and stored with a description."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import viser

from .. import compose
from ..errors import BadConfig, Infeasible, ScengenError
from ..look.looks import ROOM
from ..pictures import film
from ..pictures.render import Picture, camera, encode
from ..pictures.sheet import moved
from ..pictures.twins import comparison_view, twin_pictures
from ..pool import PoolRow
from ..runs.generate import row_of
from ..samplers.axis import Axis
from ..samplers.split import ID
from ..samplers.task import Draw, Task
from ..sim.world import World
from ..studio.browse import longest_shortcut
from ..studio.scene import filmed
from ..validate.certify import certify
from ..validate.identity import source_sha256
from ..validate.playable import check_row, stored_world
from ..validate.rebuilt import rebuild
from ..work.plain import read_plain
from ..work.targets import write
from ..work.typed import typed
from .films import record

DESCRIPTION = "made.json"
"""File that describes what was made. It is written last: without it the folder is not whole."""
FORMAT = 2
"""Number of the format of exhibits; another one makes all of them again."""
SEED = 0
"""Seed of the scenarios that are drawn for the site."""
TRIES = 20
"""Number of indices that are tried for a certified scenario, and for a pair of twins."""
PICTURE = (480, 360)
"""Width and height of the picture of a task [pixels]."""
TWIN = (400, 300)
"""Width and height of a picture of a pair [pixels]."""
FRAMES = 8
"""Number of pictures of the film strip of a witness."""
VISIBLE = 20
"""Difference of a pixel that a person sees [1/255], and number of such pixels from which pictures differ."""
Progress = Callable[[str], None]
"""Function that is called with the name of the next item."""


@dataclass(frozen=True)
class Clip:
    """A film in three dimensions."""

    title: str
    """The witness, or the name of a shortcut."""
    split: str
    scenario: str
    """Name of the scenario."""
    outcome: str
    seconds: float
    """Duration [s]."""
    size: int
    """Size of its script [bytes]."""
    address: str
    """Address of the film in the player: what follows `?film=`."""


@dataclass(frozen=True)
class Step:
    """One OOD scenario of a pair."""

    split: str
    moved: list[str]
    """Descriptions of the parameters that the axis has moved."""
    picture: str
    """File of the picture."""


@dataclass(frozen=True)
class Pair:
    """Pictures of a training scenario and of its twins along one axis."""

    axis: str
    twin: str
    """File of the picture in training; empty if no draw is feasible."""
    steps: list[Step]
    """One twin, or one for each severity."""
    alike: bool
    """Whether the pictures look alike, since what moves cannot be seen."""


@dataclass(frozen=True)
class Ending:
    """End of a plan that must fail."""

    plan: str
    actions: str
    """Whether the actions were filtered; empty for an ablation."""
    outcome: str
    reason: str
    seconds: float
    """Time of the end [s]."""


@dataclass(frozen=True)
class Exhibit:
    """Files that were made for a task."""

    key: str
    """Hash of what it was made from."""
    name: str
    code: str
    category: str
    instruction: str
    hands: str
    """Hands of the robot, as text."""
    axes: list[str]
    """Names of the axes."""
    words: str
    """Words by which the task is found."""
    scenario: str
    """Name of the scenario in the picture and the strip."""
    clips: list[Clip]
    pairs: list[Pair]
    shortcuts: list[Ending]
    ablations: list[Ending]

    @classmethod
    def read(cls, folder: Path) -> "Exhibit | None":
        """The exhibit in a folder; None if there is no whole one."""
        with suppress(OSError, ValueError, BadConfig, RecursionError):
            return typed("", cls, json.loads(read_plain(folder / DESCRIPTION)), exact=True)
        return None


def key_of(task: Task, pools: Sequence[str]) -> str:
    """Hash of everything that the exhibit of a task is made from.

    Args:
        pools: hashes of the pools whose scenarios are shown; none for a scenario that is certified here.
    """
    made_from = [FORMAT, source_sha256(task.family), task.node, pools, viser.__version__]
    return hashlib.sha256(json.dumps(made_from, sort_keys=True, default=str).encode()).hexdigest()


def make(task: Task, rows: Sequence[PoolRow], folder: Path, key: str, progress: Progress) -> Exhibit:
    """Make the films and pictures of a task.

    Args:
        rows: scenarios of pools to show; none to certify one here.
        folder: folder of the page.
        key: see `key_of`.

    Raises:
        ScengenError: a scenario cannot be played, none could be certified, or a file cannot be written.
    """
    (folder / DESCRIPTION).unlink(missing_ok=True)
    if not rows:
        progress("certifying a scenario")
    shown = [check_row(row) for row in rows] or [_certified(task)]
    first = shown[0]
    progress("pictures")
    with camera(first.scene_xml, first.embodiment, *PICTURE) as eye:
        _save(folder / "picture.webp", eye.take())
    take = film.Take.witness(first, task.scenario(first.params))
    _save(folder / "strip.webp", film.strip(take, FRAMES))
    clips: list[Clip] = []
    for row in shown:
        for title in filter(None, (film.WITNESS, longest_shortcut(row))):
            progress(f"film of {title}")
            clips.append(_clip(task, row, title, folder, f"film-{len(clips) + 1}"))
    pairs = []
    for number, axis in enumerate(task.axes.values(), 1):
        progress(f"axis {axis.name}")
        pairs.append(_pair(task, axis, folder, f"axis-{number}"))
    made = Exhibit(
        key=key,
        name=task.name,
        code=task.code,
        category=task.category,
        instruction=task.instruction,
        hands=hands_in_words(task.embodiment),
        axes=[*task.axes],
        words=_words(task),
        scenario=str(first.name),
        clips=clips,
        pairs=pairs,
        shortcuts=[*_endings(first, "shortcuts")],
        ablations=[*_endings(first, "ablations")],
    )
    write(folder / DESCRIPTION, json.dumps(asdict(made), indent=1) + "\n")
    return made


def hands_in_words(embodiment: str) -> str:
    """The hands of a robot as text: `suction and jaw`."""
    return embodiment.replace("panda_", "").replace("_", " ").replace("+", " and ")


def _certified(task: Task) -> PoolRow:
    """The first training scenario that is certified at level quick.

    Raises:
        ScengenError: none of the first ones is.
    """
    settings, why = compose.certify_levels(task)["quick"], "no draw is feasible"
    for index in range(TRIES):
        with suppress(Infeasible):
            draw = task.draw(ID, SEED, index)
            certified = certify(draw.scenario, task.horizon, settings, task.embodiment)
            if certified.certificate.verdict == "certified":
                return row_of(task, draw, certified)
            why = certified.certificate.reason
    raise ScengenError(f"{task.name}: none of {TRIES} training scenarios is certified ({why}); try scengen generate")


def _clip(task: Task, row: PoolRow, title: str, folder: Path, stem: str) -> Clip:
    """The film of a witness or of a shortcut."""
    scenario, world, horizon = task.scenario(row.params), stored_world(row, ROOM), row.horizon
    actions = row.witness
    if title != film.WITNESS:
        take, _ = film.shortcut(row, scenario, title)
        actions, horizon = take.actions, 3.0 * row.horizon  # what comes to rest may take longer
    made = filmed(world, scenario, actions, horizon)
    recorded = record(world, made, folder / f"{stem}.js")
    address = f"{folder.name}/{stem}&{recorded.view}"
    return Clip(title, row.split, str(row.name), made.outcome, made.seconds, recorded.size, address)


def _pair(task: Task, axis: Axis, folder: Path, stem: str) -> Pair:
    """Pictures of a training scenario and of its twins along an axis, with one camera."""
    splits = [f"{axis.name}@{number + 1}" for number in range(axis.severities)] or [axis.name]
    index, draws = _drawn(task, splits)
    if not draws:
        return Pair(axis.name, "", [], False)
    scenarios = [task.draw(ID, SEED, index).scenario, *(draw.scenario for draw in draws)]
    worlds = [World.load(rebuild(scenario), task.embodiment, ROOM) for scenario in scenarios]
    pictures = twin_pictures(*worlds, size=TWIN, view=comparison_view(worlds, TWIN[0] / TWIN[1]))
    files = [f"{stem}-{number}.webp" for number in range(len(pictures))]
    for name, picture in zip(files, pictures, strict=True):
        _save(folder / name, picture)
    steps = [
        Step(str(draw.split), [moved(task, name, value) for name, value in draw.shifted.items()], name_of_file)
        for draw, name_of_file in zip(draws, files[1:], strict=True)
    ]
    return Pair(axis.name, files[0], steps, alike(pictures[0], pictures[-1]))


def alike(one: Picture, other: Picture) -> bool:
    """Whether two pictures look the same to a person. A hole of a few pixels is a difference."""
    return int((np.abs(one.astype(int) - other).max(axis=2) > VISIBLE).sum()) < VISIBLE


def _drawn(task: Task, splits: Sequence[str]) -> tuple[int, list[Draw]]:
    """The first index at which most of some splits are feasible, and their draws."""
    best: tuple[int, list[Draw]] = 0, []
    for index in range(TRIES):
        draws = []
        for split in splits:
            with suppress(Infeasible):
                draws.append(task.draw(split, SEED, index))
        if len(draws) > len(best[1]):
            best = index, draws
        if len(draws) == len(splits):
            break
    return best


def _endings(row: PoolRow, check: str) -> list[Ending]:
    """Failures of the plans that must fail, by the certificate, which may be untrusted."""
    found = []
    for numbers in (each.numbers for each in row.certificate.checks if each.name == check):
        for plan, outcomes in numbers.items():
            ways = outcomes.items() if isinstance(outcomes, Mapping) and "outcome" not in outcomes else [("", outcomes)]
            found += [_ending(plan, how, end) for how, end in ways if isinstance(end, Mapping)]
    return found


def _ending(plan: str, how: str, end: Mapping[str, Any]) -> Ending:
    seconds = end.get("seconds")
    verdict = (str(end.get("outcome", "")), str(end.get("reason", "")))
    return Ending(str(plan), str(how), *verdict, float(seconds) if isinstance(seconds, (int, float)) else 0.0)


def _words(task: Task) -> str:
    """Words by which people look for a task."""
    axes = " ".join(f"{axis.name} {axis.why}" for axis in task.axes.values())
    return f"{task.name} {task.code} {task.category} {task.instruction} {hands_in_words(task.embodiment)} {axes}"


def _save(path: Path, picture: Picture) -> None:
    write(path, encode(picture))
