"""Embodiments: the robots that a task may require, by the hands of their arms, and scenes with a robot added."""

from collections.abc import Callable
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compat import from_mjcf
from ..control.loop import ACTION
from ..errors import UnknownName
from ..robots import panda, suction
from ..robots.panda import MAX_ARMS
from . import scene_text

JAW = "panda_jaw"
"""Name of an arm with the two-finger jaw."""
SUCTION = "panda_suction"
"""Name of an arm with the suction cup."""
HANDS: dict[str, Callable[[mujoco.MjSpec, bool, int, NDArray[np.float64]], None]] = {
    JAW: lambda scene, visual, number, base: panda.attach(scene, visual, None, number, base),
    SUCTION: suction.attach,
}
"""Functions that add an arm to a scene, by the name of its hand. Arguments: scene, visual geometry or not, number, base
position [m]."""
SCRIPTED = "scripted_"
"""Prefix of the name of a hand whose arm belongs to the scene: its events move the arm, and no action does."""
EMBODIMENTS = (
    *("+".join(hands) for arms in range(1, MAX_ARMS + 1) for hands in product(HANDS, repeat=arms)),
    *(f"{driven}+{SCRIPTED}{partner}" for driven, partner in product(HANDS, repeat=MAX_ARMS)),
)
"""Robots that a task may require: the hands of its arms, joined by `+`. Two arms stand side by side, the first one on
the right. A scripted arm comes last."""


def all_hands(embodiment: str) -> tuple[str, ...]:
    """The hands of all arms of an embodiment in their order, scripted ones included.

    Raises:
        UnknownName: the embodiment is not one of `EMBODIMENTS`.
    """
    if embodiment not in EMBODIMENTS:
        raise UnknownName("embodiment", embodiment, EMBODIMENTS)
    return tuple(hand.removeprefix(SCRIPTED) for hand in embodiment.split("+"))


def hands(embodiment: str) -> tuple[str, ...]:
    """The hands that actions drive, in the order of their arms. A policy controls these.

    Raises:
        UnknownName: the embodiment is not one of `EMBODIMENTS`.
    """
    return all_hands(embodiment)[: len(all_hands(embodiment)) - embodiment.count(SCRIPTED)]


def action_size(embodiment: str) -> int:
    """Length of an action of an embodiment: seven numbers for each arm that actions drive."""
    return ACTION * len(hands(embodiment))


def compose(scene_xml: str, embodiment: str, visual: bool = False) -> mujoco.MjSpec:
    """A scene from a pool with its robot added, by default without visual geometry.

    The text is parsed again, so that exactly the scene on disk is simulated.
    """
    scene_text.check(scene_xml)
    scene = from_mjcf(scene_xml)
    if not visual:
        panda.strip_visual(scene)
    named = all_hands(embodiment)
    for number, (hand, base) in enumerate(zip(named, panda.bases(len(named)), strict=True)):
        HANDS[hand](scene, visual, number, base)
    return scene
