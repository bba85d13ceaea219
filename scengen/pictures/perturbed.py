"""A sheet of perturbations: the start of a scenario, clean and at every level of some kinds."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager

import numpy as np
from numpy.typing import NDArray

from ..look.looks import Look
from ..perturb.distractors import with_spares
from ..perturb.drawn import Drawn
from ..perturb.kinds import LEVELS, Kind, affects
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pool import PoolRow
from ..scenario import Scenario
from ..validate.playable import stored_world
from .film import Progress, captioned
from .render import Camera, Picture, check_pictures


@contextmanager
def changed_by(drawn: Drawn, eye: Camera) -> Iterator[Mapping[str, NDArray[np.int64]]]:
    """Change the scene of a camera during a `with` statement, its textures included, as `Drawn.while_applied` does."""
    with drawn.while_applied(eye.world.model) as changed:
        is_printed = any(name.startswith("tex_") for name in changed)
        if is_printed:
            eye.refresh()
        yield changed
    if is_printed:
        eye.refresh()


def shows(kind: Kind, camera: str, look: Look) -> bool:
    """Whether a single picture of a camera shows a kind."""
    return affects(kind.effect, camera) and look.name in kind.effect.looks and not kind.effect.is_late


class Start:
    """The start of a scenario in front of the cameras of a policy, clean or perturbed."""

    def __init__(self, row: PoolRow, scenario: Scenario, look: Look, size: int):
        """
        Args:
            look: look of the pictures.
            size: width and height of the pictures [pixels].

        Raises:
            NoPictures: OpenGL is missing.
        """
        check_pictures()  # before the meshes of the robot, which take a part of the address space
        self.row, self.scenario, self.look = row, scenario, look
        self._eye = Camera(stored_world(row, with_spares(look)), size, size)

    def picture(self, camera: str, drawn: Drawn | None = None) -> Picture:
        """A picture of a camera, given robosuite's name, under what a perturbation drew."""
        if drawn is None:
            self._eye.world.reset()
            return self.scenario.orientation.apply(self._eye.take(camera)).copy()
        with changed_by(drawn, self._eye):
            return drawn.on_picture(self.picture(camera), camera, 0)

    def close(self) -> None:
        self._eye.close()


def sheet(
    row: PoolRow,
    scenario: Scenario,
    kinds: Sequence[Kind],
    camera: str,
    look: Look,
    size: int,
    seed: int,
    words: Words,
    progress: Progress = lambda done, total: None,
) -> Picture:
    """A row of pictures for each kind that changes pictures of the camera: clean, and at each level.

    Args:
        camera: robosuite's name of the camera.
        look: look of the pictures.
        size: width and height of each picture [pixels].
        seed: seed of the perturbations.
        words: what is said in the task.
    """
    shown = [kind for kind in kinds if shows(kind, camera, look)]
    levels = [Perturbation(((kind.name, level),)) for kind in shown for level in range(1, LEVELS + 1)]
    pictures = list[Picture]()
    with closing(Start(row, scenario, look, size)) as start:
        clean = start.picture(camera)
        for perturbation in levels:
            picture = start.picture(camera, perturbation.of(row.id, seed, words=words))
            pictures.append(captioned(picture, str(perturbation)))
            progress(len(pictures), len(levels))
    first = captioned(clean, "clean")
    rows = [[first, *pictures[k : k + LEVELS]] for k in range(0, len(pictures), LEVELS)]
    return np.vstack([np.hstack(each) for each in rows])
