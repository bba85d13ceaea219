"""Orientation of pictures in front of a viewer: upright, turned by quarters, or mirrored; the eight ways of Exif.

Only the picture is turned. Actions, the robot's own pose and all privileged poses stay in world axes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import BadConfig
from .geometry import Vec3

VIEW_CENTRE = np.array([-0.05, 0.0])
"""Point where the axis of the camera "agentview", in the middle of its pictures, meets the table: x and y [m]."""
RIGHT_AND_UP = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""Matrix that takes x and y to the picture's right and up, for cameras that look at the table from the front or from
above."""


@dataclass(frozen=True)
class Orientation:
    """An exchange of left and right, followed by quarter turns.

    Applied to a picture, it moves pixels and changes none.
    """

    turns: int = 0
    """Number of quarter turns, counter-clockwise."""
    mirrored: bool = False
    """Whether left and right are exchanged before the turns."""

    def apply(self, picture: NDArray) -> NDArray:
        """The picture as the viewer sees it: shape (height, width, ...), first row on top.

        Odd turns swap width and height.
        """
        seen = picture[:, ::-1] if self.mirrored else picture
        return np.ascontiguousarray(np.rot90(seen, self.turns))

    def check_size(self, width: int, height: int) -> None:
        """Raise unless the turned picture has the same size [pixels], so that one shape serves all scenarios.

        Raises:
            BadConfig: the turns are odd and the picture is not square.
        """
        if self.turns % 2 and width != height:
            raise BadConfig(
                f"pictures of {width} x {height} pixels; here they are seen turned by a quarter and must be square: "
                f"pass width={height}, or height={width}"
            )

    def pixels(self, width: int, height: int) -> NDArray[np.float64]:
        """Matrix from homogeneous pixel coordinates of the picture to those of the turned picture, shape (3, 3).

        x points right, y down.

        Args:
            width: width of the picture before it is turned [pixels].
            height: its height [pixels].
        """
        size = np.array([width, height])
        down, found = np.diag([1.0, -1.0]), np.eye(3)
        found[:2, :2] = down @ self._right_and_up @ down
        found[:2, 2] = (size[::-1] if self.turns % 2 else size) / 2 - found[:2, :2] @ size / 2
        return found

    def seen_at(self, point: Vec3) -> Vec3:
        """Position at which an object appears to a viewer who takes the picture for upright [m], shape (3,).

        Valid for cameras in front of the table and above it, without perspective: the position is turned about
        `VIEW_CENTRE` at its own height.
        """
        return self._moved(point, self._right_and_up)

    def stands_at(self, seen: Vec3) -> Vec3:
        """Position of an object that appears at a position [m], shape (3,): the inverse of `seen_at`."""
        return self._moved(seen, self._right_and_up.T)

    @staticmethod
    def _moved(point: Vec3, by: NDArray[np.float64]) -> Vec3:
        """A position, turned about `VIEW_CENTRE` by a matrix in the picture's axes [m]."""
        moved = RIGHT_AND_UP.T @ by @ RIGHT_AND_UP @ (point[:2] - VIEW_CENTRE)
        return np.array([*(VIEW_CENTRE + moved), point[2]])

    @property
    def _right_and_up(self) -> NDArray[np.float64]:
        """Matrix that turns the picture's right and up, shape (2, 2)."""
        quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
        turns: NDArray[np.float64] = np.linalg.matrix_power(quarter, self.turns % 4)
        return turns @ np.diag([-1.0 if self.mirrored else 1.0, 1.0])


UPRIGHT = Orientation()
"""Orientation that leaves pictures as they are."""
