"""A pendulum keeps the period of the textbook and its amplitude, and its closed form is where MuJoCo takes it."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen.assets.pendulum import GRAVITY, Pendulum
from scengen.assets.prop import TABLE_TOP, place, table


class Swing:
    """A pendulum without robot, released at rest from its start angle."""

    def __init__(self, pendulum: Pendulum):
        scene = table()
        place(scene, pendulum, "pendulum", [0, 0, TABLE_TOP], free=False)
        self.model = scene.compile()
        self.data = mujoco.MjData(self.model)
        self.pendulum, self.step = pendulum, self.model.opt.timestep
        self.data.qpos[0] = pendulum.angle

    def angles(self, seconds: float) -> np.ndarray:
        """Its angle after every physics step [rad]."""
        found = []
        for _ in range(round(seconds / self.step)):
            mujoco.mj_step(self.model, self.data)
            found.append(self.data.qpos[0])
        return np.array(found)


def measured_period(swing: Swing, periods: int) -> float:
    """From the times at which it passes the lowest point forwards [s], by interpolation."""
    angles = swing.angles((periods + 1) * swing.pendulum.period(abs(swing.pendulum.angle)))
    k = np.flatnonzero((angles[:-1] < 0) & (angles[1:] >= 0))
    times = swing.step * (k + angles[k] / (angles[k] - angles[k + 1]))
    return (times[periods] - times[0]) / periods


@pytest.mark.parametrize(
    ("length", "degrees", "seconds"), [(0.40, 10.0, 1.2719), (0.40, 30.0, 1.2916), (0.55, 45.0, 1.5476)]
)
def test_the_period_is_that_of_the_textbook(length, degrees, seconds):
    """T = 2 pi sqrt(I / (m g L)) (1 + A^2 / 16 + 11 A^4 / 3072), I = m (L^2 + 2/5 r^2)."""
    pendulum = Pendulum(length=length, angle=math.radians(degrees))
    inertia, a = length**2 + 0.4 * pendulum.radius**2, math.radians(degrees)
    series = 2 * math.pi * math.sqrt(inertia / (GRAVITY * length)) * (1 + a**2 / 16 + 11 * a**4 / 3072)
    assert series == pytest.approx(seconds, abs=1e-4)
    assert pendulum.period(a) == pytest.approx(series, rel=2e-4)  # the next term of the series
    assert measured_period(Swing(pendulum), 3) == pytest.approx(series, rel=5e-4)


def test_it_swings_on_undamped():
    """After 10 s it still comes to within a thousandth of where it started."""
    angles = Swing(Pendulum(angle=0.5)).angles(10.0)
    assert angles[-1000:].max() == pytest.approx(0.5, rel=1e-3) == -angles[-1000:].min()


@given(amplitude=st.floats(0.2, 0.9), phase=st.floats(0.0, 1.0))
@settings(max_examples=30, deadline=None)
def test_amplitude_and_turning_points_follow_from_any_moment(amplitude, phase):
    pendulum = Pendulum()
    angle, rate = pendulum.swing(amplitude, phase)
    assert pendulum.amplitude(angle, rate) == pytest.approx(amplitude, abs=1e-9)
    period = pendulum.period(amplitude)
    for side, turning in ((1, 0.0), (-1, 0.5)):
        late = pendulum.until_turning(angle, rate, side) / period - (turning - phase)
        assert late == pytest.approx(round(late), abs=1e-6)


def test_the_closed_form_is_where_the_simulation_is():
    """Within 0.3 deg of the elliptic functions for two periods of 40 deg."""
    pendulum = Pendulum(angle=math.radians(40.0))
    period = pendulum.period(pendulum.angle)
    angles = Swing(pendulum).angles(2 * period)
    times = 0.002 * (1 + np.arange(len(angles)))
    expected = [pendulum.swing(pendulum.angle, t / period)[0] for t in times]
    assert np.abs(angles - expected).max() < math.radians(0.3)
