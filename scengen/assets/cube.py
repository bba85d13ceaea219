"""A cube to be fetched."""

from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .scene import PRIORITY, STIFF, show


@dataclass(frozen=True, kw_only=True)
class Cube:
    """A solid cube; the origin is the centre of its foot.

    The paper gives no numbers. The edge leaves the 80 mm jaw 15 mm of air on either side; the mass is that of soft
    plastic foam to hardwood at this size (125 cm^3: 0.06 kg for pine, 0.09 kg for beech, 0.14 kg for nylon).
    """

    edge: float = param(0.050, "m", 0.02, 0.07)
    mass: float = param(0.08, "kg", 0.01, 1.0, hidden=True)
    friction: float = param(0.5, "1", 0.05, 1.5, hidden=True)
    rgba: tuple[float, float, float, float] = (0.82, 0.20, 0.15, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        body.add_geom(
            name="box",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[self.edge / 2] * 3,
            pos=[0, 0, self.edge / 2],
            mass=self.mass,
            friction=[self.friction, 0.005, 0.0001],
            condim=4,
            solref=STIFF,
            priority=PRIORITY,
            rgba=self.rgba,
        )
        return spec


if __name__ == "__main__":
    show(Cube())
