"""Dominoes: tall boxes that stand on their smallest face."""

import math
from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .scene import PRIORITY, STIFF, show


@dataclass(frozen=True, kw_only=True)
class Domino:
    """One tile. x is the thin axis, the way it falls; the origin is the centre of its foot.

    Mass range: paper, App. D.1 ("tile mass 0.02-0.08 kg"); the paper gives no lengths.
    """

    height: float = param(0.080, "m", 0.03, 0.20)
    width: float = param(0.040, "m", 0.01, 0.10)
    thickness: float = param(0.012, "m", 0.006, 0.04)
    mass: float = param(0.050, "kg", 0.005, 0.5)
    friction: float = param(0.5, "1", 0.05, 1.5)
    rgba: tuple[float, float, float, float] = (0.90, 0.86, 0.76, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def tipping_angle(self) -> float:
        """Tilt at which the centre of mass passes over the edge of the foot [rad]."""
        return math.atan2(self.thickness, self.height)

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        body.add_geom(
            name="box",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[self.thickness / 2, self.width / 2, self.height / 2],
            pos=[0, 0, self.height / 2],
            mass=self.mass,
            friction=[self.friction, 0.005, 0.0001],
            condim=4,
            solref=STIFF,
            priority=PRIORITY,
            rgba=self.rgba,
        )
        return spec


if __name__ == "__main__":
    show(Domino())
