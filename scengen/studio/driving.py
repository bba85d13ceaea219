"""Driving in the browser: takes run at 100 Hz on the server, pads and keys are those of the browsers."""

import contextlib
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser
from websockets.asyncio.server import ServerConnection

from ..demos.teleop.collect import Run, Source, TeleopSettings
from ..demos.teleop.devices import EndedByOperator
from ..demos.teleop.drive import Timing, drive
from ..demos.teleop.eye import POLICY_CAMERA, Eye
from ..demos.teleop.pad import CONNECTED, CONTROLS, PadEvent
from ..demos.teleop.session import Session, StateLine
from ..envs.observations import turns_pictures
from ..errors import ScengenError
from ..look.looks import ROOM
from ..pictures.page import template
from ..pictures.render import Picture
from ..pool.untrusted import Malformed, read_json
from ..sim.world import World
from .scene import Poses, SceneView, poses_of

MAX_MESSAGE = 100
"""Length of the longest message of a pad [characters]."""
PICTURE = (320, 240)
"""Size of the picture that shows what a policy sees [pixels]."""
PICTURES_PER_SECOND = 10.0
"""Rate of these pictures: drawn in software they must leave time for the control loop."""
LINE_PERIOD = 0.1
"""Time between two updates of the state line [s]: drawing text costs a browser as much as moving bodies."""


class BrowserPad:
    """The pads and keys of all browsers, as one device. Without a browser it is unplugged."""

    paced = True

    def __init__(self) -> None:
        self._lock, self._events = threading.Lock(), list[PadEvent]()
        self._browsers, self._closed = 0, False

    def begin(self) -> None:
        """Forget the events between two takes."""
        with self._lock:
            self._events = [] if self._browsers else [PadEvent(CONNECTED, 0.0)]

    def read(self, line: StateLine) -> Sequence[PadEvent] | None:
        """The events since the last call.

        Raises:
            EndedByOperator: the studio is closed.
        """
        if self._closed:
            raise EndedByOperator
        with self._lock:
            events, self._events = self._events, []
        return events

    def close(self) -> None:
        self._closed = True

    async def serve(self, connection: ServerConnection) -> None:
        """Take the events of one browser until it leaves. One that sends something else is disconnected."""
        self._count(1)
        try:
            async for message in connection:
                if not isinstance(message, str):
                    return
                event = _event(message)
                with self._lock:
                    self._events.append(event)
        except (Malformed, ScengenError):
            with contextlib.suppress(Exception):
                await connection.close(1008, "not an event of a pad")
        finally:
            self._count(-1)

    def _count(self, change: int) -> None:
        """Note that a browser has come or left; the first and the last one plug the pad in and out."""
        with self._lock:
            before, self._browsers = self._browsers, self._browsers + change
            if bool(before) != bool(self._browsers):
                rest = [PadEvent(name, 0.0) for name in CONTROLS if name != CONNECTED]
                self._events += [PadEvent(CONNECTED, 1.0)] if self._browsers else [*rest, PadEvent(CONNECTED, 0.0)]


def _event(message: str) -> PadEvent:
    """The event of a message `["leftx", 0.5]`.

    Raises:
        ScengenError, Malformed: it is none.
    """
    plain = read_json(message, MAX_MESSAGE)
    if not (isinstance(plain, list) and len(plain) == 2 and isinstance(plain[0], str)):
        raise Malformed("not a control and its value")
    if isinstance(plain[1], bool) or not isinstance(plain[1], (int, float)):
        raise Malformed("the value is not a number")
    return PadEvent(plain[0], float(plain[1])).check()


