"""Differences between the supported versions of MuJoCo (3.5 to 4.x): no other module checks a version.

Scenes are written and read in the dialect of MuJoCo 3.5, so that a scenario has one text under every version. Multiple
contacts of convex shapes (`multiccd`) are off there unless a text enables them; in MuJoCo 4 they are on unless a text
disables them.
"""

import xml.etree.ElementTree as ET
from typing import Any

import mujoco
import numpy as np

ROBOSUITE_RUNS = hasattr(mujoco.MjData, "qM")
"""Whether robosuite's controllers run: they read the inertia matrix from `MjData.qM`, which MuJoCo 4 lacks."""

_ENABLING: int | None = getattr(mujoco.mjtEnableBit, "mjENBL_MULTICCD", None)
"""Bit that enables multiple contacts of convex shapes; None where they are on by default."""


def set_damping(joint: mujoco.MjsJoint, damping: float) -> None:
    """Set the viscous friction of a joint [N m s/rad or N s/m].

    In MuJoCo 4 `damping` holds the coefficients of speed, its square and its cube.
    """
    value: Any = [damping, 0.0, 0.0] if np.ndim(joint.damping) else damping
    joint.damping = value


def set_multiccd(spec: mujoco.MjSpec, on: bool) -> None:
    """Switch multiple contacts of two convex shapes on or off."""
    option = spec.option
    if _ENABLING is not None:
        bit = int(_ENABLING)
        option.enableflags = option.enableflags | bit if on else option.enableflags & ~bit
    else:
        bit = int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)  # pyright: ignore[reportAttributeAccessIssue]
        option.disableflags = option.disableflags & ~bit if on else option.disableflags | bit


def to_mjcf(spec: mujoco.MjSpec) -> str:
    """The text of a compiled scene.

    Raises:
        ValueError: MuJoCo cannot write the scene.
    """
    text = spec.to_xml()
    if _ENABLING is not None:
        return text
    root = ET.fromstring(text)
    option = root.find("option")
    if option is None:
        option = ET.SubElement(root, "option")
    flags = option.find("flag")
    if flags is None:
        flags = ET.SubElement(option, "flag")
    if flags.attrib.pop("multiccd", "enable") == "enable":
        flags.set("multiccd", "enable")
    if not flags.attrib:
        option.remove(flags)
        option.text = option.text if len(option) else None
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def to_plain_mjcf(spec: mujoco.MjSpec) -> ET.Element:
    """A compiled scene as MJCF that plain MuJoCo reads alike in every version: it states the flag `multiccd`.

    Raises:
        ValueError: MuJoCo cannot write the scene.
    """
    root = ET.fromstring(to_mjcf(spec))
    option = root.find("option")
    option = ET.SubElement(root, "option") if option is None else option
    flags = option.find("flag")
    flags = ET.SubElement(option, "flag") if flags is None else flags
    flags.set("multiccd", flags.get("multiccd", "disable"))
    return root


def from_mjcf(text: str) -> mujoco.MjSpec:
    """A scene from its text.

    Raises:
        ValueError: MuJoCo does not read the text.
    """
    spec = mujoco.MjSpec.from_string(text)
    if _ENABLING is None:
        flags = ET.fromstring(text).iterfind("option/flag")
        set_multiccd(spec, any(flag.get("multiccd") == "enable" for flag in flags))
    return spec
