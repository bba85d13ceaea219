"""write a strip or a video of a witness, a failing shortcut, a demonstration, a policy's rollout, or the adversary"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ... import compose
from ...attack.evidence import OTHER_SCENARIO, Hit, scenario_of
from ...envs.observations import ALL, cameras_of
from ...episode import check_rules
from ...errors import BadConfig
from ...look.looks import look_named
from ...ood.analysis.redraw import task_of
from ...perturb.language import Words
from ...perturb.perturbation import Perturbation
from ...pictures.film import WITNESS, Take, movie, periods_between, shortcut, strip
from ...pictures.render import check_pictures, encode
from ...pictures.shared_view import directions_of
from ...pool import Pool
from ...pool.demonstrations import Demonstrations, is_demonstrations
from ...pool.directory import Directory
from ...pool.row import DemonstrationRow
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...validate.playable import check_row
from ...validate.rebuilt import rebuild
from ...validate.verify.stored import task_of_manifest
from ...work.limits import at_least
from ...work.targets import try_file
from . import OK, Arguments, chosen, err, holder, identified, misnaming_remarked, remark, say, several, write
from .settings import read

MAX_STRIP_PIXELS = 100_000_000
"""Largest size of a film strip [pixels]: each takes three bytes of memory, multiple times."""


@dataclass(frozen=True)
class FilmSettings:
    """Settings of `scengen show film`; conf/command/show_film.yaml explains them."""

    pool: str | list[str] | None
    id: str | None
    index: int | None
    hit: str | None
    to: str
    of: str
    run: int | None
    raw: bool
    camera: str | None
    look: str
    perturb: str | None
    perturb_seed: int
    frames: int
    fps: int
    width: int
    height: int

    @property
    def eye(self) -> str | None:
        """Name of the camera in the model."""
        return cameras_of(ALL).get(self.camera, self.camera) if self.camera else None

    def check(self) -> None:
        """Raise `BadConfig` for settings that are not valid."""
        named = self.id is not None or self.index is not None
        if (self.hit is None) != named or (named and self.pool is None):
            raise BadConfig("show film needs either pool=FOLDER and id=ID (or index=N), or hit=FILE")
        if Path(self.to).suffix not in (".png", ".mp4"):
            raise BadConfig(f"to = {self.to}; give a .png file for a film strip or an .mp4 file for a video")
        if self.raw and self.of == WITNESS:
            raise BadConfig("raw = true plays a shortcut without the filter; give one as of=NAME, or leave raw out")
        look_named(self.look)
        Perturbation.parse(self.perturb)
        at_least(self, frames=1, fps=1, width=1, height=1, perturb_seed=0)
        check_format(Path(self.to), self.frames, self.fps, self.width, self.height)


def check_format(target: Path, frames: int, fps: int, width: int, height: int) -> None:
    """Raise `ScengenError` for a video with a rate that does not divide the control rate, and for too large a strip."""
    if target.suffix == ".mp4":
        periods_between(fps)
    elif frames * width * height > MAX_STRIP_PIXELS:
        size = f"{frames} frames of {width} x {height} pixels"
        raise BadConfig(
            f"{size} are more than {MAX_STRIP_PIXELS / 1e6:g} million pixels; request fewer or smaller ones"
        )


def command(arguments: Arguments) -> int:
    settings = read("show film", arguments, FilmSettings)
    settings.check()
    try_file(settings.to)
    check_pictures()
    perturbation = Perturbation.parse(settings.perturb)
    take, words = _take(settings, arguments)
    perturbation.check_words(words)
    perturbed = {"perturbation": perturbation, "perturb_seed": settings.perturb_seed, "words": words}
    take = replace(take, look=look_named(settings.look), **perturbed)
    if perturbation.has_words:
        said = perturbation.of(take.scenario.id, settings.perturb_seed, words=words)
        say(f"the instruction is: {said.instruction}")
    target, size = Path(settings.to), (settings.width, settings.height)
    with ProgressBar(err, "film", 1) as bar:
        if target.suffix == ".png":
            write(target, encode(strip(take, settings.frames, *size, settings.eye, bar.of), "png"))
        else:
            movie(take, target, settings.fps, *size, settings.eye, bar.of)
    for way in take.ways:
        say(str(way))
    say(f"wrote {target}: {take.seconds:g} s")
    return OK


def _take(settings: FilmSettings, arguments: Arguments) -> tuple[Take, Words]:
    """What is filmed, and its instruction with other wordings."""
    if settings.hit:
        return _take_of_hit(settings, arguments)
    settings = replace(settings, id=identified(settings.pool or "", settings.id, settings.index))
    folders = several(settings.pool or "")
    if any(map(is_demonstrations, folders)):
        return _take_of_run(settings, folders, arguments)
    if settings.run is not None:
        raise BadConfig(f"run = {settings.run}; a scenario of a pool has one witness: leave out run=")
    return _take_of_pool(settings, arguments)


def _take_of_run(settings: FilmSettings, folders: Sequence[str], arguments: Arguments) -> tuple[Take, Words]:
    """A take of a demonstration or of a rollout of a policy, failed ones included if they were kept.

    Raises:
        ScengenError: it does not exist of this scenario, or none of this number.
    """
    if settings.of != WITNESS:
        raise BadConfig(f"of = {settings.of}; what is filmed of demonstrations is the run itself: leave out of=")
    sources = [Demonstrations.open(folder).check() for folder in folders]
    names = [row.name for source in sources for row in source.attempts()]
    known = Directory(np.array([name.id for name in names], "S12"), np.array([name.index for name in names], np.int64))
    with misnaming_remarked():
        id_ = known.id(known.find(str(settings.id), names.__getitem__, ", ".join(folders)))
    runs = dict[int, tuple[Demonstrations, DemonstrationRow]]()
    for source in sources:
        for row in source.attempts():
            if row.id == id_:
                runs.setdefault(row.run, (source, row))
    number = min(runs) if settings.run is None else settings.run
    if number not in runs:
        raise BadConfig(f"run = {number}; of this scenario there are {', '.join(map(str, sorted(runs)))}")
    source, row = runs[number]
    outcome = f"{row.outcome} after {row.seconds:g} s{': ' if row.reason else ''}{row.reason}"
    say(f"{check_row(row).name}, run {number} ({row.style}): {outcome}")
    task = task_of_manifest(source, compose.load_task(source.task, search_path(arguments)))
    rules = check_rules(source.manifest.config.rules)
    words = Words.of(row.task, row.instruction, search_path(arguments))
    return Take(task.scenario(row.params), row.scene_xml, row.embodiment, row.witness, rules=rules), words


def _take_of_pool(settings: FilmSettings, arguments: Arguments) -> tuple[Take, Words]:
    """A take of the witness of a scenario in a pool, or of one of its shortcuts."""
    pool = holder(settings.pool, str(settings.id))
    row = check_row(chosen(pool, str(settings.id)))
    task = task_of(pool, search_path(arguments))
    directions, scenario = directions_of(pool, task), task.scenario(row.params)
    words = Words.of(row.task, row.instruction, search_path(arguments))
    if settings.of == WITNESS:
        return replace(Take.witness(row, scenario), directions=directions), words
    take, rollout = shortcut(row, scenario, settings.of, settings.raw)
    outcome = f"{rollout.outcome} after {rollout.seconds:g} s{': ' if rollout.reason else ''}{rollout.reason}"
    say(f"{settings.of}: {outcome}")
    return replace(take, directions=directions), words


def _take_of_hit(settings: FilmSettings, arguments: Arguments) -> tuple[Take, Words]:
    """A take of a hit of the adversary."""
    hit = Hit.load(Path(str(settings.hit)))
    search = search_path(arguments)
    task = (
        task_of(Pool.open(str(settings.pool)).check(), search) if settings.pool else compose.load_task(hit.task, search)
    )
    scenario = scenario_of(hit, task)
    if scenario.id != hit.scenario:
        raise BadConfig(f"hit = {settings.hit}: {OTHER_SCENARIO}")
    say(str(hit))
    if other := task.other_version("found on", hit.task_version):
        remark(f"hit = {settings.hit}: {other}")
    words = Words.of(task.name, task.instruction, search)
    return Take(scenario, rebuild(scenario), task.embodiment, hit.actions), words
