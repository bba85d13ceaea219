"""Scenes built again from their parameters: a scene in a pool must be the one that the installed family builds."""

import hashlib
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np

from ..compat import from_mjcf
from ..errors import BadConfig, contrasted, cut
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.embodiment import JAW
from ..sim.world import World
from .impaired import posed

MAX_RELATIVE_DIFFERENCE = 1e-9
"""Largest relative difference of equal numbers on machines with different rounding."""
MAX_ABSOLUTE_DIFFERENCE = 1e-12
"""Largest absolute difference of equal numbers on machines with different rounding; the inertia of a body has 1e-6."""
_NUMBER = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?")
"""A number as MuJoCo reads and writes it; Python's `float` also accepts `0.0_6` and Arabic digits."""
WHOLE = frozenset(
    "condim contype conaffinity priority group iterations ls_iterations noslip_iterations ccd_iterations".split()
)
"""Attributes that MuJoCo reads as whole numbers."""
_ELEMENTS = re.compile(r"(opt|body|jnt|dof|geom|site|cam|light|eq|exclude|pair|tendon|wrap|actuator|sensor|mat)_")
"""Beginning of the fields of a model whose whole numbers say what its elements are. Meshes and search trees have whole
numbers that depend on rounding."""
SECTIONS = (
    "compiler",
    "option",
    "size",
    "visual",
    "statistic",
    "default",
    "extension",
    "custom",
    "asset",
    "worldbody",
    "contact",
    "deformable",
    "equality",
    "tendon",
    "actuator",
    "sensor",
    "keyframe",
)
"""Sections of a scene in the order in which they count for its hash, that of MuJoCo 3.5."""
NOT_REBUILT = "the scene is not the one that the family builds from the parameters"


def rebuild(scenario: Scenario) -> str:
    """The text of a scenario's scene, under its conditions.

    Raises:
        BadConfig: no start is free of contact.
    """
    return posed(scene_text.emit(scenario.build())[0], scenario.conditions, scenario.under(None).id)


def world_of(scenario: Scenario, embodiment: str = JAW) -> World:
    """A scenario's scene with its robot, at its start."""
    return World.load(rebuild(scenario), embodiment)


def portable_sha256(text: str) -> str:
    """Hash of a scene that is the same on machines with different rounding: numbers count to 9 digits, and to 1e-9.

    A number within rounding of the middle between two such values can still differ. Scenes have thousands of
    numbers, and rounding changes one in some thousand millions of them so.
    """
    words = []
    for element in _elements(ET.fromstring(text)):
        words.append(f"<{element.tag} {len(element)}")
        for name, value in sorted(element.attrib.items()):
            words.append(f"{name}={' '.join(map(_rounded, value.split()))}")
    return hashlib.sha256("\n".join(words).encode()).hexdigest()


def _elements(root: ET.Element) -> Iterator[ET.Element]:
    """All elements of a scene in depth-first order, the sections in the order of `SECTIONS`."""
    yield root
    for section in sorted(root, key=lambda section: SECTIONS.index(section.tag) if section.tag in SECTIONS else -1):
        yield from section.iter()


def _rounded(word: str) -> str:
    """A number of a scene, rounded; any other word as it is."""
    return f"{round(float(f'{float(word):.9g}'), 9) + 0.0:.9g}" if _NUMBER.fullmatch(word) else word


def difference(text: str, rebuilt: str, exact: bool, embodiment: str = JAW) -> str:
    """Difference between the scene of a pool and the rebuilt one, as text; empty if it does not.

    Args:
        exact: whether every byte must be equal, as on a machine with the same rounding. Otherwise every element and
            attribute must be equal, and numbers up to `MAX_RELATIVE_DIFFERENCE`. Such a scene, and no other one, is
            compiled, because MuJoCo does not read every text that says nearly the same.
        embodiment: the robot that the scene is compiled with.
    """
    if text == rebuilt:
        return ""
    if why := _unreadable(text, rebuilt):
        return why
    here, there = list(ET.fromstring(text).iter()), list(ET.fromstring(rebuilt).iter())
    for a, b in zip(here, there, strict=False):
        where = f"<{b.tag} {b.attrib.get('name', '')}>".replace(" >", ">")
        if a.tag != b.tag or len(a) != len(b):
            return f"{NOT_REBUILT}: it differs at {where}"
        for name in sorted(a.attrib.keys() | b.attrib.keys()):
            mine, theirs = a.attrib.get(name), b.attrib.get(name)
            if mine != theirs and (
                exact or name in WHOLE or mine is None or theirs is None or not _close(mine, theirs)
            ):
                told, made = contrasted(ascii(str(mine)), ascii(str(theirs)))
                return f"{NOT_REBUILT}: {name} of {where} is {told} instead of {made}"
    if len(here) != len(there):
        return f"{NOT_REBUILT}: it has {len(here)} elements instead of {len(there)}"
    if exact:
        return f"{NOT_REBUILT}: its text differs although its content does not"
    return _other_model(text, rebuilt, embodiment)


def other_scene(text: str, rebuilt: str, embodiment: str = JAW) -> str:
    """Difference between the scene of a pool of another MuJoCo and the rebuilt one; empty if there is none.

    Versions write the same scene with other defaults, so both are written again by the MuJoCo of this process.
    """
    if text == rebuilt:
        return ""
    if why := _unreadable(text, rebuilt):
        return why
    try:
        again, made = (scene_text.emit(from_mjcf(each))[0] for each in (text, rebuilt))
    except ValueError as error:
        return _not_read(error)
    return difference(again, made, False, embodiment) or _other_model(text, rebuilt, embodiment)


def _unreadable(text: str, rebuilt: str) -> str:
    """Reason why the scene of a pool is not read although it differs from the rebuilt one; empty if it is."""
    if not text or not rebuilt:
        return f"{NOT_REBUILT}: {'it' if rebuilt else 'that'} is empty"
    if "<?" in text:
        return f"{NOT_REBUILT}: it has instructions for programs (<?...?>)"
    try:
        scene_text.check(text)
    except BadConfig as error:
        return f"{NOT_REBUILT}: {error}"
    return ""


def _not_read(error: ValueError) -> str:
    return f"{NOT_REBUILT}: MuJoCo does not read it: {cut(' '.join(str(error).split()))}"


def _other_model(text: str, rebuilt: str, embodiment: str) -> str:
    """How the model of a scene whose text says nearly the same differs from the rebuilt one; empty if it does not."""
    try:
        here = World.load(text, embodiment).model
    except ValueError as error:
        return _not_read(error)
    there = World.load(rebuilt, embodiment).model
    if here.names != there.names:
        return f"{NOT_REBUILT}: its elements have other names"
    for name in dir(there):
        values = getattr(there, name) if _ELEMENTS.match(name) and "bvh" not in name else None
        if isinstance(values, np.ndarray) and values.dtype.kind in "iub":
            if not np.array_equal(values, getattr(here, name)):
                return f"{NOT_REBUILT}: compiled, {name} differs"
    return ""


def _close(a: str, b: str) -> bool:
    """Whether two attributes hold the same numbers, or the same words."""
    mine, theirs = a.split(), b.split()
    if len(mine) != len(theirs):
        return False
    for x, y in zip(mine, theirs, strict=True):
        if x != y:
            if not (_NUMBER.fullmatch(x) and _NUMBER.fullmatch(y)):
                return False
            if not math.isclose(float(x), float(y), rel_tol=MAX_RELATIVE_DIFFERENCE, abs_tol=MAX_ABSOLUTE_DIFFERENCE):
                return False
    return True
