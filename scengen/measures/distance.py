"""How far a picture is from another one, in one unit for all kinds of perturbation."""

from typing import Any

import numpy as np

from ..errors import BadConfig
from ..pictures.render import Picture


def distance(one: Picture, other: Picture) -> float:
    """Loss of structure plus difference of colour of two pictures; 0 if they are equal.

    Structure: 1 minus the mean structural similarity (SSIM) of the channels, with the Gaussian window of its authors.
    Colour: mean CIE76 difference in CIELAB, of which 100 are black against white, over 100. SSIM alone
    barely changes with the colour of the light; a difference of colours alone barely changes where an edge moves.

    Raises:
        BadConfig: scikit-image is not installed.
    """
    try:
        from skimage.color import deltaE_cie76, rgb2lab
        from skimage.metrics import structural_similarity
    except ImportError:
        raise BadConfig("distances of pictures need scikit-image; pip install 'scengen[proofs]'") from None
    window = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    structure: Any = structural_similarity(one, other, channel_axis=2, data_range=255, **window)
    colour = np.mean(deltaE_cie76(rgb2lab(one), rgb2lab(other)))
    return 1.0 - float(structure) + float(colour) / 100.0
