"""Pendulum: a ball on a thin stiff rod that swings below a gantry in one plane, without losses.

    =====o=====     beam, along y
         |  \\
         |   \\  rod
      angle   O  bob, at +x where the angle is positive

A rod without mass and a ball of radius r at the distance L from the axle swing like a simple pendulum of the length

    l = L + 2/5 r^2 / L

Its motion has a closed form for any amplitude A: with w = sqrt(g / l), k = sin(A / 2) and u = w t,

    sin(angle / 2) = k cd(u, k^2),    period = 4 K(k^2) / w,    rate^2 = 2 w^2 (cos angle - cos A),

with t = 0 at the turning point at +A, Jacobi's elliptic functions and K the complete elliptic integral of the first
kind. (Landau and Lifshitz, Mechanics, section 11; the familiar 1 + A^2 / 16 + 11 A^4 / 3072 is the series of K.)
"""

import math
from dataclasses import dataclass
from functools import cached_property

import mujoco
from scipy.special import ellipj, ellipk, ellipkinc

from ..geometry import quat
from ..params import param
from ..physics import GRAVITY
from .ball import STEEL_DENSITY
from .prop import Prop, Rgba, carry, show, shown, solid

ROD_RADIUS = 0.002
"""Radius of the rod [m]."""
BEAM_HALF_WIDTH = 0.008
"""Half the thickness of beam and posts [m]."""
FOOT_SIZE = 0.024
"""Width of a post's foot along y, and half its length along x [m]."""
COLLISION_FREE_LENGTH = 0.02
"""Length of the rod below the axle that does not collide [m]: it would touch the beam."""
FRAME_COLOUR = (0.35, 0.37, 0.40, 1.0)
"""Colour of beam and posts."""
ROD_COLOUR = (0.2, 0.2, 0.22, 1.0)
"""Colour of the rod."""


