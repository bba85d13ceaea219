"""What several tests need."""

import json
import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import strategies as st

from scengen.params import parameters, with_values
from scengen.pictures import render
from scengen.pool import Pool

ROOT = Path(__file__).parents[1]
REFERENCES = ROOT / "generated" / "reference"
"""The pools that come with scengen, one for each task."""
REFERENCE = Path(os.environ.get("SCENGEN_REFERENCE", REFERENCES / "domino_single-id"))
"""The small pool that tests read. Under another MuJoCo than that of the repository's, `make stacks` makes one."""
STORED_MUJOCO = json.loads((REFERENCES / "domino_single-id" / "manifest.json").read_text())["versions"]["mujoco"]
of_stored_pools = pytest.mark.skipif(
    mujoco.__version__ != STORED_MUJOCO, reason=f"the pools of the repository were made with mujoco {STORED_MUJOCO}"
)
"""Mark of tests that certify or verify with the stored pools."""


def other_under_mujoco_4(reason):
    """Mark of a test that holds a number of MuJoCo 3.5, and that must fail under MuJoCo 4."""
    return pytest.mark.xfail(int(mujoco.__version__.partition(".")[0]) >= 4, reason=reason, strict=True)


def anywhere(cls):
    """Any instance within its own bounds."""
    values = {p.name: (st.integers if p.integer else st.floats)(p.low, p.high) for p in parameters(cls())}
    return st.fixed_dictionaries(values).map(lambda drawn: with_values(cls(), drawn))


def shift(body, offset):
    """Move a body of a scene by an offset in its own axes [m]."""
    turned = np.empty(3)
    mujoco.mju_rotVecQuat(turned, np.asarray(offset, float), body.quat)
    body.pos = body.pos + turned


def certified_here(pool):
    """Skip a test of a stored pool that was certified under another MuJoCo: its verdicts are about that version."""
    made = Pool.open(pool).manifest.versions["mujoco"]
    if made != mujoco.__version__:
        pytest.skip(f"{pool.name} was certified under MuJoCo {made}")


def needs_robosuite():
    """Skip a test, or a file of tests, where robosuite's environments do not run."""
    reason = "robosuite does not run here; it is an extra"
    pytest.importorskip("scengen.envs.robosuite_models", reason=reason, exc_type=ImportError)


def env_class(task, search=()):
    """The class of a task's environments in robosuite. Where they do not run, the test is skipped."""
    needs_robosuite()
    from scengen.envs.robosuite import env_class

    return env_class(task, search)


def pictures_are_possible():
    """Whether this machine has OpenGL."""
    row = next(Pool.open(REFERENCE).rows(witness=False))
    try:
        with render.camera(row.scene_xml, row.embodiment):
            return True
    except render.NoPictures:
        return False
