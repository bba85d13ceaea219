"""Finishes: what surfaces of things are made of, as their colours and the names of their parts show.

A finish depends on what plain pictures show as well, never on a mass or a friction: it reveals nothing that is hidden.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from . import textures


@dataclass(frozen=True)
class Finish:
    """A material of MuJoCo."""

    name: str
    """Name of the material, and of its texture."""
    specular: float = 0.0
    """Strength of highlights, from 0 to 1."""
    shininess: float = 0.0
    """Sharpness of highlights, from 0 to 1."""
    emission: float = 0.0
    """Share of the colour that is seen without light."""
    texture: Callable[[], textures.Texture] | None = None
    """Function that makes the texture."""
    edge: float | None = None
    """Edge of a tile of the texture [m]. None: one tile covers the whole thing."""

    def add(self, spec: mujoco.MjSpec) -> None:
        """Add the material to a scene."""
        made = spec.add_material(name=self.name)
        made.specular, made.shininess, made.emission = self.specular, self.shininess, self.emission
        if self.texture is not None:
            image = self.texture()
            kind, (height, width, channels) = mujoco.mjtTexture.mjTEXTURE_2D, image.shape
            added = spec.add_texture(name=self.name, type=kind, width=width, height=height, nchannel=channels)
            added.data = image.tobytes()
            made.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = self.name
            made.texuniform, made.texrepeat = self.edge is not None, np.full(2, 1.0 / (self.edge or 1.0), np.float32)


WOOD = Finish("look_wood", 0.15, 0.4, 0.0, textures.grain, 0.25)
"""Oiled wood."""
STEEL = Finish("look_steel", 0.6, 0.6)
"""Brushed metal."""
CERAMIC = Finish("look_ceramic", 0.5, 0.8)
"""Glazed ceramic."""
CARD = Finish("look_card", 0.05, 0.1, 0.0, textures.fibres, 0.15)
"""Cardboard."""
MAT = Finish("look_mat", 0.0, 0.0, 0.12, textures.weave)
"""Woven mat with a hem. It emits a little light, so that its colour is seen in the shade of a hand."""
MARKED = Finish("look_marked", 0.0, 0.0, 0.08, textures.outline)
"""Square with an outline. It emits a little light."""
PRINT = Finish("look_print")
"""Ink and paper."""
GLASS = Finish("look_glass", 0.8, 0.9)
"""Clear plastic."""
VARNISH = Finish("look_varnish", 0.3, 0.5)
"""Varnished paint, for all other things."""

OF_PARTS = {
    **dict.fromkeys(("bottom", "wall", "rim", "shell", "bead", "lip", "skin"), CERAMIC),
    **dict.fromkeys(("band_low", "band_high", "panel", "front", "back"), CARD),
    **dict.fromkeys(("upper", "lower", "patch"), MAT),
    "square": MARKED,
    **dict.fromkeys(("faint", "bold", "print", "display"), PRINT),
}
"""Finish of parts, by the names that assets give them. Wedges of turned things are ceramic if they are meshes."""
OF_COLOURS = {
    **dict.fromkeys(
        (
            (0.86, 0.70, 0.42),  # InlaidRod
            (0.86, 0.70, 0.45),  # Board
            (0.86, 0.62, 0.20),  # Rod
            (0.80, 0.66, 0.44),  # Seesaw
            (0.60, 0.48, 0.36),  # TierRack, RingRack
            (0.55, 0.42, 0.30),  # SlotShelf
            (0.45, 0.33, 0.22),  # Stool, Plinth
            (0.72, 0.70, 0.64),  # CrownedRamp
        ),
        WOOD,
    ),
    **dict.fromkeys(
        (
            (0.35, 0.37, 0.40),  # frames of Seesaw, Pendulum and Incline
            (0.20, 0.20, 0.22),  # axles and rods
            (0.45, 0.47, 0.50),  # Ridge
            (0.30, 0.32, 0.36),  # arms of SlotBoard, strips of Board
            (0.14, 0.14, 0.17),  # lead
            (0.62, 0.65, 0.70),  # Ball
            (0.70, 0.71, 0.73),  # seams of cans
        ),
        STEEL,
    ),
    (0.80, 0.45, 0.32): CERAMIC,  # Cup
    (0.75, 0.16, 0.14): CARD,  # CrackerBox
}
"""Finish of things, by the colours that assets give them."""


def finish_of(geom: mujoco.MjsGeom) -> Finish:
    """Finish of a geom of a scene."""
    if geom.rgba[3] < 1.0:
        return GLASS
    part = re.sub(r"(_[-\d.A-Z]+)+$", "", geom.name.rpartition("/")[2])
    red, green, blue = (round(float(each), 2) for each in geom.rgba[:3])
    if part in OF_PARTS and (OF_PARTS[part] is not CERAMIC or geom.type == mujoco.mjtGeom.mjGEOM_MESH):
        return OF_PARTS[part]
    return OF_COLOURS.get((red, green, blue), VARNISH)
