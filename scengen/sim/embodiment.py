"""Embodiments: the robots that a task may require, by the hands of their arms, and scenes with a robot added."""

from collections.abc import Callable
from itertools import product

import mujoco
import numpy as np
from numpy.typing import NDArray

from ..compat import from_mjcf
from ..control.impairment import Impairment
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
    """A scene from a pool with its robot added, and the load of its impairment; by default without visual geometry.

    The text is parsed again, so that exactly the scene on disk is simulated.

    Raises:
        ValueError: MuJoCo does not read the scene, or its impairment has no meaning.
    """
    scene_text.check(scene_xml)
    scene = from_mjcf(scene_xml)
    if not visual:
        panda.strip_visual(scene)
    named = all_hands(embodiment)
    for number, (hand, base) in enumerate(zip(named, panda.bases(len(named)), strict=True)):
        HANDS[hand](scene, visual, number, base)
    if payload := Impairment.of_spec(scene).payload:
        for number in range(len(hands(embodiment))):
            _load(scene, panda.Names(number), payload)
    return scene


LOAD = 0.05
"""Edge of the cube whose inertia a payload has [m]."""


def _load(scene: mujoco.MjSpec, names: panda.Names, mass: float) -> None:
    """Fix a mass to the wrist of an arm, before the sensor of force and torque.

    The controller compensates gravity by MuJoCo's bias forces, which know the mass. A constant force pulls it down once
    more, so that its weight remains.
    """
    load, world = scene.body(names.wrist).add_body(name=names.load), f"{names.load}_axes"
    load.mass, load.inertia, load.explicitinertial = mass, np.full(3, mass * LOAD**2 / 6.0), True
    load.add_site(name=names.load)
    scene.worldbody.add_site(name=world)
    weight = scene.add_actuator(name=names.load, trntype=mujoco.mjtTrn.mjTRN_SITE, target=names.load, refsite=world)
    weight.gear[:] = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    weight.gainprm[0], weight.biastype = 0.0, mujoco.mjtBias.mjBIAS_AFFINE
    weight.biasprm[0] = mass * float(scene.option.gravity[2])
