"""Observations under the names of robomimic's recordings (`scengen record format=robomimic`)."""

from .object_state import NAME
from .observations import cameras_of, streams_of

OBJECT = "object"
"""robomimic's name of robosuite's `object-state`."""
SITE = "_site"
"""Ending of robosuite's name for the orientation of the grip site. Its `eef_quat` is that of the hand's body."""
IMAGE = "_image"
"""Ending of the names of pictures."""


def names(embodiment: str) -> dict[str, str]:
    """This package's names of streams and cameras, by robomimic's."""
    streams = {name + SITE if name.endswith("eef_quat") else name: name for name in streams_of(embodiment)}
    pictures = {view + IMAGE: camera for camera, view in cameras_of(embodiment).items()}
    return {OBJECT: NAME, **streams, **pictures}
