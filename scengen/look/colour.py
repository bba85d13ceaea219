"""Colours as people see them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

TO_XYZ = np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
"""Matrix from linear sRGB to XYZ, for colours as rows (IEC 61966-2-1)."""
D65 = np.array([0.9505, 1.0, 1.089])
"""White of sRGB in XYZ."""
CHROMATIC = 25.0
"""Least chroma of a colour that has a hue to be recognized."""


def lab(rgb: ArrayLike) -> NDArray[np.float64]:
    """CIELAB of sRGB colours from 0 to 1, shape (..., 3). A distance of 2.3 is just seen."""
    rgb = np.asarray(rgb, float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    share = linear @ TO_XYZ / D65
    x, y, z = np.moveaxis(np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def chroma(colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of CIELAB colours from grey, shape (...,)."""
    return np.hypot(colour[..., 1], colour[..., 2])


def turn(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Difference of the hues of CIELAB colours [deg], from 0 to 180, shape (...,)."""
    hues = (np.degrees(np.arctan2(each[..., 2], each[..., 1])) for each in (one, other))
    return np.abs((next(hues) - next(hues) + 180.0) % 360.0 - 180.0)