@dataclass(frozen=True, kw_only=True)
class Pendulum(Prop):
    """A gantry with a pendulum that swings along x, unless it is turned.

    The origin is on the ground below the axle; that of the swinging body `bob` is the centre of the ball. The paper
    gives no sizes ("a sphere swings on an undamped pendulum at moderate amplitude", App. B, T11).
    """

    length: float = param(0.40, "m", 0.2, 0.7)
    """Distance from the axle to the bob's centre."""
    radius: float = param(0.022, "m", 0.010, 0.032)
    """Radius of the bob."""
    density: float = param(STEEL_DENSITY, "kg/m^3", 200.0, 12000.0)
    friction: float = param(0.8, "1", 0.05, 1.5)
    height: float = param(0.69, "m", 0.3, 1.0)
    """Height of the axle above the ground."""
    span: float = param(0.19, "m", 0.1, 0.4)
    """Distance from the axle's middle to each post."""
    angle: float = 0.0
    """Initial angle, positive where the bob is at +x [rad]. The family sets it."""
    turn: float = 0.0
    """Angle of the plane of the swing about the vertical, from x [rad]. The gantry is not turned."""
    rgba: Rgba = (0.80, 0.16, 0.12, 1.0)

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        for y in (-self.span, self.span):
            solid(
                body,
                "",
                [BEAM_HALF_WIDTH, BEAM_HALF_WIDTH, self.height / 2],
                [0, y, self.height / 2],
                condim=3,
                rgba=FRAME_COLOUR,
            )
            solid(body, "", [FOOT_SIZE, FOOT_SIZE / 2, 0.003], [0, y, 0.003], condim=3, rgba=FRAME_COLOUR)
        solid(
            body,
            "beam",
            [BEAM_HALF_WIDTH, self.span, BEAM_HALF_WIDTH],
            [0, 0, self.height],
            condim=3,
            rgba=FRAME_COLOUR,
        )
        along, at = self.length * math.sin(self.angle), self.height - self.length * math.cos(self.angle)
        bob = body.add_body(name="bob", pos=[along, 0, at], quat=quat("y", -self.angle))
        carry(bob, (0.0, 0.0, 0.0), quat("z", self.turn))
        self._fill_bob(bob)

    def _fill_bob(self, bob: mujoco.MjsBody) -> None:
        """Fill the swinging body. Its joint reads 0 where it hangs straight down."""
        hinge = mujoco.mjtJoint.mjJNT_HINGE
        bob.add_joint(name="hinge", type=hinge, axis=[0, -1, 0], pos=[0, 0, self.length], ref=self.angle)
        sphere, capsule = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE
        solid(bob, "ball", [self.radius], type=sphere, mass=self.mass, friction=self.friction, rgba=self.rgba)
        half = (self.length - COLLISION_FREE_LENGTH - self.radius) / 2
        middle = [0, 0, self.radius + half]
        solid(bob, "rod", [ROD_RADIUS, half, 0], middle, type=capsule, mass=0.0, condim=3, rgba=ROD_COLOUR)
        shown(
            bob,
            "",
            ROD_COLOUR,
            type=capsule,
            size=[ROD_RADIUS, COLLISION_FREE_LENGTH / 2, 0],
            pos=[0, 0, self.length - COLLISION_FREE_LENGTH / 2],
        )
        for geom in bob.geoms:  # drag of an ellipsoid with all coefficients zero: no air resistance
            geom.fluid_ellipsoid, geom.fluid_coefs = 1, [0.0] * 5

    @cached_property
    def size(self) -> tuple[float, float]:
        """Lengths of its outline on the ground along x and y [m]."""
        return 2 * FOOT_SIZE, 2 * self.span + FOOT_SIZE

    # --- mechanics ------------------------------------------------------------------------

    @cached_property
    def mass(self) -> float:
        """Mass of the bob [kg]. The rod has no mass."""
        return self.density * 4.0 / 3.0 * math.pi * self.radius**3

    @cached_property
    def inertia(self) -> float:
        """Inertia about the axle [kg m^2]."""
        return self.mass * (self.length**2 + 0.4 * self.radius**2)

    @cached_property
    def pace(self) -> float:
        """Angular frequency of small swings [rad/s]."""
        return math.sqrt(GRAVITY * self.mass * self.length / self.inertia)

    def period(self, amplitude: float) -> float:
        """Period of a swing to `amplitude` [rad] on both sides [s]."""
        return float(4.0 * ellipk(math.sin(amplitude / 2) ** 2) / self.pace)

    def rate(self, amplitude: float, angle: float) -> float:
        """Angular speed at `angle` [rad] of a swing to `amplitude` [rad], in [rad/s]; 0 beyond the amplitude."""
        return self.pace * math.sqrt(2.0 * max(0.0, math.cos(angle) - math.cos(amplitude)))

    def swing(self, amplitude: float, phase: float) -> tuple[float, float]:
        """Angle [rad] and rate [rad/s] of a swing to `amplitude` [rad].

        Args:
            phase: time since the turning point on the positive side, as a share of the period.
        """
        k = math.sin(amplitude / 2)
        sn, cn, dn, _ = ellipj(4.0 * ellipk(k * k) * (phase % 1.0), k * k)
        angle = 2.0 * math.asin(k * cn / dn)
        return angle, -math.copysign(self.rate(amplitude, angle), sn)

    def amplitude(self, angle: float, rate: float) -> float:
        """Amplitude [rad] of a swing that passes `angle` [rad] at `rate` [rad/s], by energy; pi if over the top."""
        return math.acos(max(-1.0, math.cos(angle) - (rate / self.pace) ** 2 / 2))

    def until_turning(self, angle: float, rate: float, side: int) -> float:
        """Time from `angle` [rad] and `rate` [rad/s] until the next turning point on one side, -1 or 1 [s]."""
        k = math.sin(self.amplitude(angle, rate) / 2)
        quarter = ellipk(k * k)
        passed = ellipkinc(math.asin(min(1.0, max(-1.0, side * math.sin(angle / 2) / k))), k * k)
        left = quarter - passed if side * rate >= 0.0 else 3 * quarter + passed
        return float(left / self.pace)


if __name__ == "__main__":
    show(Pendulum())
