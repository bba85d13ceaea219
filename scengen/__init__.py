"""scengen: physical puzzles for robot manipulation, each proved solvable before anyone meets it."""

import ctypes.util
import os
import sys

if sys.platform == "linux" and not {"MUJOCO_GL", "DISPLAY"} & os.environ.keys():
    # MuJoCo chooses its OpenGL back end when it is imported, and without a display its own choice cannot draw.
    for _library, _backend in (("EGL", "egl"), ("OSMesa", "osmesa")):
        if ctypes.util.find_library(_library):
            os.environ["MUJOCO_GL"] = _backend
            break
