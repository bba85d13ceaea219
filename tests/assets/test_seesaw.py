"""A seesaw obeys the lever law, hangs like a balance, and swings like a physical pendulum."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scengen.assets.box import Block
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.seesaw import Seesaw, standing
from scengen.geometry import UP
from scengen.physics import GRAVITY

BEAM = "seesaw/beam"


class Balance:
    """A seesaw, level at the start, with blocks on its deck; no robot."""

    def __init__(self, seesaw: Seesaw, *loads: tuple[float, float]):
        """Args: loads, mass [kg] and place along the deck [m] of each block."""
        scene = table()
        place(scene, seesaw, "seesaw", [0, 0, TABLE_TOP], free=False)
        for i, (mass, along) in enumerate(loads):
            place(scene, Block(mass=mass), f"block_{i}", [along, 0, TABLE_TOP + seesaw.height])
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    @property
    def tilt(self) -> float:
        """In degrees, positive where +x is down."""
        return math.degrees(-math.asin(self.data.body(BEAM).xmat[6]))

    def after(self, seconds: float) -> "Balance":
        mujoco.mj_step(self.model, self.data, round(seconds / self.model.opt.timestep))
        return self


def stiffness(seesaw: Seesaw, *masses: float) -> float:
    """Restoring torque per small angle of a deck with blocks [N m/rad]: the weight of all that hangs, by its depth."""
    return GRAVITY * seesaw.stiffness([standing(Block(mass=mass), 0.0) for mass in masses])


@given(mass=st.floats(0.1, 0.4), ratio=st.floats(0.5, 2.0), lever=st.floats(0.06, 0.13))
@settings(max_examples=12, deadline=None)
def test_twice_the_mass_balances_at_half_the_distance(mass, ratio, lever):
    """m_1 r_1 = m_2 r_2; what the dry friction of the bearing can hold is the only tolerance."""
    seesaw = Seesaw()
    deck = Balance(seesaw, (mass, lever), (mass / ratio, -lever * ratio)).after(3.0)
    held = math.degrees(seesaw.rubbing / stiffness(seesaw, mass, mass / ratio))
    assert abs(deck.tilt) <= held + 0.05 < 0.6


def test_unequal_moments_tilt_it_by_their_difference_over_the_stiffness():
    """Two blocks of 250 g at 140 and 120 mm, beam 350 g: tan = 0.25 x 0.02 / (0.35 x 0.066 + 0.5 x 0.035) = 0.123."""
    deck = Balance(Seesaw(), (0.25, 0.14), (0.25, -0.12)).after(4.0)
    assert deck.tilt == pytest.approx(7.02, abs=0.35)
    rest = Seesaw().rest([standing(Block(mass=0.25), 0.14), standing(Block(mass=0.25), -0.12)])
    assert math.degrees(rest) == pytest.approx(7.02, abs=0.01)


@given(
    beam=st.floats(0.2, 0.8),
    pivot=st.floats(-0.1, 0.1),
    mass=st.floats(0.1, 0.4),
    tilt=st.floats(-8.0, 8.0),
    lever=st.floats(0.06, 0.16),
)
@settings(max_examples=20, deadline=None)
def test_the_angle_of_rest_is_where_the_moments_about_the_axle_vanish(beam, pivot, mass, tilt, lever):
    """The second block is put where the formula asks for, given a tilt; the deck must come to rest at that tilt."""
    seesaw = Seesaw(mass=beam, pivot_offset=pivot, length=0.8)
    torque = math.tan(math.radians(tilt)) * stiffness(seesaw, mass, 0.3) / GRAVITY
    along = (torque + beam * pivot - mass * lever) / 0.3
    assume(lever - along > 0.05 and along > -0.28)
    held = math.degrees(seesaw.rubbing / stiffness(seesaw, mass, 0.3))
    assert Balance(seesaw, (mass, lever), (0.3, along)).after(5.0).tilt == pytest.approx(tilt, abs=held + 0.35)


@pytest.mark.parametrize("side", [-1, 1])
def test_too_much_on_one_arm_puts_it_on_its_stop(side):
    assert Balance(Seesaw(), (0.3, side * 0.2)).after(2.0).tilt == pytest.approx(side * 10.0, abs=0.2)


@pytest.mark.parametrize(("mass", "pivot"), [(0.2, 0.0), (0.8, 0.0), (0.5, 0.02), (0.5, -0.02)])
def test_without_friction_it_swings_like_a_physical_pendulum(mass, pivot):
    """T = 2 pi sqrt(I / k), with I about the axle: 1.45 s for a deck 0.6 m long, 66 mm below it, whatever it weighs."""
    seesaw = Seesaw(mass=mass, pivot_offset=pivot, damping=0.0, rubbing=0.0, height=0.15, stop=25.0)
    rest = seesaw.rest([])
    depth = seesaw.drop + seesaw.thickness / 2
    inertia = mass * ((seesaw.length**2 + seesaw.thickness**2) / 12 + pivot**2 + depth**2)
    expected = 2 * math.pi * math.sqrt(inertia / (mass * GRAVITY * math.hypot(depth, pivot)))
    assert pivot or expected == pytest.approx(1.45, abs=0.005)
    deck = Balance(replace(seesaw, tilt=rest + math.radians(2.0)))
    crossings = []
    while len(crossings) < 3:
        assert deck.data.time < 5.0, "it does not swing"
        before = deck.tilt - math.degrees(rest)
        deck.after(0.002)
        if before * (deck.tilt - math.degrees(rest)) < 0:
            crossings.append(deck.data.time)
    assert crossings[2] - crossings[0] == pytest.approx(expected, rel=0.01)


def test_the_bearing_holds_a_tilt_that_it_can_and_no_more():
    """Dry friction of 0.002 N m on a bare deck of 0.23 N m/rad: half a degree."""
    seesaw = Seesaw(rubbing=0.002)
    held = math.degrees(seesaw.rubbing / stiffness(seesaw))
    assert held == pytest.approx(0.5, abs=0.02)
    for factor, stays in ((0.7, True), (1.5, False)):
        start = factor * held
        moved = abs(Balance(replace(seesaw, tilt=math.radians(start))).after(3.0).tilt - start)
        assert (moved < 0.05) == stays


@given(pivot=st.floats(-0.10, 0.10), length=st.floats(0.2, 0.8))
@settings(max_examples=25, deadline=None)
def test_the_ends_of_the_deck_are_where_it_says(pivot, length):
    deck = Balance(Seesaw(pivot_offset=pivot, length=length))
    geom = deck.data.geom("seesaw/deck")
    along = geom.xpos[0] - deck.data.body(BEAM).xpos[0]
    half = deck.model.geom("seesaw/deck").size[0]
    seesaw = Seesaw(pivot_offset=pivot, length=length)
    assert (along - half, along + half) == pytest.approx((-seesaw.arm(-1), seesaw.arm(1)))
    assert geom.xpos[2] + deck.model.geom("seesaw/deck").size[2] == pytest.approx(TABLE_TOP + Seesaw().height)


@given(along=st.floats(-0.3, 0.3), tilt=st.floats(-0.15, 0.15))
@settings(max_examples=25, deadline=None)
def test_a_point_of_the_tilted_deck_is_on_its_upper_face(along, tilt):
    deck = Balance(Seesaw(tilt=tilt, pivot_offset=0.05))
    geom, seesaw = deck.data.geom("seesaw/deck"), Seesaw(pivot_offset=0.05)
    point = TABLE_TOP * UP + seesaw.on_deck(along, tilt)
    away = geom.xmat.reshape(3, 3).T @ (point - geom.xpos)
    assert away == pytest.approx([along + seesaw.pivot_offset, 0.0, seesaw.thickness / 2])


@pytest.mark.parametrize(
    ("side", "taken", "parts"),
    [
        (-1, 0.14, [(-0.276, -0.055)]),
        (1, 0.14, [(0.055, 0.084), (0.196, 0.276)]),
        (-1, -0.14, [(-0.276, -0.196), (-0.084, -0.055)]),
        (1, 0.10, [(0.156, 0.276)]),
        (1, 0.25, [(0.055, 0.194)]),
    ],
)
def test_there_is_room_on_an_arm_up_to_its_end_and_to_either_side_of_what_stands_there(side, taken, parts):
    found = Seesaw().stretches(side, inner=0.055, rim=0.024, taken=taken, apart=0.056)
    assert np.allclose(found, parts)


def test_level_is_where_its_joint_reads_zero_whatever_it_starts_from():
    for start in (-0.15, 0.0, 0.1):
        deck = Balance(Seesaw(tilt=start))
        assert deck.data.joint("seesaw/axle").qpos[0] == pytest.approx(start)
        assert math.radians(deck.tilt) == pytest.approx(start)
        assert np.allclose(deck.data.body(BEAM).xpos, (TABLE_TOP + Seesaw().axle) * UP)
