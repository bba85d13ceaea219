"""Blocks: upright boxes with a square foot, all alike from outside whatever they weigh."""

from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .scene import PRIORITY, STIFF, show


@dataclass(frozen=True, kw_only=True)
class Block:
    """A painted box with an unknown filling; the origin is the centre of its foot.

    The paper gives no lengths. The width leaves the 80 mm jaw 20 mm of air on either side; the density that follows
    from the nominal mass, 3100 kg/m^3, lies between glass and a steel-filled shell.
    """

    width: float = param(0.040, "m", 0.02, 0.07)
    height: float = param(0.050, "m", 0.02, 0.12)
    mass: float = param(0.25, "kg", 0.02, 1.0, hidden=True)
    friction: float = param(0.8, "1", 0.05, 1.5)
    """Rubber on painted wood: 0.7 to 0.9."""
    rgba: tuple[float, float, float, float] = (0.20, 0.36, 0.66, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        body.add_geom(
            name="box",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[self.width / 2, self.width / 2, self.height / 2],
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
    show(Block())
