"""Devices that a person, a file or a program drives with: each gives raw events of a pad."""

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from ...errors import BadConfig, ForeignCode, UnknownName, cut
from ...work.foreign import at_fault, factory_of, is_factory
from .pad import PadEvent, TimedEvents, read_events
from .session import RUNNING, SETTLING, StateLine

GAMEPAD = "gamepad"
KEYBOARD = "keyboard"
SCRIPT = "script:"
"""Prefix of the name of a file of events."""
KNOWN_DEVICES = (GAMEPAD, KEYBOARD, f"{SCRIPT}FILE", "module:factory")


class EndedByOperator(Exception):
    """The person has closed the window of a run."""


class Device(Protocol):
    """Source of events."""

    paced: bool
    """Whether takes run in real time, as for people."""

    def begin(self) -> None:
        """Prepare for a take."""
        ...

    def read(self, line: StateLine) -> Sequence[PadEvent] | None:
        """Events since the last call, or None if there are none for the rest of the take.

        Args:
            line: what the person reads on the screen.
        """
        ...

    def close(self) -> None: ...


class Script:
    """Events of a file, which is read once for each take. A take's log is such a file."""

    paced = False

    def __init__(self, path: Path):
        self._events: TimedEvents = read_events(path)
        self._last = max(self._events, default=-1)
        self._tick = 0

    def begin(self) -> None:
        self._tick = 0

    def read(self, line: StateLine) -> Sequence[PadEvent] | None:
        tick, self._tick = self._tick, self._tick + 1
        if tick > self._last and line.phase not in (RUNNING, SETTLING):  # a pushed tile may fall after the last event
            return None
        return self._events.get(tick, ())

    def close(self) -> None:
        pass


class Program:
    """A program that reads the state line and presses the controls, as a person does."""

    paced = False

    def __init__(self, name: str):
        self._name, self._factory = name, factory_of("device", name)

    def begin(self) -> None:
        """Make the program of a take.

        Raises:
            ForeignCode: its factory raises an error.
            BadConfig: the factory returned something without a method `read`.
        """
        try:
            self._program = self._factory()
        except Exception as error:
            raise at_fault("device", self._name, "its factory fails", error) from error
        if not callable(getattr(self._program, "read", None)):
            what = f"its factory returned {type(self._program).__name__}, which has no method read"
            raise BadConfig(f"device = {cut(self._name)}; {what}; see the class Device in scengen.demos.teleop.devices")

    def read(self, line: StateLine) -> Sequence[PadEvent] | None:
        try:
            events = self._program.read(line)
            return None if events is None else [PadEvent(str(event.control), float(event.value)) for event in events]
        except ForeignCode:
            raise
        except Exception as error:
            raise at_fault("device", self._name, "its method read fails", error) from error

    def close(self) -> None:
        pass


def kind_of(name: str) -> str:
    """Kind of a device, without the name of a file or of a program."""
    return "script" if name.startswith(SCRIPT) else "program" if is_factory(name) else name


def unpaced_device(name: str) -> Device | None:
    """The device of a file or of a program; None for one that a person holds.

    Raises:
        ScengenError: there is no such device, or its file or module cannot be read.
    """
    if name in (GAMEPAD, KEYBOARD):
        return None
    if name.startswith(SCRIPT):
        return Script(Path(name.removeprefix(SCRIPT)))
    if is_factory(name):
        return Program(name)
    raise UnknownName("device", name, KNOWN_DEVICES)
