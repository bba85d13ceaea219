"""Visible quantities of a scene at the start: places, sizes and colours of bodies, what lies between, and ranks.

They come from the compiled scene, not from parameters, which may state answers, nor from features, which may hold
masses. Names:

    cube.x                     of a body: x, y, z [m], away [m from the robot], yaw [deg], width, length, height [m],
                               redness, lightness
    tray-cube.dx               between two bodies: dx, dy, apart, width, height [m]
    tray in cube.ahead         place of the tray in the axes of the cube: ahead, left [m]
    most height of shape       number of the body with the most or the least of something among like bodies
    the one with redness 0.61, lightness 0.40 of shape      number of the only body of that colour among like bodies
"""

import math
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import NDArray

from ...decisions import Decision
from ...robots.panda import BASE
from ...scenario import Scenario
from ...sim.boxes import box_around

MOST_COMPARED = 9
"""Number of bodies up to which all pairs are compared."""
MISSING = -9.0
"""Value of a quantity that a scene lacks: far outside the table, and no colour or size."""
LIKE = re.compile(r"(.*?)_?(\d+|[A-Z])(_0)?")
"""Names of like bodies, such as `piece_2` or the first tile of chain 2, `tile_2_0`: stem and number."""
FOLLOWING = re.compile(r".*_\d+_[1-9]\d*")
"""Names of later bodies of a chain, such as `tile_2_1`. They follow from the first one."""

Floats = NDArray[np.float64]


def visible(scenario: Scenario) -> tuple[dict[str, float], dict[str, Floats]]:
    """Visible quantities of a scenario by name, and the poses (x, y, yaw) of its bodies [m, m, rad]."""
    model = scenario.build().compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = {model.body(i).name: _body(model, data, i) for i in range(1, model.nbody)}
    bodies = {name: body for name, body in bodies.items() if body and not _left_out(scenario, name)}
    found = {f"{name}.{key}": value for name, body in bodies.items() for key, value in body.items()}
    found.update(_ranks(bodies))
    poses = {n: np.array([body["x"], body["y"], math.radians(body["yaw"])]) for n, body in bodies.items()}
    for a, b in combinations(bodies, 2) if len(bodies) <= MOST_COMPARED else ():
        for key in ("width", "height"):
            found[f"{b}-{a}.{key}"] = bodies[b][key] - bodies[a][key]
        found.update(_between(a, b, poses))
    return found, poses


def _left_out(scenario: Scenario, name: str) -> bool:
    concealed = any(fnmatchcase(name, pattern) for pattern in scenario.CONCEALED)
    return concealed or name == "table" or bool(FOLLOWING.fullmatch(name))


def _body(model: mujoco.MjModel, data: mujoco.MjData, number: int) -> dict[str, float]:
    """Quantities of one body, from the box around its visible geoms; none if no geom is visible."""
    first = int(model.body_geomadr[number])
    geoms = [g for g in range(first, first + int(model.body_geomnum[number])) if _colour(model, g)[3] > 0]
    if not geoms:
        return {}
    low, high = box_around(model, geoms)
    turn = data.xmat[number].reshape(3, 3)
    middle = data.xpos[number] + turn @ ((low + high) / 2)
    width, length = sorted((high - low)[:2])
    colour = _colour(model, max(geoms, key=lambda g: model.geom_aabb[g, 3:].prod()))
    return {
        **dict(zip("xyz", map(float, middle), strict=True)),
        "away": math.dist(middle[:2], BASE[:2]),
        "yaw": math.degrees(math.atan2(turn[1, 0], turn[0, 0])),
        "width": float(width),
        "length": float(length),
        "height": float(high[2] - low[2]),
        "redness": float(colour[0] - colour[2]),
        "lightness": float(colour[:3].mean()),
    }


def _colour(model: mujoco.MjModel, geom: int) -> Floats:
    """Colour of a geom, or of its material, shape (4,)."""
    material = int(model.geom_matid[geom])
    return model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]


def _ranks(bodies: Mapping[str, Mapping[str, float]]) -> Iterator[tuple[str, float]]:
    """Numbers of the bodies with the most and the least of each quantity, or with separate colours, among like
    bodies."""
    groups: dict[str, list[str]] = defaultdict(list)
    for name in bodies:
        if like := LIKE.fullmatch(name):
            groups[like[1]].append(name)
    for stem, members in groups.items():
        for key in bodies[members[0]]:
            values = np.round([bodies[member][key] for member in members], 6)
            if np.ptp(values) > 1e-5:
                yield f"least {key} of {stem}", float(values.argmin())
                yield f"most {key} of {stem}", float(values.argmax())
        shades = [f"redness {bodies[m]['redness']:.2f}, lightness {bodies[m]['lightness']:.2f}" for m in members]
        for number, shade in enumerate(shades):
            if shades.count(shade) == 1 < len(shades):
                yield f"the one with {shade} of {stem}", float(number)


def _between(a: str, b: str, poses: Mapping[str, Floats]) -> Iterator[tuple[str, float]]:
    """Quantities between two bodies."""
    way = poses[b][:2] - poses[a][:2]
    yield f"{b}-{a}.dx", float(way[0])
    yield f"{b}-{a}.dy", float(way[1])
    yield f"{b}-{a}.apart", math.hypot(*way)
    for one, other, to in ((a, b, way), (b, a, -way)):
        c, s = math.cos(poses[one][2]), math.sin(poses[one][2])
        yield f"{other} in {one}.ahead", float(c * to[0] + s * to[1])
        yield f"{other} in {one}.left", float(c * to[1] - s * to[0])


@dataclass(frozen=True)
class Sample:
    """Scenarios of a split with their visible quantities and decisions."""

    scenarios: Sequence[Scenario]
    """The scenarios."""
    quantities: Sequence[Mapping[str, float]]
    """Visible quantities of each scenario."""
    poses: Sequence[Mapping[str, Floats]]
    """Poses of the bodies of each scenario (x, y, yaw)."""
    decisions: Sequence[Mapping[str, Decision]]
    """Decisions of each scenario."""

    @classmethod
    def of(cls, scenarios: Sequence[Scenario]) -> "Sample":
        """The sample of some scenarios."""
        seen = [visible(scenario) for scenario in scenarios]
        decisions = [scenario.decisions() for scenario in scenarios]
        return cls(scenarios, [q for q, _ in seen], [p for _, p in seen], decisions)

    def __len__(self) -> int:
        return len(self.scenarios)

    def part(self, places: Sequence[int]) -> "Sample":
        """The scenarios at these places."""
        return Sample(
            [self.scenarios[k] for k in places],
            [self.quantities[k] for k in places],
            [self.poses[k] for k in places],
            [self.decisions[k] for k in places],
        )

    def with_decision(self, name: str) -> "Sample":
        """The scenarios that have a decision of that name."""
        return self.part([k for k, one in enumerate(self.decisions) if name in one])

    def columns(self, names: Sequence[str]) -> Floats:
        """Values of quantities, shape (scenarios, names)."""
        return np.array([[row.get(name, MISSING) for name in names] for row in self.quantities], float)

    def names(self) -> list[str]:
        """Names of all quantities."""
        return list(dict.fromkeys(name for row in self.quantities for name in row))


def joined(samples: Sequence[Sample]) -> Sample:
    """One sample of the scenarios of several."""
    columns = ("scenarios", "quantities", "poses", "decisions")
    return Sample(*([one for sample in samples for one in getattr(sample, column)] for column in columns))
