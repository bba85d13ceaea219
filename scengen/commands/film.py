"""a film strip or a video of a witness, or of a tempting plan that fails"""

from dataclasses import dataclass
from pathlib import Path

from .. import config
from ..config import read, search_path, typed
from ..envs.observations import CAMERAS
from ..errors import BadConfig, at_least
from ..pictures.film import WITNESS, Take, movie, shortcut, strip
from ..pictures.render import encode
from ..pool import Pool
from . import OK, Arguments, one, out, write


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen film`; meanings stand in conf/command/film.yaml."""

    pool: str | list[str] = ""
    id: str = ""
    to: str = ""
    plan: str = WITNESS
    camera: str | None = None
    frames: int = 8
    fps: int = 25
    width: int = 480
    height: int = 360

    @property
    def eye(self) -> str | None:
        """The camera by its name in the model."""
        return CAMERAS.get(self.camera, self.camera) if self.camera else None

    def check(self) -> None:
        """Raise `BadConfig` for settings that make no sense."""
        if Path(self.to).suffix not in (".png", ".mp4"):
            raise BadConfig(f"to = {self.to}; a film strip is a .png file, a video an .mp4 file")
        at_least(self, frames=1, width=1, height=1)


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("film", arguments).settings)
    settings.check()
    row = Pool.open(one(settings.pool)).check().row(settings.id)
    scenario = config.task(row["task"], search_path(arguments)).scenario(row["params"])
    take = Take.witness(row, scenario)
    if settings.plan != WITNESS:
        take, episode = shortcut(row, scenario, settings.plan)
        told = f"{episode.outcome} after {episode.seconds:g} s{': ' if episode.reason else ''}{episode.reason}"
        out.print(f"{settings.plan}: {told}", highlight=False, markup=False)
    target, size = Path(settings.to), (settings.width, settings.height)
    if target.suffix == ".png":
        write(target, encode(strip(take, settings.frames, *size, settings.eye), "png"))
    else:
        movie(take, target, settings.fps, *size, settings.eye)
    out.print(f"wrote {target}: {take.seconds:g} s", highlight=False)
    return OK
