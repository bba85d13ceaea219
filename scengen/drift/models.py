"""Comparison of two compiled models by the names of their elements.

Versions of MuJoCo write the same scene with other defaults, another order and other last digits, and choose other
frames for meshes. The comparison is of what the physics depends on.
"""

from collections.abc import Iterator

import mujoco
import numpy as np

MAX_RELATIVE_DIFFERENCE = 1e-4
"""Largest relative difference of equal numbers: MJCF holds six digits, and a mass depends on the product of three."""
MAX_ABSOLUTE_DIFFERENCE = 1e-6
"""Largest absolute difference of equal numbers, in SI units."""
FIELDS = {
    "body": ("mass", "pos", "quat", "ipos"),
    "geom": ("contype", "conaffinity", "condim", "priority", "friction", "solref", "solimp", "margin", "gap"),
    "jnt": ("type", "pos", "axis", "range", "stiffness", "solref", "solimp"),
    "actuator": ("gainprm", "biasprm", "ctrlrange", "forcerange", "gear"),
}
"""Compared fields of each kind of element."""
SHAPES = ("type", "size", "pos", "quat")
"""Fields of geoms that are not meshes."""
DOFS = ("damping", "frictionloss", "armature")
"""Fields of the first degree of freedom of a joint."""
OPTIONS = ("timestep", "integrator", "solver", "cone", "impratio", "tolerance", "iterations", "density", "viscosity")
"""Compared options of a scene."""


def model_difference(one: mujoco.MjModel, other: mujoco.MjModel) -> str:
    """The first difference of two models, as text; empty if they describe the same physics."""
    for option in (*OPTIONS, "gravity", "wind"):
        if not _equal(getattr(one.opt, option), getattr(other.opt, option)):
            return f"the option {option} is {getattr(one.opt, option)} instead of {getattr(other.opt, option)}"
    here, there = dict(_elements(one)), dict(_elements(other))
    if here.keys() != there.keys():
        kind, name = min(here.keys() ^ there.keys())
        return f"only one of the two models has the {kind} {name}"
    for (kind, name), fields in there.items():
        for field, value in fields.items():
            if not _equal(here[kind, name][field], value):
                return f"{field} of the {kind} {name} is {here[kind, name][field]} instead of {value}"
    return ""


def _equal(one: np.ndarray | float, other: np.ndarray | float) -> bool:
    return bool(np.allclose(one, other, MAX_RELATIVE_DIFFERENCE, MAX_ABSOLUTE_DIFFERENCE))


def _elements(model: mujoco.MjModel) -> Iterator[tuple[tuple[str, str], dict[str, np.ndarray]]]:
    """Every element by kind and name, with its fields. Elements without a name are numbered within their body."""
    counts = {"body": model.nbody, "geom": model.ngeom, "jnt": model.njnt, "actuator": model.nu}
    objects = {
        "body": mujoco.mjtObj.mjOBJ_BODY,
        "geom": mujoco.mjtObj.mjOBJ_GEOM,
        "jnt": mujoco.mjtObj.mjOBJ_JOINT,
        "actuator": mujoco.mjtObj.mjOBJ_ACTUATOR,
    }
    for kind, count in counts.items():
        for index in range(count):
            name = mujoco.mj_id2name(model, objects[kind], index)
            if not name:
                body = getattr(model, f"{kind}_bodyid")[index]
                first = getattr(model, f"body_{kind}adr")[body]
                name = f"{index - first} of {mujoco.mj_id2name(model, objects['body'], body)}"
            fields = {field: getattr(model, f"{kind}_{field}")[index] for field in FIELDS[kind]}
            if kind == "geom" and model.geom_type[index] != mujoco.mjtGeom.mjGEOM_MESH:
                fields |= {field: getattr(model, f"geom_{field}")[index] for field in SHAPES}
            if kind == "jnt":
                fields |= {field: getattr(model, f"dof_{field}")[model.jnt_dofadr[index]] for field in DOFS}
            for field in fields.keys() & {"quat"}:  # both signs are the same rotation
                fields[field] = fields[field] * np.sign(fields[field][np.argmax(np.abs(fields[field]))])
            yield (kind, name), fields
