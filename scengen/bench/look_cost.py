"""Costs of the room relative to the plain look: of a picture, and of the start of a scenario."""

import time
from collections.abc import Iterator
from contextlib import closing

from ..look.looks import PLAIN, ROOM, Look
from ..pictures.render import Camera, check_pictures
from ..pool import PoolRow
from ..validate.playable import stored_world
from .timing import Measure, Side, alternated, ratio

SIZE = 256
"""Edge of the pictures [pixels]: that of environments by default."""
CAMERA = "agentview"
"""Camera of the pictures, robosuite's name."""
PICTURES = 10
"""Number of pictures in a repetition."""


def look_ratios(row: PoolRow, repeats: int) -> dict[str, Measure]:
    """Ratios of the processor time of all threads, by name.

    Args:
        row: a scenario.

    Raises:
        NoPictures: OpenGL is missing.
    """
    check_pictures()
    looks = (ROOM, PLAIN)
    pictures = alternated([_pictures(row, look) for look in looks], repeats, time.process_time)
    starts = alternated([_starts(row, look) for look in looks], repeats, time.process_time)
    return {"room_picture_to_plain": ratio(pictures), "room_start_to_plain": ratio(starts)}


def _pictures(row: PoolRow, look: Look) -> Side:
    """Pictures of the start of a scenario. The first one, which fills caches, is not counted."""

    def pictures() -> Iterator[None]:
        camera = Camera(stored_world(row, look), SIZE, SIZE)
        camera.take(CAMERA)
        return _taken(camera)

    return pictures


def _taken(camera: Camera) -> Iterator[None]:
    with closing(camera):
        for _ in range(PICTURES):
            camera.take(CAMERA)
            yield


def _starts(row: PoolRow, look: Look) -> Side:
    """The start of a scenario, from its text to its first picture."""

    def starts() -> Iterator[None]:
        with closing(Camera(stored_world(row, look), SIZE, SIZE)) as camera:
            camera.take(CAMERA)
        yield

    return starts
