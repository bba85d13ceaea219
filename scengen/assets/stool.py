"""A low stool: a plate on four legs, screwed to whatever it stands on."""

from dataclasses import dataclass

import mujoco

from ..params import check_bounds, param
from .prop import PRIORITY, STIFF, show


@dataclass(frozen=True, kw_only=True)
class Stool:
    """x is the long axis; the origin is the centre of its foot. The paper gives no lengths ("a narrow stool")."""

    length: float = param(0.085, "m", 0.03, 0.25)
    width: float = param(0.040, "m", 0.03, 0.25)
    height: float = param(0.080, "m", 0.02, 0.20)
    friction: float = param(0.6, "1", 0.05, 1.5)
    rgba: tuple[float, float, float, float] = (0.45, 0.33, 0.22, 1.0)

    PLATE = 0.010
    """Thickness of the plate and of the legs [m]."""

    def __post_init__(self) -> None:
        check_bounds(self)

    def spec(self) -> mujoco.MjSpec:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body(name="body")
        plate, leg = self.PLATE / 2, (self.height - self.PLATE) / 2
        self._box(body, "plate", [self.length / 2, self.width / 2, plate], [0, 0, self.height - plate])
        for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
            spot = [x * (self.length / 2 - plate), y * (self.width / 2 - plate), leg]
            self._box(body, f"leg_{i}", [plate, plate, leg], spot)
        return spec

    def _box(self, body: mujoco.MjsBody, name: str, half: list[float], pos: list[float]) -> None:
        body.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=half,
            pos=pos,
            density=700.0,  # beech [kg/m^3]
            friction=[self.friction, 0.005, 0.0001],
            condim=4,
            solref=STIFF,
            priority=PRIORITY,
            rgba=self.rgba,
        )


if __name__ == "__main__":
    show(Stool())
