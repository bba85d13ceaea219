"""What a policy sees and reads at the start of a scenario: in the room, clean or under a perturbation of any level."""

import threading
from collections.abc import Sequence

import numpy as np
import viser

from ..envs.observations import cameras_of
from ..look.looks import ROOM
from ..perturb.effects import LANGUAGE, PICTURES
from ..perturb.kinds import LEVELS, Kind, kind_of, kinds
from ..perturb.language import Words
from ..perturb.perturbation import Perturbation
from ..pictures.page import template
from ..pictures.perturbed import Start
from ..pool import PoolRow
from ..scenario import Scenario
from ..sim.embodiment import JAW
from .scene import FAULTS, one_line

OFF = "off"
"""Choice that draws nothing."""
CLEAN = "clean"
"""Choice of no perturbation."""
SIZE = 256
"""Width and height of the picture [pixels]: those that environments have by default."""
FIRST_LEVEL = 3
"""Level at which the slider starts."""


class Seen:
    """Controls and a picture in a panel."""

    def __init__(self, client: viser.ClientHandle, search: Sequence[str] = ()):
        """Add the controls to the present container.

        Args:
            search: overrides that add folders of other packages, see `task_files.search_path`.
        """
        self._client, self._search, self._busy = client, search, threading.RLock()
        self._start: Start | None = None
        self._scene: tuple[PoolRow, Scenario] | None = None
        self._drawn: tuple[object, ...] = ()
        """Scenario and choices of the present picture."""
        gui = client.gui
        with gui.add_folder("what a policy sees"):
            self.kind: viser.GuiDropdownHandle[str] = gui.add_dropdown("perturbation", choices())
            self.level: viser.GuiSliderHandle[int] = gui.add_slider("level", 1, LEVELS, 1, FIRST_LEVEL, disabled=True)
            self.camera: viser.GuiDropdownHandle[str] = gui.add_dropdown("camera", [*cameras_of(JAW)])
            self.image = gui.add_image(np.zeros((12, 12, 3), np.uint8), format="jpeg", visible=False)
            self.told = gui.add_html("")
        for control in (self.kind, self.level, self.camera):
            control.on_update(lambda _: self._draw())

    def show(self, row: PoolRow | None, scenario: Scenario | None = None) -> None:
        """Show a scenario, whose scene was tried; none if `row` is None."""
        with self._busy:
            self.close()
            self._scene = None if row is None or scenario is None else (row, scenario)
            if row is not None:
                self.camera.options = tuple(cameras_of(row.embodiment))
            self._draw()

    def close(self) -> None:
        """Free the renderer."""
        with self._busy:
            if self._start is not None:
                self._start.close()
            self._start, self._drawn = None, ()

    def _draw(self) -> None:
        """Draw what is chosen, unless it is shown."""
        with self._busy:
            kind, level, camera = str(self.kind.value), int(self.level.value), str(self.camera.value)
            wanted = (self._scene and self._scene[0].id, kind, level, camera)
            if wanted == self._drawn:
                return
            self._drawn = wanted
            self.level.disabled = kind in (OFF, CLEAN)
            try:
                note = "" if kind == OFF or self._scene is None else self._shown(*self._scene, kind, level, camera)
                self.image.visible = bool(note)
                self.told.content = template("studio_fault.html").render(note=note)
            except FAULTS as error:
                self.image.visible = False
                self.told.content = template("studio_fault.html").render(fault=one_line(error))

    def _shown(self, row: PoolRow, scenario: Scenario, kind: str, level: int, camera: str) -> str:
        """Show the picture; returns what is said about it.

        Raises:
            ScengenError: the camera does not show the kind, the task has no other wording, or there is no OpenGL.
        """
        words, eye = Words.of(row.task, row.instruction, self._search), cameras_of(row.embodiment)[camera]
        perturbation = Perturbation(() if kind == CLEAN else ((kind, level),))
        perturbation.check((), [eye], ROOM)
        drawn = perturbation.of(row.id, words=words)
        if self._start is None:
            self._start = Start(row, scenario, ROOM, SIZE)
        self.image.image = self._start.picture(eye, drawn)
        return drawn.instruction or ("clean" if kind == CLEAN else _strength(kind_of(kind), level))


def choices() -> tuple[str, ...]:
    """Choices: the kinds of perturbation that a single picture or the instruction shows, and two more."""
    effects = ((name, kind.effect) for name, kind in kinds().items())
    return OFF, CLEAN, *(n for n, e in effects if e.reads in (PICTURES, LANGUAGE) and not e.is_late)


def _strength(kind: Kind, level: int) -> str:
    """Kind, level and strength as text."""
    return f"{kind.name}@{level}: {kind.strengths[level - 1]:g} {kind.unit}"
