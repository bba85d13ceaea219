"""A shallow bin: a rectangular floor with four walls, lower than what is packed into it."""

from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .prop import PRIORITY, STIFF, show


@dataclass(frozen=True, kw_only=True)
class Bin:
    """The space inside is `width` along x by `height` along y. The origin is the middle of the foot.

    The paper gives no sizes (App. B, T33).
    """

    width: float = param(0.12, "m", 0.04, 0.40)
    height: float = param(0.14, "m", 0.04, 0.40)
    depth: float = param(0.012, "m", 0.003, 0.10)
    wall: float = param(0.008, "m", 0.002, 0.02)
    floor: float = param(0.004, "m", 0.002, 0.02)
    friction: float = param(0.4, "1", 0.05, 1.5)
    rgba: tuple[float, float, float, float] = (0.30, 0.36, 0.44, 1.0)

    def __post_init__(self) -> None:
        check_bounds(self)

    @property
    def area(self) -> float:
        """Of the floor inside [m^2]."""
        return self.width * self.height

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        half_x, half_y = self.width / 2, self.height / 2
        rim, thick = (self.floor + self.depth) / 2, self.wall / 2
        parts = {
            "floor": ((half_x, half_y, self.floor / 2), (0.0, 0.0, self.floor / 2)),
            "left": ((half_x + self.wall, thick, rim), (0.0, half_y + thick, rim)),
            "right": ((half_x + self.wall, thick, rim), (0.0, -half_y - thick, rim)),
            "near": ((thick, half_y, rim), (-half_x - thick, 0.0, rim)),
            "far": ((thick, half_y, rim), (half_x + thick, 0.0, rim)),
        }
        for name, (size, pos) in parts.items():
            body.add_geom(
                name=name,
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=size,
                pos=pos,
                mass=1000 * 8 * size[0] * size[1] * size[2],  # a plastic of 1 kg a litre; unused while the bin is fixed
                friction=[self.friction, 0.005, 0.0001],
                condim=4,
                solref=STIFF,
                priority=PRIORITY,
                rgba=self.rgba,
            )
        return spec


if __name__ == "__main__":
    show(Bin())
