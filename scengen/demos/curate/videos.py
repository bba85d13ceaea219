"""Checks of the decoded pictures of one episode and one camera."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from .checks import FROZEN_FRAMES, found
from .findings import Finding

BLUR = 0.3
"""Mean Sobel gradient below which a picture is blurred [grey levels] (paper, App. C)."""
SCENE_CHANGE = 10.0
"""Median absolute deviation of a picture from the previous one, above which the scene has changed [grey levels] (paper,
App. C: MAD score)."""
FROZEN = 0.5
"""Mean difference of two pictures below which they are the same [grey levels] (lerobot-lint)."""
FROZEN_CAMERA = "FROZEN_CAMERA"
"""Name of the check for a picture that stands still while the arm moves."""
BLACK = 10.0
"""Mean level below which a picture is black (lerobot-lint)."""
WHITE = 245.0
"""Mean level above which a picture is white (lerobot-lint)."""
STRIDE = 4
"""Distance of the rows and columns of pictures that are compared."""
PROBE_EDGE = 32
"""Width or height, whichever is larger, to which pictures are reduced before they are compared with a replay."""
NEAR = 6
"""Number of pictures before and after the one of a moment among which it is looked for."""
PROBES = 3
"""Number of moments of a film that are rendered again: in each third of it the one with most motion."""
CLEARLY = 0.8
"""Share of the difference from the picture of the same row below which another one is clearly more alike."""
MISMATCH = 5.0
"""Mean difference of a film from pictures rendered again above which it shows something else [grey levels]. Compression
makes 1.2 to 1.6, another camera of the same scene 8."""


@dataclass(frozen=True)
class Probe:
    """A picture of a film with its neighbours, to be compared with one that is rendered again."""

    row: int
    near: NDArray[np.uint8]
    """Reduced pictures of the rows from `row - NEAR` to `row + NEAR`, shape (2 NEAR + 1, height, width)."""

    def differences(self, picture: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Mean differences of the pictures from one of the same size [grey levels], shape (2 NEAR + 1,)."""
        return np.abs(self.near.astype(float) - reduced(picture)).mean(axis=(1, 2))


def reduced(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Mean grey levels of the blocks of a picture, shape (height / block, width / block)."""
    block = max(1, max(picture.shape) // PROBE_EDGE)
    height, width = (edge // block for edge in picture.shape[:2])
    blocks = picture[: height * block, : width * block].reshape(height, block, width, block, -1)
    return blocks.mean(axis=(1, 3, 4)).round().astype(np.uint8)


class Prober:
    """Chooses the probes of a film while it is decoded."""

    def __init__(self, rows: int):
        self._rows, self._near, self._count = rows, deque[NDArray[np.uint8]](maxlen=2 * NEAR + 1), 0
        self._best: dict[int, tuple[float, Probe]] = {}

    def watched(self, pictures: Iterable[NDArray[np.uint8]]) -> Iterator[NDArray[np.uint8]]:
        """The same pictures."""
        for picture in pictures:
            self._near.append(reduced(picture))
            self._count += 1
            if len(self._near) == 2 * NEAR + 1:
                self._consider(self._count - 1 - NEAR)
            yield picture

    def _consider(self, row: int) -> None:
        before, now, after = (self._near[k].astype(float) for k in (NEAR - 1, NEAR, NEAR + 1))
        motion = min(float(np.abs(now - other).mean()) for other in (before, after))
        part = row * PROBES // self._rows
        if part not in self._best or motion > self._best[part][0]:
            self._best[part] = motion, Probe(row, np.array(self._near))

    @property
    def probes(self) -> tuple[Probe, ...]:
        """The probes of the pictures so far, in the order of their rows."""
        return tuple(self._best[part][1] for part in sorted(self._best))


def stands_still(before: NDArray[np.uint8], after: NDArray[np.uint8]) -> bool:
    """Whether two pictures of a replay show the same: the arm is out of view."""
    return float(np.abs(reduced(before).astype(float) - reduced(after)).mean()) < FROZEN


def compared(camera: str, differences: Sequence[NDArray[np.float64]]) -> Iterator[Finding]:
    """Findings of the comparison of a film with pictures rendered again.

    Args:
        camera: key of the video.
        differences: of each probe, see `Probe.differences`.
    """
    if not differences:
        return
    least = float(np.median([each.min() for each in differences]))
    if least > MISMATCH:
        told = {"difference": least, "limit": MISMATCH}
        yield found("VIDEO_MISMATCH", f"{camera} shows something other than the replay", **told)
        return
    moved = [int(each.argmin()) - NEAR for each in differences if each.min() < CLEARLY * each[NEAR]]
    if 2 * len(moved) > len(differences):
        shift = float(np.median(moved))
        explanation = f"{camera} is {'late' if shift > 0 else 'early'}: the replay looks as it does in other rows"
        yield found("VIDEO_SHIFT", explanation, rows=shift, probes=len(moved))


def check_video(
    camera: str, pictures: Iterable[NDArray[np.uint8]], rows: int, moving: NDArray[np.bool_]
) -> Iterator[Finding]:
    """Compare pictures with each other and with the rows.

    Args:
        camera: key of the video.
        pictures: decoded pictures, shape (height, width, 3) each.
        rows: number of rows of the episode.
        moving: whether the arm is commanded to move in each row, shape (rows,).
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
            "FRAME_COUNT", f"{camera} has a different number of pictures than there are rows", frames=count, rows=rows
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
            yield found(FROZEN_CAMERA, f"{camera} shows the same picture while the arm moves", where, pictures=frozen)
            return
