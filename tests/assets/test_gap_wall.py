"""Through a gap passes what is narrower; over a kerb rolls what is faster than a textbook says."""

import math

import mujoco
import pytest

from scengen.assets.ball import Ball
from scengen.assets.gap_wall import GapWall, Kerb
from scengen.assets.prop import TABLE_TOP, place, table

BALL = Ball(radius=0.025, density=600.0, friction=0.6)


def with_ball(asset, at):
    scene = table()
    place(scene, asset, "asset", [0.0, 0.0, TABLE_TOP], free=False)
    place(scene, BALL, "ball", [*at, TABLE_TOP + BALL.radius])
    model = scene.compile()
    return model, mujoco.MjData(model)


def touching(model, data):
    pairs = {frozenset(model.body(model.geom_bodyid[g]).name for g in contact.geom) for contact in data.contact}
    return {"asset", "ball"} in pairs


@pytest.mark.parametrize(("air", "touches"), [(0.0005, False), (-0.0005, True)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_ball_in_the_gap_touches_a_jamb_if_its_air_is_used_up(side, air, touches):
    wall = GapWall()
    model, data = with_ball(wall, [0.0, side * (wall.gap / 2 - BALL.radius - air)])
    mujoco.mj_forward(model, data)
    assert touching(model, data) == touches


def test_the_parts_of_the_wall_are_as_long_as_they_are_told():
    model = GapWall(left=0.5, right=0.2).spec().compile()
    ends = [model.geom(side).pos[1] + sign * model.geom(side).size[1] for side in ("right", "left") for sign in (-1, 1)]
    assert ends == pytest.approx([-0.236, -0.036, 0.036, 0.536])


@pytest.mark.parametrize(("share", "over"), [(0.85, False), (1.15, True)])
def test_a_rolling_ball_gets_over_a_kerb_if_its_spin_about_the_edge_lifts_it(share, over):
    """Angular momentum about the edge is kept, energy after that: v (1 - 5/7 h/r) = sqrt(10/7 g h)."""
    kerb = Kerb()
    rolls = math.sqrt(10 / 7 * 9.81 * kerb.height) / (1 - 5 / 7 * kerb.height / BALL.radius)
    model, data = with_ball(kerb, [-0.06, 0.0])
    data.qvel[0], data.qvel[4] = share * rolls, share * rolls / BALL.radius
    mujoco.mj_step(model, data, 400)
    assert (float(data.body("ball").xpos[0]) > 0.0) == over
