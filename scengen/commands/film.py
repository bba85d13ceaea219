"""a film strip or a video of a witness, or of a shortcut that fails"""

from dataclasses import dataclass
from pathlib import Path

from .. import config
from ..config import read, search_path
from ..envs.observations import CAMERAS
from ..errors import BadConfig, at_least
from ..pictures.film import WITNESS, Take, movie, shortcut, strip
from ..pictures.render import encode
from ..pool import Pool
from ..targets import try_file
from . import OK, Arguments, one, say, write

STRIP = 100_000_000
"""Largest size of a film strip [pixels]: it takes three bytes of memory for each, several times over."""


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen film`; meanings stand in conf/command/film.yaml."""

    pool: str | list[str]
    id: str
    to: str
    of: str
    camera: str | None
    frames: int
    fps: int
    width: int
    height: int

    @property
    def eye(self) -> str | None:
        """The camera by its name in the model."""
        return CAMERAS.get(self.camera, self.camera) if self.camera else None

    def check(self) -> None:
        """Raise `BadConfig` for settings that make no sense."""
        if Path(self.to).suffix not in (".png", ".mp4"):
            raise BadConfig(f"to = {self.to}; name a .png file for a film strip, an .mp4 file for a video")
        at_least(self, frames=1, fps=1, width=1, height=1)
        if Path(self.to).suffix == ".png" and self.frames * self.width * self.height > STRIP:
            size = f"{self.frames} frames of {self.width} x {self.height} pixels"
            raise BadConfig(f"{size} are more than {STRIP / 1e6:g} million pixels; ask for fewer or smaller ones")


def command(arguments: Arguments) -> int:
    settings = read("film", arguments, Settings)
    settings.check()
    try_file(settings.to)
    row = Pool.open(one(settings.pool)).check().row(settings.id)
    scenario = config.task(row.task, search_path(arguments)).scenario(row.params)
    take = Take.witness(row, scenario)
    if settings.of != WITNESS:
        take, rollout = shortcut(row, scenario, settings.of)
        told = f"{rollout.outcome} after {rollout.seconds:g} s{': ' if rollout.reason else ''}{rollout.reason}"
        say(f"{settings.of}: {told}")
    target, size = Path(settings.to), (settings.width, settings.height)
    if target.suffix == ".png":
        write(target, encode(strip(take, settings.frames, *size, settings.eye), "png"))
    else:
        movie(take, target, settings.fps, *size, settings.eye)
    say(f"wrote {target}: {take.seconds:g} s")
    return OK
