"""An inlaid rod has the mass, centre of mass and inertia of its wood and its lead, and shows the lead."""

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from scengen.assets.box import LEAD_DENSITY
from scengen.assets.inlaid_rod import WOOD_DENSITY, InlaidRod


def two_parts(rod):
    """The same rod as MuJoCo would compute it from two boxes of even density."""
    spec, side = mujoco.MjSpec(), np.copysign(1.0, rod.com)
    body, wood = spec.worldbody.add_body(name="body"), rod.width - rod.inlay
    for thick, density, place in ((wood, WOOD_DENSITY, -rod.inlay / 2), (rod.inlay, LEAD_DENSITY, wood / 2)):
        half = np.array([rod.width, max(thick, 1e-9), rod.height]) / 2
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[0, side * place, rod.height / 2], density=density)
    return spec.compile()


@given(width=st.floats(0.02, 0.05), height=st.floats(0.1, 0.3), com=st.floats(-0.012, 0.012))
def test_its_mass_is_spread_as_that_of_wood_and_lead(width, height, com):
    rod = InlaidRod(width=width, height=height, com=com)
    assume(rod.possible and abs(com) > 1e-4)
    one, other = (model.body("body") for model in (rod.spec().compile(), two_parts(rod)))
    assert one.mass == pytest.approx(other.mass)
    assert one.ipos == pytest.approx(other.ipos) and one.ipos[1] == pytest.approx(com)
    assert sorted(one.inertia) == pytest.approx(sorted(other.inertia))


def test_a_thicker_inlay_moves_the_centre_of_mass_until_the_lead_is_too_thick():
    thick = [InlaidRod(com=com).inlay for com in (0.0, 0.002, 0.006, 0.009)]
    assert thick[0] == 0.0 and thick == sorted(thick) and InlaidRod(com=0.009).possible
    assert not InlaidRod(com=0.012).possible


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_side_of_the_lead_is_seen(side):
    model = InlaidRod(com=side * 0.006).spec().compile()
    assert model.geom("inlay").pos[1] * side > 0.01 and not model.geom("inlay").contype[0]
