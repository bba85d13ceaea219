"""Scenes built again from their parameters: a scene in a pool must be the one that the installed family builds."""

import math
import re
import xml.etree.ElementTree as ET

from ..errors import BadConfig
from ..scenario import Scenario
from ..sim import scene_text
from ..sim.world import JAW, World

MAX_RELATIVE_DIFFERENCE = 1e-9
"""Largest relative difference of equal numbers on machines with different rounding."""
MAX_ABSOLUTE_DIFFERENCE = 1e-12
"""Largest absolute difference of equal numbers on machines with different rounding; the inertia of a body has 1e-6."""
_NUMBER = re.compile(r"[-+]?[0-9]+(\.[0-9]*)?([eE][-+]?[0-9]+)?")
"""A number as MuJoCo reads and writes it; Python's `float` also accepts `0.0_6` and Arabic digits."""
NOT_REBUILT = "the scene is not the one that the family builds from the parameters"


def rebuild(scenario: Scenario) -> str:
    """The text of a scenario's scene."""
    return scene_text.emit(scenario.build())[0]


def world_of(scenario: Scenario, embodiment: str = JAW) -> World:
    """A scenario's scene with its robot, at its start."""
    return World.load(rebuild(scenario), embodiment)


def difference(text: str, rebuilt: str, exact: bool) -> str:
    """How the scene of a pool differs from the rebuilt one, in words; empty if it does not. Compiles nothing.

    Args:
        exact: whether every byte must be equal, as on a machine with the same rounding. Otherwise every element and
            attribute must be equal, and numbers up to `MAX_RELATIVE_DIFFERENCE`.
    """
    if text == rebuilt:
        return ""
    if not text or not rebuilt:
        return f"{NOT_REBUILT}: {'it' if rebuilt else 'that'} is empty"
    try:
        scene_text.check(text)
    except BadConfig as error:
        return f"{NOT_REBUILT}: {error}"
    here, there = list(ET.fromstring(text).iter()), list(ET.fromstring(rebuilt).iter())
    for a, b in zip(here, there, strict=False):
        where = f"<{b.tag} {b.attrib.get('name', '')}>".replace(" >", ">")
        if a.tag != b.tag or len(a) != len(b):
            return f"{NOT_REBUILT}: it differs at {where}"
        for name in sorted(a.attrib.keys() | b.attrib.keys()):
            mine, theirs = a.attrib.get(name), b.attrib.get(name)
            if mine != theirs and (exact or mine is None or theirs is None or not _close(mine, theirs)):
                return f"{NOT_REBUILT}: {name} of {where} is {str(mine)[:60]!r} instead of {str(theirs)[:60]!r}"
    if len(here) != len(there):
        return f"{NOT_REBUILT}: it has {len(here)} elements instead of {len(there)}"
    return f"{NOT_REBUILT}: its text differs although its content does not" if exact else ""


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
