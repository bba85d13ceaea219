"""Raw events of a gamepad, and files of them."""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ...control.loop import Loop
from ...errors import BadConfig, UnknownName, cut
from ...pool.untrusted import Malformed, read_json
from ...work.plain import read_plain

STICKS = ("leftx", "lefty", "rightx", "righty")
"""Axes of the two sticks, in [-1, 1]; right and down are positive. All names are those of SDL's mappings."""
TRIGGERS = ("lefttrigger", "righttrigger")
"""Axes of the two triggers, in [0, 1]."""
BUTTONS = (
    *("a", "b", "x", "y", "back", "guide", "start", "leftstick", "rightstick"),
    *("leftshoulder", "rightshoulder", "dpup", "dpdown", "dpleft", "dpright"),
)
"""Buttons, 0 or 1."""
CONNECTED = "connected"
"""Control that reports whether the pad is plugged in, 0 or 1."""
CONTROLS = (*STICKS, *TRIGGERS, *BUTTONS, CONNECTED)
MAX_SECONDS = 3600.0
"""Latest time of an event in a file [s]."""
MAX_FILE = 50_000_000
"""Size of the largest file of events that is read [bytes]: an hour of a stick that moves in every control period takes
half of it."""


@dataclass(frozen=True)
class PadEvent:
    """A change of one control of a pad."""

    control: str
    """One of `CONTROLS`."""
    value: float
    """New value of the control."""

    def check(self) -> "PadEvent":
        """Raise `ScengenError` for a control that does not exist, or a value out of its range."""
        if self.control not in CONTROLS:
            raise UnknownName("control of a pad", self.control, CONTROLS)
        low = -1.0 if self.control in STICKS else 0.0
        if not low <= self.value <= 1.0:
            raise BadConfig(f"{self.control} = {self.value}; it must lie in [{low:g}, 1]")
        if self.control not in (*STICKS, *TRIGGERS) and self.value not in (0, 1):
            raise BadConfig(f"{self.control} = {self.value}; a button is 0 or 1")
        return self


class Pad:
    """Present values of all controls."""

    def __init__(self) -> None:
        self._values = {**dict.fromkeys(CONTROLS, 0.0), CONNECTED: 1.0}

    def __getitem__(self, control: str) -> float:
        return self._values[control]

    def update(self, events: Iterable[PadEvent]) -> set[str]:
        """Take over some events.

        Returns:
            Controls that have changed from 0: buttons that were pressed.
        """
        pressed = set()
        for event in events:
            if event.value and not self._values[event.control]:
                pressed.add(event.control)
            self._values[event.control] = event.value
        return pressed

    def changed(self) -> list[PadEvent]:
        """Events that lead from a pad at rest to the present values."""
        rest = Pad()
        return [PadEvent(name, value) for name, value in self._values.items() if value != rest[name]]


TimedEvents = dict[int, list[PadEvent]]
"""Events by the control period at whose beginning they act."""


def line_of(tick: int, event: PadEvent) -> str:
    """An event as a line of a file."""
    return json.dumps({"t": round(tick * Loop.PERIOD, 2), "control": event.control, "value": event.value})


def read_events(path: Path) -> TimedEvents:
    """Read a file of events: JSON lines such as `{"t": 1.25, "control": "leftx", "value": -0.5}`, with t in seconds.

    Lines without `control` are comments, such as the first and the last one of a take's log.

    Raises:
        BadConfig: the file is missing or too large, or a line is not an event.
    """
    try:
        lines = read_plain(path, MAX_FILE).decode().splitlines()
    except (OSError, ValueError) as error:
        what = "it is not text" if isinstance(error, UnicodeDecodeError) else str(error)
        why = " ".join((getattr(error, "strerror", "") or what).split()).lower()
        raise BadConfig(f"{cut(str(path))} cannot be read: {why}; give a file of JSON lines, script:FILE") from None
    found: TimedEvents = {}
    last = 0
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            tick, event = _event(read_json(line))
        except (Malformed, BadConfig, UnknownName) as error:
            raise BadConfig(f"{cut(str(path))}, line {number}: {error}") from None
        if event is None:
            continue
        if tick < last:
            raise BadConfig(f"{cut(str(path))}, line {number}: t goes back; events must stand in the order of time")
        last = tick
        found.setdefault(tick, []).append(event)
    return found


def _event(plain: object) -> tuple[int, PadEvent | None]:
    """Control period and event of a line; no event for a comment."""
    if not isinstance(plain, dict):
        raise BadConfig('not an event; a line is like {"t": 1.25, "control": "leftx", "value": -0.5}')
    if "control" not in plain:
        return 0, None
    if missing := [name for name in ("t", "value") if name not in plain]:
        raise BadConfig(f"{missing[0]} is missing; a line has t, control and value")
    if others := sorted(set(plain) - {"t", "control", "value"}):
        raise UnknownName("key", others[0], ["t", "control", "value"])
    moment, control, value = plain["t"], plain["control"], plain["value"]
    for name, number in (("t", moment), ("value", value)):
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not math.isfinite(number):
            raise BadConfig(f"{name} = {cut(repr(number))}; it must be a number")
    if not 0 <= moment <= MAX_SECONDS:
        raise BadConfig(f"t = {moment:g}; it must lie in [0, {MAX_SECONDS:g}] s")
    return round(moment / Loop.PERIOD), PadEvent(str(control), float(value)).check()
