"""All looks, by name, and the look of a compiled scene."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco

from ..errors import BadConfig, UnknownName, cut
from . import room

MARK = "scengen_look"
"""Name of the text in a compiled scene that names its look."""
LARGE = 320
"""Edge above which pictures are for people, who see shadows closely [pixels]."""


@dataclass(frozen=True)
class Look:
    """How pictures show a scene. Physics, stored scenes and ids do not depend on it."""

    name: str
    """Its name in settings."""
    version: int
    """Number that grows when its pictures change."""
    change: Callable[[mujoco.MjSpec], None]
    """Function that changes the scene."""
    shadow_map: int
    """Edge of the shadow map for pictures of up to `LARGE` pixels [pixels]: most of the time of a picture without a
    graphics card."""
    large_shadow_map: int
    """Edge of the shadow map for larger pictures [pixels]."""
    smooth_shadows: bool = False
    """Whether shadows are smoothed like edges, where OpenGL 4 does it."""

    def __str__(self) -> str:
        return f"{self.name} {self.version}"

    def shadow_map_of(self, width: int, height: int) -> int:
        """Edge of the shadow map for pictures of a width and height [pixels]."""
        return self.large_shadow_map if max(width, height) > LARGE else self.shadow_map

    def dress(self, spec: mujoco.MjSpec) -> None:
        """Give a scene with its visual geometry this look."""
        self.change(spec)
        if self.name != PLAIN.name:
            spec.add_text(name=MARK, data=self.name)


def _leave(spec: mujoco.MjSpec) -> None:
    """Leave a scene as it is."""


PLAIN = Look("plain", 1, _leave, 1024, 1024)
"""The scene as it is stored, in a void."""
ROOM = Look("room", 1, room.dress, 768, 2048, smooth_shadows=True)
"""A table in a room."""
LOOKS = {look.name: look for look in (ROOM, PLAIN)}


def look_named(name: str) -> Look:
    """The look of this name.

    Raises:
        UnknownName: there is none.
    """
    if name not in LOOKS:
        raise UnknownName("look", name, LOOKS)
    return LOOKS[name]


def look_told(text: object) -> Look:
    """The look that a recording names, by its name and version; `PLAIN` if it names none.

    Raises:
        BadConfig: there is no such look, or it has another version now.
    """
    if text is None:
        return PLAIN
    for look in LOOKS.values():
        if text == str(look):
            return look
    raise BadConfig(f"look = {cut(repr(text))}; known are {', '.join(map(str, LOOKS.values()))}")


def look_of(model: mujoco.MjModel) -> Look:
    """The look of a compiled scene."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, MARK)
    if number < 0:
        return PLAIN
    start, size = model.text_adr[number], model.text_size[number]
    return LOOKS[bytes(model.text_data[start : start + size]).rstrip(b"\0").decode()]
