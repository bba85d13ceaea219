"""A rod has the mass, centre of mass and inertia of a tube with a slug in it, and shows nothing of that."""

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.rod import SLUG_EDGE, SLUG_SHARE, Rod


def two_parts(rod):
    """The same rod as MuJoCo would compute it from a tube, as a box of even density, and a slug."""
    spec = mujoco.MjSpec()
    body, middle = spec.worldbody.add_body(name="body"), rod.width / 2
    tube, slug = rod.size / 2, np.full(3, SLUG_EDGE / 2)
    box = mujoco.mjtGeom.mjGEOM_BOX
    body.add_geom(type=box, size=tube, pos=[0, 0, middle], mass=(1 - SLUG_SHARE) * rod.mass)
    body.add_geom(type=box, size=slug, pos=[0, rod.slug, middle], mass=SLUG_SHARE * rod.mass)
    return spec.compile()


@given(rod=anywhere(Rod))
@settings(max_examples=40, deadline=None)
def test_its_mass_is_spread_as_that_of_a_tube_with_a_slug(rod):
    one, other = (model.body("body") for model in (rod.spec().compile(), two_parts(rod)))
    assert one.mass == pytest.approx(other.mass)
    assert one.ipos == pytest.approx(other.ipos) and one.ipos[1] == pytest.approx(rod.com)
    assert sorted(one.inertia) == pytest.approx(sorted(other.inertia))


def test_where_the_slug_is_changes_nothing_but_how_the_mass_is_spread():
    one, other = (Rod(com=com, mass=mass).spec().compile() for com, mass in ((0.08, 0.1), (-0.03, 0.15)))
    for name in ("geom_size", "geom_pos", "geom_rgba", "geom_friction", "geom_solref", "body_pos", "names"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    assert not np.array_equal(one.body_ipos, other.body_ipos)
