"""What several tests need."""

from pathlib import Path

import pytest
from hypothesis import strategies as st

from scengen.params import parameters, with_values
from scengen.pictures import render
from scengen.pool import Pool

REFERENCE = Path(__file__).parents[1] / "generated" / "reference"


def anywhere(cls):
    """Any instance within its own bounds."""
    values = {p.name: (st.integers if p.integer else st.floats)(p.low, p.high) for p in parameters(cls())}
    return st.fixed_dictionaries(values).map(lambda drawn: with_values(cls(), drawn))


def env_class(task, search=()):
    """The class of a task's environments in robosuite. Without robosuite the test is skipped."""
    pytest.importorskip("robosuite", reason="no robosuite; it is an extra")
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
