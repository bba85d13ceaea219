"""A zone is only looked at: nothing collides with it, and its bars can be counted."""

import mujoco
import numpy as np
import pytest

from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.zone import Zone


@pytest.mark.parametrize("label", [1, 2, 3])
def test_it_has_as_many_bars_as_its_label_says_outside_its_square(label):
    zone = Zone(label=label)
    model = zone.spec().compile()
    bars = [i for i in range(model.ngeom) if model.geom(i).name.startswith("bar")]
    assert len(bars) == label
    for bar in bars:
        assert model.geom_pos[bar][0] - model.geom_size[bar][0] > zone.size / 2
    places = sorted(model.geom_pos[bars][:, 1])
    assert np.all(np.diff(places) > 2 * model.geom_size[bars[0]][1]), "bars are apart"
    assert sum(places) == pytest.approx(0.0, abs=1e-9)


def test_a_cube_slides_across_it_as_across_the_table():
    """From 0.25 m/s over v^2 / (2 mu g), with and without a zone under it."""
    ways = []
    for zone in (False, True):
        scene = table()
        if zone:
            place(scene, Zone(label=3), "zone", [0, 0, TABLE_TOP], free=False)
        place(scene, Cube(friction=0.4), "cube", [0, 0, TABLE_TOP])
        model = scene.compile()
        data = mujoco.MjData(model)
        data.qvel[0] = 0.25
        mujoco.mj_step(model, data, 500)
        ways.append(data.qpos[0])
    assert ways[0] == ways[1] == pytest.approx(0.25**2 / (2 * 0.4 * 9.81), rel=0.06)
