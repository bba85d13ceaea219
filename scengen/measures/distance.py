"""How far a picture is from another one, in one unit for all kinds of perturbation."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig
from ..pictures.render import Picture


def distance(one: Picture, other: Picture, where: NDArray[np.bool_] | None = None) -> float:
    """Loss of structure plus difference of colour of two pictures; 0 if they are equal.

    Structure: 1 minus the mean structural similarity (SSIM) of the channels, with the Gaussian window of its authors.
    Colour: mean CIE76 difference in CIELAB, of which 100 are black against white, over 100. SSIM alone
    barely changes with the colour of the light; a difference of colours alone barely changes where an edge moves.

    Args:
        where: pixels over which the means are taken, shape (height, width), at least one; by default all.

    Raises:
        BadConfig: scikit-image is not installed.
    """
    try:
        from skimage.color import deltaE_cie76, rgb2lab
        from skimage.metrics import structural_similarity
    except ImportError:
        raise BadConfig("distances of pictures need scikit-image; pip install 'scengen[proofs]'") from None
    window = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    alike: Any = structural_similarity(one, other, channel_axis=2, data_range=255, full=True, **window)
    mean, similar = alike
    colour: Any = deltaE_cie76(rgb2lab(one), rgb2lab(other))
    if where is None:
        return 1.0 - float(mean) + float(np.mean(colour)) / 100.0
    return 1.0 - float(np.mean(similar[where])) + float(np.mean(colour[where])) / 100.0
