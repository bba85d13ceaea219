"""The loop that drives takes: in real time for people, as fast as possible for files and programs."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ...control.loop import Loop
from .devices import Device
from .session import Session

SHOWN_EVERY = 4
"""Number of control periods between two pictures: 25 pictures a second."""
SPIN_TIME = 0.0005
"""Time before a control period that is spent waiting actively [s]: sleeping is that inaccurate."""


@dataclass
class Timing:
    """Times of a loop that was to run in real time."""

    late: list[float] = field(default_factory=list)
    """Delay of the beginning of each control period [s]."""
    reaction: list[float] = field(default_factory=list)
    """Time from reading the events of a control period until its action has been simulated [s]; only of periods with
    events."""

    def quantile(self, name: str, share: float) -> float:
        """A quantile of `late` or `reaction` [s]; 0 without a number."""
        values: list[float] = getattr(self, name)
        return float(np.quantile(values, share)) if values else 0.0

    def told(self) -> str:
        """The figures as text."""
        late, reaction = (1000 * self.quantile(name, 0.95) for name in ("late", "reaction"))
        return (
            f"{len(self.late)} control periods; 95 % started within {late:.2f} ms of their time, "
            f"and 95 % of the events became motion within {1000 * Loop.PERIOD + reaction:.1f} ms"
        )


def drive(
    session: Session, device: Device, timing: Timing, show: Callable[[Session], None] = lambda session: None
) -> None:
    """Drive a take to its end.

    Args:
        timing: receives the times of the control periods.
        show: called several times a second, and at the end.
    """
    device.begin()
    due = time.perf_counter()
    while not session.finished:
        begun = time.perf_counter()
        events = device.read(session.line)
        if events is None:
            session.finish()
            break
        session.tick(events)
        if device.paced:
            timing.late.append(max(0.0, begun - due))
            if events:
                timing.reaction.append(time.perf_counter() - begun)
            if session.ticks % SHOWN_EVERY == 0:
                show(session)
            due = max(due + Loop.PERIOD, time.perf_counter() - Loop.PERIOD)  # time that was lost is not made up for
            _wait(due)
    show(session)


def _wait(due: float) -> None:
    left = due - time.perf_counter()
    if left > SPIN_TIME:
        time.sleep(left - SPIN_TIME)
    while time.perf_counter() < due:
        pass
