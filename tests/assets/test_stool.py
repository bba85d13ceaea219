"""A stool carries what stands on it, up to the edge and no further."""

import mujoco
import pytest

from scengen.assets.box import Cube
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.stool import Stool


@pytest.mark.parametrize(("beyond", "falls"), [(-0.002, False), (0.002, True)])
@pytest.mark.parametrize("along", [0, 1])
def test_a_block_tips_off_once_its_centre_is_beyond_the_edge(along, beyond, falls):
    stool, scene, spot = Stool(), table(), [0.0, 0.0, TABLE_TOP + Stool().height]
    spot[along] += (stool.length, stool.width)[along] / 2 + beyond
    place(scene, stool, "stool", [0, 0, TABLE_TOP], free=False)
    place(scene, Cube(edge=0.03), "block", spot)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 1000)
    assert (data.body("block").xpos[2] < TABLE_TOP + stool.height - 0.01) == falls


def test_a_stool_is_as_high_as_it_says():
    stool, scene = Stool(height=0.08), mujoco.MjSpec()
    place(scene, stool, "stool", [0, 0, 0], free=False)
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert mujoco.mj_ray(model, data, [0, 0, 1.0], [0, 0, -1.0], None, 1, -1, None) == pytest.approx(0.92)
    assert (data.geom_xpos[:, 2] - model.geom_size[:, 2]).min() == pytest.approx(0.0, abs=1e-12)
