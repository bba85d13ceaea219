"""drive the robot with a gamepad or a keyboard, and keep the takes that succeed as demonstrations"""

import os
import sys
from collections.abc import Sequence
from contextlib import closing
from types import ModuleType

from ... import compose
from ...demos.teleop.collect import Run, Source, TeleopSettings
from ...demos.teleop.devices import GAMEPAD, KEYBOARD, Device, EndedByOperator, unpaced_device
from ...demos.teleop.drive import Timing, drive
from ...demos.teleop.session import CONTROLS, Session
from ...errors import BadConfig
from ...ood.analysis.redraw import task_of
from ...pool import Pool
from ...samplers.task_files import search_path
from ...validate.settings import CertifySettings
from ...work.extras import module_of_extra
from ...work.typed import typed
from . import FAILED, OK, Arguments, one, say, warn
from .settings import read, task_overrides


def command(arguments: Arguments) -> int:
    settings = read("demos pad", arguments, TeleopSettings)
    settings.check()
    source = _source(settings, arguments)
    shown = settings.view if settings.view is not None else settings.device in (GAMEPAD, KEYBOARD) and _display()
    if shown and not _display():
        raise BadConfig("view = true, but there is no display; leave it out, or drive in the browser: scengen studio")
    if settings.device == KEYBOARD and not shown:
        raise BadConfig("device = keyboard needs a window, and there is no display; see scengen studio")
    device = unpaced_device(settings.device) or _person(settings.device)
    timing = Timing()
    with closing(device), closing(Run(source, settings, say)) as run, closing(Screen(settings)) as screen:
        ended = _drive_all(run, device, timing, screen if shown else None)
        summary = run.write()
    say(f"{summary.demonstrations.folder}: {summary.made} demonstrations of {len(run.records)} takes, {ended}")
    say(f"sha256: {summary.demonstrations.sha256}")
    if timing.late:
        say(timing.told())
    if summary.made < settings.n:
        warn(f"scengen: only {summary.made} of {settings.n} demonstrations; repeat the command to go on")
    return OK if summary.made >= settings.n else FAILED


def _source(settings: TeleopSettings, arguments: Arguments) -> Source:
    """The scenarios of a task or of a pool.

    Raises:
        ScengenError: neither or both are given, or one of them cannot be read.
    """
    name = compose.chosen_task("demos pad", arguments)
    if (name is None) == (settings.pool is None):
        raise BadConfig("demos pad needs either task=NAME or pool=FOLDER; see scengen demos pad --help")
    if name is not None:
        if settings.id is not None:
            raise BadConfig(f"id = {settings.id} names a scenario of a pool; give pool=FOLDER, or index= with task=")
        task = compose.load_task(name, [*search_path(arguments), *task_overrides(arguments)])
        return Source.of_task(task, compose.certify_levels(task)["quick"], settings)
    return source_of_pool(Pool.open(one(settings.pool)).check(), search_path(arguments), settings.id)


def source_of_pool(pool: Pool, search: Sequence[str], id: str | None) -> Source:
    """The scenarios of a pool, or one of them.

    Raises:
        ScengenError: its task cannot be loaded, or there is no such scenario.
    """
    certify_settings = typed("certify", CertifySettings, dict(pool.manifest.config.certify))
    return Source.of_pool(pool, task_of(pool, search), certify_settings, id)


def _drive_all(run: Run, device: Device, timing: Timing, screen: "Screen | None") -> str:
    """Drive takes until there are enough, or the person ends the run; return how it ended."""
    if device.paced:
        say(_sdl().KEYS_TOLD if run.settings.device == KEYBOARD else CONTROLS)
    for place in run.places():
        session = Session(place.stage)
        if device.paced:
            say(f"{place.stage.name}, take {place.take}: {run.source.task.instruction}")
        try:
            drive(session, device, timing, screen.show if screen else lambda session: None)
        except EndedByOperator:
            return "ended by the operator"
        run.add(place, session)
    return "complete" if run.made >= run.settings.n else "at the limit of takes, or of scenarios"


class Screen:
    """A window that opens with the first take."""

    def __init__(self, settings: TeleopSettings):
        self._settings, self._window = settings, None

    def show(self, session: Session) -> None:
        """Show a take."""
        if self._window is None:
            settings = self._settings
            self._window = _sdl().Window(session, settings.width, settings.height, settings.camera)
        self._window.show(session)

    def close(self) -> None:
        if self._window is not None:
            self._window.close()


def _display() -> bool:
    return sys.platform != "linux" or bool({"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys())


def _sdl() -> ModuleType:
    """The module that needs pygame."""
    return module_of_extra("scengen.demos.teleop.sdl", "gamepads and keyboards need", "teleop")


def _person(name: str) -> Device:
    device: Device = _sdl().Gamepad() if name == GAMEPAD else _sdl().Keyboard()
    return device
