"""Differences between the supported versions of MuJoCo (3.5 to 4.x): no other module asks for a version."""

from typing import Any

import mujoco
import numpy as np

ROBOSUITE_RUNS = hasattr(mujoco.MjData, "qM")
"""Whether robosuite's controllers run: they read the inertia matrix from `MjData.qM`, which MuJoCo 4 lacks."""


def set_damping(joint: mujoco.MjsJoint, damping: float) -> None:
    """Set the viscous friction of a joint [N m s/rad or N s/m].

    In MuJoCo 4 `damping` holds the coefficients of speed, its square and its cube.
    """
    value: Any = [damping, 0.0, 0.0] if np.ndim(joint.damping) else damping
    joint.damping = value
