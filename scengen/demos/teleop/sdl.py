"""Gamepad, keyboard and window by SDL, through pygame: the extra `teleop`."""

import os
from collections.abc import Sequence

import numpy as np

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")  # a pad is heard when another window has the focus

import pygame
from pygame._sdl2 import controller

from .devices import EndedByOperator
from .eye import Eye
from .pad import BUTTONS, CONNECTED, STICKS, TRIGGERS, Pad, PadEvent
from .session import Session, StateLine

FULL_AXIS = 32767
"""Value of SDL for a fully deflected axis."""
AXES = (*STICKS, *TRIGGERS)
"""Axes in SDL's order."""
KEYS: dict[str, tuple[str, float]] = {
    "w": ("lefty", -1.0),
    "s": ("lefty", 1.0),
    "a": ("leftx", -1.0),
    "d": ("leftx", 1.0),
    "up": ("righty", -1.0),
    "down": ("righty", 1.0),
    "left": ("rightx", -1.0),
    "right": ("rightx", 1.0),
    "r": ("rightshoulder", 1.0),
    "f": ("leftshoulder", 1.0),
    "q": ("dpleft", 1.0),
    "e": ("dpright", 1.0),
    "c": ("righttrigger", 1.0),
    "v": ("lefttrigger", 1.0),
    "space": ("a", 1.0),
    "left shift": ("b", 1.0),
    "tab": ("y", 1.0),
    "backspace": ("x", 1.0),
    "return": ("start", 1.0),
    "escape": ("back", 1.0),
}
"""Control and value of a pad for each key."""
KEYS_TOLD = """\
W S A D: forwards, backwards, left, right    R F: up, down      arrows: tilt     Q E: turn
C: close slowly, V: open slowly     space: close or open at once     left shift held: no motion
tab: next arm     backspace: undo one second     return: pause, go on, keep     escape: give up
"""
"""The keys as text."""
LINE_HEIGHT = 40
"""Height of the state line below the picture [pixels]."""


class _Sdl:
    """Base of gamepad and keyboard: SDL's queue of events, which belongs to the process."""

    paced = True

    def __init__(self) -> None:
        if not pygame.display.get_init():
            if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
                os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
            pygame.display.init()
        self.pad = Pad()
        """Values of all controls as last reported by the device."""

    def begin(self) -> None:
        """Forget the events between two takes, except for those that say how the device is held."""
        self._translated()
        held = (*STICKS, *TRIGGERS, CONNECTED)
        self._first: list[PadEvent] = [event for event in self.pad.changed() if event.control in held]

    def read(self, line: StateLine) -> Sequence[PadEvent] | None:
        """The events since the last call.

        Raises:
            EndedByOperator: the window was closed.
        """
        events, self._first = [*self._first, *self._translated()], []
        return events

    def close(self) -> None:
        pygame.display.quit()

    def _translated(self) -> list[PadEvent]:
        found: list[PadEvent] = []
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                raise EndedByOperator
            found += self.translate(event)
        self.pad.update(found)
        return found

    def translate(self, event: pygame.event.Event) -> list[PadEvent]:
        """Events of a pad for an event of SDL."""
        raise NotImplementedError


