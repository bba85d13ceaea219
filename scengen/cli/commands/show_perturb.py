"""write a sheet of a scenario as it is and under every level of perturbations"""

from dataclasses import dataclass
from pathlib import Path

from ...envs.observations import cameras_of
from ...errors import BadConfig, UnknownName
from ...look.looks import look_named
from ...ood.analysis.redraw import task_of
from ...perturb.effects import LANGUAGE
from ...perturb.kinds import LEVELS, kind_of, perceived
from ...perturb.language import Words
from ...perturb.perturbation import Perturbation
from ...pictures.perturbed import sheet, shows
from ...pictures.render import check_pictures, encode
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...validate.playable import check_row
from ...work.limits import at_least
from ...work.targets import try_file
from . import OK, Arguments, chosen, err, holder, identified, say, write
from .settings import read

EVERY = "all"
"""Name of all kinds."""


@dataclass(frozen=True)
class SheetSettings:
    """Settings of `scengen show perturb`; conf/command/show_perturb.yaml explains them."""

    pool: str | list[str]
    id: str | None
    index: int | None
    perturb: str
    to: str
    camera: str
    look: str
    size: int
    seed: int


REMEDY = "see it with scengen show film perturb="
"""Remedy for kinds that show only over time."""


def command(arguments: Arguments) -> int:
    settings = read("show perturb", arguments, SheetSettings)
    look = look_named(settings.look)
    at_least(settings, size=16, seed=0)
    if Path(settings.to).suffix not in (".png", ".webp"):
        raise BadConfig(f"to = {settings.to}; give a .png or .webp file")
    try_file(settings.to)
    every = settings.perturb == EVERY
    names = perceived() if every else [one.partition("@")[0] for one in settings.perturb.split("+")]
    wanted = [kind_of(name) for name in names]
    check_pictures()
    name = identified(settings.pool, settings.id, settings.index)
    pool = holder(settings.pool, name)
    row = check_row(chosen(pool, name))
    cameras = cameras_of(row.embodiment)
    if settings.camera not in cameras:
        raise UnknownName("camera", settings.camera, cameras)
    camera, words = cameras[settings.camera], Words.of(row.task, row.instruction, search_path(arguments))
    for kind in () if every else wanted:
        if kind.effect.reads == LANGUAGE:
            continue
        Perturbation(((kind.name, 1),)).check((), [camera], look)
        Perturbation(((kind.name, 1),)).check_words(words)
        if not shows(kind, camera, look):
            raise BadConfig(f"perturb = {kind.name}; a single picture does not show it: {REMEDY}")
    scenario = task_of(pool, search_path(arguments)).scenario(row.params)
    wanted = [kind for kind in wanted if not kind.lacks(words)]
    drawn = [kind for kind in wanted if shows(kind, camera, look)]
    if drawn:
        with ProgressBar(err, "sheet", 1) as bar:
            picture = sheet(row, scenario, drawn, camera, look, settings.size, settings.seed, words, bar.of)
        write(Path(settings.to), encode(picture, Path(settings.to).suffix[1:]))
    for kind in wanted:
        say(f"{kind.name}: {', '.join(f'{each:g}' for each in kind.strengths)} {kind.unit}. {kind.why}")
        for level in range(1, LEVELS + 1) if kind.effect.reads == LANGUAGE else ():
            said = Perturbation(((kind.name, level),)).of(row.id, settings.seed, words=words)
            say(f"  {kind.name}@{level}: {said.instruction}")
    if drawn:
        say(f"wrote {settings.to}")
    return OK
