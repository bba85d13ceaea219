"""A gamepad without hardware: SDL's virtual joystick, through the library that pygame has loaded.

`python tests/teleop/virtual_pad.py` measures how long an event takes from the pad to the robot, and how
regular the loop is.
"""

import ctypes
import os
import random
import threading
import time
from pathlib import Path

import numpy as np

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")

import pygame

from scengen import load_task
from scengen.demos.teleop.drive import Timing, drive
from scengen.demos.teleop.pad import BUTTONS, STICKS, TRIGGERS
from scengen.demos.teleop.sdl import Gamepad
from scengen.demos.teleop.session import Session, Stage
from scengen.validate.rebuilt import rebuild

GAME_CONTROLLER = 1
"""SDL_JOYSTICK_TYPE_GAMECONTROLLER."""
DURATION = 10.0
"""Duration of a measurement [s]."""


def _sdl() -> ctypes.CDLL:
    """The very library that pygame uses: another copy would have other joysticks."""
    folder = Path(pygame.__file__).parents[1] / "pygame.libs"
    library = ctypes.CDLL(str(next(folder.glob("libSDL2-2*"))))
    library.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
    library.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    library.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    return library


class VirtualPad:
    """A pad that is plugged in until `unplug` is called. SDL must be initialised."""

    def __init__(self) -> None:
        self._sdl = _sdl()
        self._index = self._sdl.SDL_JoystickAttachVirtual(GAME_CONTROLLER, len((*STICKS, *TRIGGERS)), len(BUTTONS), 1)
        if self._index < 0:
            raise RuntimeError("SDL cannot attach a virtual joystick")
        opened = pygame.joystick.Joystick(self._index)
        self._pointer = self._sdl.SDL_JoystickFromInstanceID(opened.get_instance_id())
        self._opened = opened
        for trigger in TRIGGERS:
            self.set(trigger, 0.0)

    def set(self, control: str, value: float) -> None:
        """Move an axis or press a button."""
        if control in BUTTONS:
            self._sdl.SDL_JoystickSetVirtualButton(self._pointer, BUTTONS.index(control), int(value))
        else:
            raw = value if control in STICKS else 2.0 * value - 1.0  # a joystick's trigger rests at its lower end
            self._sdl.SDL_JoystickSetVirtualAxis(self._pointer, (*STICKS, *TRIGGERS).index(control), round(32767 * raw))

    def unplug(self) -> None:
        """Take the pad out."""
        self._sdl.SDL_JoystickDetachVirtual(self._index)


class _Timed(Session):
    """A take that remembers when each event on a stick has become an action, and when that has been simulated."""

    def __init__(self, stage: Stage):
        super().__init__(stage)
        self.acted: dict[float, float] = {}
        self.effects: dict[float, float] = {}
        self._values: list[float] = []

    def tick(self, events=()):
        self._values = [event.value for event in events if event.control == "leftx"]
        super().tick(events)
        self.effects |= dict.fromkeys(self._values, time.perf_counter())

    def _step(self, action):
        self.acted |= dict.fromkeys(self._values, time.perf_counter())
        super()._step(action)


def measure(seconds: float = DURATION) -> tuple[Timing, list[float], list[float]]:
    """Drive with a virtual pad whose stick moves at random times.

    Returns:
        Times of the loop, and the delays from each event to its action, and to the end of that control period [s].
    """
    device = Gamepad()
    pad = VirtualPad()
    scenario = load_task("domino_single").nominal
    session = _Timed(Stage("domino_single", scenario, rebuild(scenario), "panda_jaw", 2 * seconds + 10, 1.0))
    sent: dict[float, float] = {}

    def press() -> None:
        draw, end, number = random.Random(0), time.perf_counter() + seconds, 0
        pad.set("start", 1.0)
        while time.perf_counter() < end:
            time.sleep(draw.uniform(0.02, 0.08))
            number += 1
            value = round((number % 500 + 1) / 1000 * 32767) / 32767  # each one only once, and within the dead zone
            sent[round(value, 5)] = time.perf_counter()
            pad.set("leftx", value)
        pad.set("back", 1.0)

    timing, thread = Timing(), threading.Thread(target=press)
    thread.start()
    drive(session, device, timing)
    thread.join()
    device.close()
    acted, effects = (
        [found[value] - at for value, at in sent.items() if value in found]
        for found in (session.acted, session.effects)
    )
    return timing, acted, effects


def main() -> None:
    timing, acted, effects = measure()
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for what, delays in (("its action", acted), ("the simulated motion", effects)):
        print(f"{len(delays)} events of a pad; from the event to {what}, in ms:")
        print("  median {:.1f}, 95 % {:.1f}, 99 % {:.1f}".format(*(1000 * np.quantile(delays, [0.5, 0.95, 0.99]))))
    print(f"{len(timing.late)} control periods; delay of their beginning, in ms:")
    late = 1000 * np.quantile(timing.late, [0.5, 0.95, 0.99])
    print("  median {:.2f}, 95 % {:.2f}, 99 % {:.2f}".format(*late))


if __name__ == "__main__":
    main()