class Gamepad(_Sdl):
    """The first gamepad that is plugged in. SDL's mappings give Xbox, PlayStation and Switch pads the same names."""

    def __init__(self) -> None:
        super().__init__()
        controller.init()
        self._opened: controller.Controller | None = None
        self._number = -1
        """SDL's number of the opened pad."""
        self.pad.update([PadEvent(CONNECTED, 0.0), *self._open()])

    def close(self) -> None:
        controller.quit()
        super().close()

    def translate(self, event: pygame.event.Event) -> list[PadEvent]:
        if event.type == pygame.CONTROLLERDEVICEADDED:
            return self._open() if self._opened is None else []
        if self._opened is None or getattr(event, "instance_id", None) != self._number:
            return []
        if event.type == pygame.CONTROLLERDEVICEREMOVED:
            self._opened = None
            return [PadEvent(CONNECTED, 0.0)]
        if event.type == pygame.CONTROLLERAXISMOTION and event.axis < len(AXES):
            return [_moved(event.axis, event.value)]
        pressed = event.type == pygame.CONTROLLERBUTTONDOWN
        if (pressed or event.type == pygame.CONTROLLERBUTTONUP) and event.button < len(BUTTONS):
            return [PadEvent(BUTTONS[event.button], float(pressed))]
        return []

    def _open(self) -> list[PadEvent]:
        """Use the first pad, if there is one, and report the positions of its axes: SDL reports only changes."""
        if not controller.get_count() or not controller.is_controller(0):
            return []
        self._opened = controller.Controller(0)
        self._number = self._opened.as_joystick().get_instance_id()
        held = [_moved(axis, self._opened.get_axis(axis)) for axis in range(len(AXES))]
        return [PadEvent(CONNECTED, 1.0), *(event for event in held if event.value)]


def _moved(axis: int, value: int) -> PadEvent:
    """Event of an axis for a number of SDL, which reaches from -32768 to 32767 for sticks and from 0 for triggers."""
    name = AXES[axis]
    return PadEvent(name, round(max(-1.0 if name in STICKS else 0.0, value / FULL_AXIS), 5))


class Keyboard(_Sdl):
    """A keyboard that acts as a pad. SDL hears the keys of its own window."""

    def __init__(self) -> None:
        super().__init__()
        self._down: set[str] = set()

    def translate(self, event: pygame.event.Event) -> list[PadEvent]:
        if event.type == pygame.WINDOWFOCUSLOST:  # the releases of keys go to another window
            self._down.clear()
        elif event.type in (pygame.KEYDOWN, pygame.KEYUP) and (key := pygame.key.name(event.key)) in KEYS:
            (self._down.add if event.type == pygame.KEYDOWN else self._down.discard)(key)
        else:
            return []
        wanted = Pad()
        for name in {control for control, _ in KEYS.values()}:
            total = sum(value for key, (control, value) in KEYS.items() if control == name and key in self._down)
            wanted.update([PadEvent(name, float(np.clip(total, -1.0, 1.0)))])
        names = dict.fromkeys(control for control, _ in KEYS.values())
        return [PadEvent(name, wanted[name]) for name in names if wanted[name] != self.pad[name]]


class Window:
    """Shows the scene as it is driven, and the state line."""

    def __init__(self, session: Session, width: int, height: int, camera: str | None):
        """Open the window with its first picture.

        Args:
            camera: see `Eye`.

        Raises:
            UnknownName: there is no such camera.
            NoPictures: OpenGL is missing.
        """
        self._eye = Eye(session, width, height, camera)  # a person could not see what moves before the first picture
        pygame.font.init()
        self._font, self._height = pygame.font.Font(None, 18), height
        self._surface = pygame.display.set_mode((width, height + LINE_HEIGHT))
        pygame.display.set_caption("scengen demos pad")

    @property
    def drawn(self) -> int:
        """Number of pictures so far."""
        return self._eye.drawn

    def show(self, session: Session) -> None:
        """Show the state of a take, with the latest picture that is ready.

        Raises:
            ScengenError: pictures cannot be drawn.
        """
        self._eye.look(session)
        line, picture = session.line, self._eye.picture
        self._surface.fill((16, 16, 16))
        self._surface.blit(pygame.image.frombuffer(picture.tobytes(), picture.shape[1::-1], "RGB"), (0, 0))
        colour = {"success": (120, 230, 120), None: (230, 230, 230)}.get(line.outcome, (250, 120, 110))
        for row, text in enumerate((line.text, line.message)):
            self._surface.blit(self._font.render(text, True, colour), (6, self._height + 4 + 18 * row))
        pygame.display.flip()

    def close(self) -> None:
        """End the thread that draws."""
        self._eye.close()
