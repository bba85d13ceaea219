"""Checks of the decoded pictures of one episode and one camera."""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from .checks import FROZEN_FRAMES, found
from .findings import Finding

BLUR = 0.3
"""Mean Sobel gradient below which a picture is blurred [grey levels] (paper, App. C)."""
SCENE_CHANGE = 10.0
"""Median absolute deviation of a picture from the one before, above which the scene has changed [grey levels] (paper,
App. C: MAD score)."""
FROZEN = 0.5
"""Mean difference of two pictures below which they are the same [grey levels] (lerobot-lint)."""
BLACK = 10.0
"""Mean level below which a picture is black (lerobot-lint)."""
WHITE = 245.0
"""Mean level above which a picture is white (lerobot-lint)."""
STRIDE = 4
"""Distance of the rows and columns of pictures that are compared."""


def check_video(
    camera: str, pictures: Iterable[NDArray[np.uint8]], rows: int, moving: NDArray[np.bool_]
) -> Iterator[Finding]:
    """Compare pictures with each other and with the rows.

    Args:
        camera: key of the video.
        pictures: decoded pictures, shape (height, width, 3) each.
        rows: number of rows of the episode.
        moving: whether the arm is told to move in each row, shape (rows,).
    """
    before, count, blurred, changed, dark, bright = None, 0, [], [], [], []
    same = np.zeros(rows, bool)
    for number, picture in enumerate(pictures):
        grey = picture[::STRIDE, ::STRIDE].mean(axis=2)
        gradient = np.hypot(ndimage.sobel(grey, 0), ndimage.sobel(grey, 1)).mean()
        for level, places in ((grey.mean() < BLACK, dark), (grey.mean() > WHITE, bright), (gradient < BLUR, blurred)):
            if level:
                places.append(number)
        if before is not None and number < rows:
            difference = np.abs(grey - before)
            if float(np.median(difference)) > SCENE_CHANGE:
                changed.append(number)
            same[number] = difference.max() < FROZEN
        before, count = grey, number + 1
    if count != rows:
        yield found(
            "FRAME_COUNT", f"{camera} has another number of pictures than there are rows", frames=count, rows=rows
        )
    told = {"BLUR": blurred, "SCENE_CHANGE": changed, "BLACK": dark, "WHITE": bright}
    words = {"BLUR": "is blurred", "SCENE_CHANGE": "changes at once", "BLACK": "is black", "WHITE": "is white"}
    for check, places in told.items():
        if places:
            yield found(check, f"{camera} {words[check]}", tuple(places), pictures=len(places))
    frozen = 0
    for number in range(rows):
        frozen = frozen + 1 if same[number] and moving[max(0, number - 1)] else 0
        if frozen > FROZEN_FRAMES:
            where = (number - frozen + 1, number)
            yield found("FROZEN_CAMERA", f"{camera} shows the same picture while the arm moves", where, pictures=frozen)
            return
