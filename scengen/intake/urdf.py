"""An imported mesh as URDF: its pieces, the mesh that pictures show, its mass and its inertia."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator

import numpy as np
from manifold3d import Manifold

from ..assets.mesh_prop import MeshProp, Points
from ..assets.turned import FOOT_RADIUS
from .polygons import Indices
from .solid import as_mesh

MESHES = "meshes"
"""Folder of the meshes, next to the file."""


def files(prop: MeshProp) -> Iterator[tuple[str, str]]:
    """Files of a body and their contents: Wavefront meshes [m], and `asset.urdf`, which names them by relative paths.

    URDF has no friction and no contact parameters. MuJoCo's own settings in the file make it keep body and inertia as
    they are; other programs ignore them.
    """
    robot = ET.Element("robot", name="asset")
    settings = {"strippath": "false", "discardvisual": "false", "fusestatic": "false", "balanceinertia": "false"}
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", settings)
    link = ET.SubElement(robot, "link", name="asset")
    inertial, i = ET.SubElement(link, "inertial"), prop.inertia
    ET.SubElement(inertial, "origin", xyz=_told(prop.com), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=f"{prop.mass:.9g}")
    entries = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {name: f"{i[at]:.9g}" for name, at in entries.items()})
    for k, (rgba, vertices, faces) in enumerate(prop.looks()):
        yield f"{MESHES}/look_{k}.obj", _wavefront(vertices, faces)
        material = ET.SubElement(_mesh(link, "visual", f"look_{k}"), "material", name=f"colour_{k}")
        ET.SubElement(material, "color", rgba=_told(rgba))
    for k, points in enumerate(prop.corners):
        hull = as_mesh(Manifold.hull_points(np.ascontiguousarray(points)))
        yield f"{MESHES}/piece_{k}.obj", _wavefront(hull.vertices, hull.faces)
        _mesh(link, "collision", f"piece_{k}")
    for foot in prop.feet:
        part = ET.SubElement(link, "collision")
        ET.SubElement(part, "origin", xyz=_told(foot), rpy="0 0 0")
        ET.SubElement(ET.SubElement(part, "geometry"), "sphere", radius=f"{FOOT_RADIUS:g}")
    ET.indent(robot)
    yield "asset.urdf", ET.tostring(robot, encoding="unicode") + "\n"


def _mesh(link: ET.Element, kind: str, name: str) -> ET.Element:
    part = ET.SubElement(link, kind)
    ET.SubElement(part, "origin", xyz="0 0 0", rpy="0 0 0")
    ET.SubElement(ET.SubElement(part, "geometry"), "mesh", filename=f"{MESHES}/{name}.obj")
    return part


def _told(values: Points | tuple[float, ...]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _wavefront(vertices: Points, faces: Indices) -> str:
    lines = [f"v {_told(vertex)}" for vertex in vertices]
    return "\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in np.asarray(faces) + 1), ""])
