"""The text of a scene: how it is written, and what a text from elsewhere must not contain."""

import xml.etree.ElementTree as ET

import mujoco

from ..compat import from_mjcf, to_mjcf
from ..errors import BadConfig

COUNTED_KINDS = (
    "bodies",
    "geoms",
    "joints",
    "sites",
    "cameras",
    "lights",
    "meshes",
    "actuators",
    "sensors",
    "equalities",
    "excludes",
    "tendons",
)
"""Kinds of elements whose number must not change by writing and reading a scene."""


def emit(spec: mujoco.MjSpec) -> tuple[str, dict[str, str]]:
    """Write a scene as MJCF and read it back.

    Returns:
        The text, and for each kind of element whose number changed: "before -> after".

    Raises:
        ValueError: MuJoCo cannot compile the scene.
    """
    spec.compile()
    text = to_mjcf(spec)
    check(text)
    again = from_mjcf(text)
    counts = {kind: (len(getattr(spec, kind)), len(getattr(again, kind))) for kind in COUNTED_KINDS}
    return text, {kind: f"{a} -> {b}" for kind, (a, b) in counts.items() if a != b}


def check(text: str) -> None:
    """Refuse a scene that could read files, load code or expand entities.

    Raises:
        BadConfig: the text is not MJCF, or refers to something outside itself.
    """
    if "<!" in text.replace("<!--", ""):
        raise BadConfig("the scene declares a document type or entities; a scene is plain MJCF without them")
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise BadConfig(f"the scene is not well-formed XML: {error}") from None
    if root.tag != "mujoco":
        raise BadConfig(f"the scene's root element is <{root.tag}>; expected <mujoco>")
    for element in root.iter():
        if element.tag in ("include", "plugin", "extension", "attach"):
            raise BadConfig(f"the scene contains <{element.tag}>; a scene stands alone, without files or plugins")
        for name, value in element.attrib.items():
            if name.startswith("file") or (name.endswith("dir") and element.tag == "compiler"):
                raise BadConfig(f"the scene reads {value!r} through <{element.tag} {name}=...>; it must stand alone")
