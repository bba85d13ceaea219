"""Playing of films in the browser: a clock, a slider, buttons and keys."""

import threading
import time
from collections.abc import Callable
from typing import Any

import viser

from .scene import FRAME_PERIODS, Film, SceneView

FRAME_TIME = FRAME_PERIODS / 100
"""Time between two frames [s]."""
SPEEDS = ("0.25", "0.5", "1", "2", "4")
"""Speeds of playing."""


class Player:
    """Controls of one film in a panel. A thread moves the bodies; `close` ends it."""

    def __init__(self, client: viser.ClientHandle, view: SceneView, moved: Callable[[float], None] | None = None):
        """Add the controls to the present container.

        Args:
            moved: called with the time of each frame that is shown [s].
        """
        self._client, self._view, self._moved = client, view, moved
        self._film: Film | None = None
        self._playing, self._closed, self._lock = threading.Event(), False, threading.RLock()
        self._slider: viser.GuiSliderHandle[float] = client.gui.add_slider("time [s]", 0.0, 1.0, FRAME_TIME, 0.0)
        self._buttons = client.gui.add_button_group("", ("play", "pause", "start", "step"))
        self._speed = client.gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self.outcome = client.gui.add_html("")
        self._buttons.on_click(lambda event: self.press(event.target.value))
        self._slider.on_update(self._scrubbed)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def load(self, film: Film, play: bool) -> None:
        """Show a film from its start."""
        with self._lock:
            self._film = film
            self._slider.max = max(FRAME_TIME, round(film.seconds, 2))
            self.seek(0.0)
        (self._playing.set if play else self._playing.clear)()

    def unload(self) -> None:
        """Show no film."""
        self._playing.clear()
        with self._lock:
            self._film = None

    def press(self, button: str) -> None:
        """Act on a button: play, pause, start or step."""
        if button == "play":
            if self._film and self._slider.value >= self._slider.max - FRAME_TIME / 2:
                self.seek(0.0)
            self._playing.set()
            return
        self._playing.clear()
        if button == "start":
            self.seek(0.0)
        elif button == "step":
            self.seek(self._slider.value + FRAME_TIME)

    def toggle(self) -> None:
        """Play, or pause."""
        self.press("pause" if self._playing.is_set() else "play")

    def seek(self, seconds: float) -> None:
        """Show the frame of a time [s]."""
        with self._lock:
            if self._film is None:
                return
            number = min(max(0, round(seconds / FRAME_TIME)), len(self._film.frames) - 1)
            self._slider.value = round(min(number * FRAME_TIME, self._slider.max), 2)
            self._place(number)

    def close(self) -> None:
        self._closed = True
        self._playing.set()

    def _scrubbed(self, event: Any) -> None:
        if event.client is not None and self._film is not None:  # moved by the person
            with self._lock:
                self._place(min(round(self._slider.value / FRAME_TIME), len(self._film.frames) - 1))

    def _place(self, number: int) -> None:
        film = self._film
        if film is None:
            return
        with self._client.atomic():
            self._view.move(film.frames[number])
        if self._moved is not None:
            self._moved(number * FRAME_TIME)

    def _run(self) -> None:
        while True:
            self._playing.wait()
            if self._closed:
                return
            begun = time.monotonic()
            with self._lock:
                if self._film is not None:
                    here = self._slider.value + FRAME_TIME * float(self._speed.value)
                    if here > self._slider.max:
                        here = self._slider.max
                        self._playing.clear()
                    self.seek(here)
            time.sleep(max(0.0, FRAME_TIME - (time.monotonic() - begun)))