class Driver:
    """The robot that the browsers drive: one take after the other, in a thread. All pages see the same."""

    def __init__(self, source: Source, settings: TeleopSettings):
        """Check the run and its folder.

        Raises:
            ScengenError: the settings are not valid, or the folder cannot be written or belongs to another run.
        """
        self.source, self.settings, self.pad, self.timing = source, settings, BrowserPad(), Timing()
        self.session: Session | None = None
        """The latest take; None before the first one."""
        self.told: list[str] = []
        """Results of the takes, as text."""
        self.turned = turns_pictures(source.task.family)
        """Whether a policy may see the scenarios turned or mirrored; then pages show a picture of what it sees."""
        self._eye: Eye | None = None
        self._pages: dict[int, DrivePage] = {}
        self._lock = threading.Lock()
        with contextlib.closing(Run(source, settings)):
            pass
        self._thread = threading.Thread(target=self._drive, daemon=True)

    def start(self) -> None:
        """Start with the first take."""
        self._thread.start()

    def close(self) -> None:
        """End the present take, which is not kept, and write the demonstrations."""
        self.pad.close()
        self._thread.join()

    def add(self, number: int, page: "DrivePage") -> None:
        """Show the takes on a page."""
        with self._lock:
            self._pages[number] = page

    def remove(self, number: int) -> None:
        """Forget a page."""
        with self._lock:
            self._pages.pop(number, None)

    def _drive(self) -> None:
        """Drive all takes; the journal belongs to this thread."""
        try:
            with contextlib.closing(Run(self.source, self.settings, self.told.append)) as run:
                self._takes(run)
                run.write()
        except ScengenError as error:
            self.told.append(str(error))
        eye, self._eye = self._eye, None
        if eye is not None:
            eye.close()
        if self.session is not None:
            self._show(self.session)

    def _takes(self, run: Run) -> None:
        try:
            for place in run.places():
                self.session = Session(place.stage)
                if self.turned and self._eye is None:
                    self._eye = Eye(self.session, *PICTURE, POLICY_CAMERA, PICTURES_PER_SECOND)
                drive(self.session, self.pad, self.timing, self._show)
                run.add(place, self.session)
            self.told.append("all takes are driven; end the studio with Ctrl-C")
        except EndedByOperator:
            self.told.append("ended")

    def _show(self, session: Session) -> None:
        picture = None
        if self._eye is not None:
            self._eye.look(session)
            picture = self._eye.picture
        state = Shown(session, session.line, poses_of(session.world), self.told[-1] if self.told else "", picture)
        with self._lock:
            for page in self._pages.values():
                page.show(state)


@dataclass(frozen=True)
class Shown:
    """A state of a take as pages show it."""

    session: Session
    line: StateLine
    poses: Poses
    told: str
    """Result of the latest take, as text."""
    picture: Picture | None
    """Picture that a policy sees, if its pictures may be turned."""


class DrivePage:
    """Page of the takes in one browser. A separate thread sends, so that the control loop does not wait."""

    def __init__(self, client: viser.ClientHandle, driver: Driver):
        self._client, self._view = client, SceneView(client.scene, "/drive")
        self._line = client.gui.add_html("")
        client.gui.add_html(template("studio_keys.html").render(instruction=driver.source.task.instruction))
        self._picture: viser.GuiImageHandle | None = None
        if driver.turned:
            blank = np.zeros((PICTURE[1], PICTURE[0], 3), np.uint8)
            self._picture = client.gui.add_image(blank, label="what a policy sees", format="jpeg")
        self._shown: Session | None = None
        self._latest: Shown | None = None
        self._fresh, self._closed = threading.Condition(), False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def show(self, state: Shown) -> None:
        """Show a state; one that was not sent yet is replaced."""
        with self._fresh:
            self._latest = state
            self._fresh.notify()

    def close(self) -> None:
        with self._fresh:
            self._closed = True
            self._fresh.notify()

    def _run(self) -> None:
        seen: Picture | None = None
        due, said = 0.0, ("", "")
        while True:
            with self._fresh:
                self._fresh.wait_for(lambda: self._latest is not None or self._closed)
                if self._closed or self._latest is None:
                    return
                state, self._latest = self._latest, None
            with self._client.atomic():
                if state.session is not self._shown:
                    stage, self._shown = state.session.stage, state.session
                    self._view.show(World.load(stage.scene_xml, stage.embodiment, look=ROOM))
                self._view.move(state.poses)
                if time.monotonic() >= due or (state.line.phase, state.told) != said:
                    due, said = time.monotonic() + LINE_PERIOD, (state.line.phase, state.told)
                    self._line.content = template("studio_line.html").render(line=state.line, told=state.told)
                if self._picture is not None and state.picture is not None and state.picture is not seen:
                    self._picture.image = seen = state.picture
