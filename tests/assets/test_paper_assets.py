"""Every line of the paper's list of assets (App. D.1) is reached by a builder, ranges at both ends.

`tests/export/test_mesh.py` checks its last one: that meshes of all assets can be written, closed.
"""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import pytest

from scengen.assets.bowl import Bowl
from scengen.assets.box import Domino
from scengen.assets.cage import BOTTOM, END, SIDE, TOP, HoledCage
from scengen.assets.chain import Chain
from scengen.assets.cracker_box import CrackerBox
from scengen.assets.cup import Cup
from scengen.assets.dish import Dish
from scengen.assets.hook import BARBED_J, ROUND_J, JHook, THook
from scengen.assets.keyboard import Keyboard
from scengen.assets.plate import Plate
from scengen.assets.ramp import Ramp
from scengen.assets.seesaw import Seesaw
from scengen.params import parameters


def compiled(prop):
    """Model and data of an asset alone, at its start."""
    model = prop.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def floor_height(model, data, x):
    """Height of what a ray from above meets at x, beside which nothing covers the asset [m]."""
    return 1.0 - mujoco.mj_ray(model, data, [x, 0.0, 1.0], [0.0, 0.0, -1.0], None, 1, -1, np.zeros(1, np.int32))


# --- measurements on the compiled model ---------------------------------------------------


def steepest(prop):
    """Steepest slope along x that rays from above meet [deg]."""
    model, data = compiled(prop)
    heights = [floor_height(model, data, x) for x in np.arange(0.0, prop.span / 2 - 0.005, 0.005)]
    return np.degrees(np.arctan(max(b - a for a, b in pairwise(heights)) / 0.005))


def friction(prop):
    """Largest sliding friction of its geoms."""
    model, _ = compiled(prop)
    return model.geom_friction[model.geom_contype > 0, 0].max()


def mass(prop):
    """Mass of the asset [kg]."""
    return compiled(prop)[0].body_mass.sum()


def beam_mass(prop):
    model, _ = compiled(prop)
    return model.body("beam").mass[0]


def pivot(prop):
    """Distance of the axle from the middle of the beam, along it [m]."""
    model, _ = compiled(prop)
    return -model.body("beam").ipos[0]


def extent(prop, axis):
    """Length of the asset along an axis [m]."""
    model, data = compiled(prop)
    lows, highs = [], []
    for g in np.flatnonzero(model.geom_contype):
        rot = data.geom_xmat[g].reshape(3, 3)
        half = np.abs(rot) @ model.geom_aabb[g, 3:]
        middle = data.geom_xpos[g] + rot @ model.geom_aabb[g, :3]
        lows.append(middle - half)
        highs.append(middle + half)
    return float((np.max(highs, axis=0) - np.min(lows, axis=0))[axis])


def gaps(chain):
    """Free space between the faces of neighbouring tiles, over their width; all spaces are equal."""
    feet, tile = chain.feet, chain.tile
    free = [feet[i + 1][0] - feet[i][0] - tile.thickness for i in range(chain.count - 1)]
    assert np.ptp(free) < 1e-12
    return free[0] / tile.width


def chain(ratio):
    """A chain of ordinary tiles with a gap, in tile widths."""
    tile = Domino()
    return Chain(4, ratio * tile.width, tile, tile, tile)


# --- the list -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Range:
    """A range of the paper, the builder that reaches it, and what is measured at its ends."""

    line: str
    builder: Any
    parameter: str
    ends: tuple[float, float]
    measured: Any
    fixed: dict[str, Any] = field(default_factory=dict)
    within: float = 1e-9

    def at(self, value: float) -> Any:
        return self.builder(**{self.parameter: value}, **self.fixed)


RANGES = (
    Range("Galileo ramp, angle 10-60 deg", Ramp, "angle", (10.0, 60.0), steepest, {"bend": 0.04}, 0.2),
    Range("Galileo ramp, mu in [0.10, 0.50]", Ramp, "friction", (0.10, 0.50), friction),
    Range("Domino strips, gap 0.6-1.4 tile widths", chain, "ratio", (0.6, 1.4), gaps),
    Range("Domino strips, tile mass 0.02-0.08 kg", Domino, "mass", (0.02, 0.08), mass),
    Range("Seesaw, pivot offset +-0.10 m", Seesaw, "pivot_offset", (-0.10, 0.10), pivot),
    Range("Seesaw, beam mass 0.20-0.80 kg", Seesaw, "mass", (0.20, 0.80), beam_mass),
)


@pytest.mark.parametrize("end", [0, 1], ids=["low", "high"])
@pytest.mark.parametrize("row", RANGES, ids=lambda row: row.line)
def test_both_ends_of_a_range_are_built_and_measured(row, end):
    assert row.measured(row.at(row.ends[end])) == pytest.approx(row.ends[end], abs=row.within)


HOOKS = {"J, round": ROUND_J, "J, barbed": BARBED_J, "T": THook()}
PARAMETRIC = {
    "J, handle length": (JHook, "length", 0),
    "J, hook radius": (JHook, "radius", 1),
    "T, handle length": (THook, "length", 0),
}
"""Builder, parameter, and the axis along which the hook grows with it. The paper gives no numbers."""


def test_there_are_two_variants_of_a_j_and_a_t():
    """By the number of their free ends beside the handle: a half circle, one with a straight end that leads back, and
    a bar to both sides."""
    assert isinstance(ROUND_J, JHook) and isinstance(BARBED_J, JHook)
    boxes = {name: compiled(hook)[0].ngeom for name, hook in HOOKS.items()}
    assert boxes["J, barbed"] == boxes["J, round"] + 1 and boxes["T"] == 2


@pytest.mark.parametrize("name", PARAMETRIC)
def test_a_hook_grows_with_its_parameter_over_the_whole_range(name):
    kind, parameter, axis = PARAMETRIC[name]
    (low, high) = next((p.low, p.high) for p in parameters(kind()) if p.name == parameter)
    grown = extent(kind(**{parameter: high}), axis) - extent(kind(**{parameter: low}), axis)
    assert grown >= 0.9 * (high - low)


@pytest.mark.parametrize("curve", [0.0, 0.5, 1.0])
def test_a_cup_has_a_rigid_handle_of_any_curvature(curve):
    """Rigid: all of it is one body without a joint. Its outermost point stays where the handle ends."""
    cup = Cup(handle=0.04, curve=curve)
    model, _ = compiled(cup)
    assert model.nbody == 2 and model.njnt == 0
    bare = extent(Cup(handle=0.0), 0)
    assert extent(cup, 0) - bare == pytest.approx(0.04, abs=0.012)


@pytest.mark.parametrize("face", [BOTTOM, END, SIDE, TOP])
def test_a_cage_has_one_round_hole_on_the_face_that_is_asked_for(face):
    """A ray from the middle of the hole outwards meets nothing; half a radius beyond the rim it meets the wall."""
    cage = HoledCage(face=face, offset=0.0, hole=0.012)
    model, data = compiled(cage)
    beside = np.cross(cage.normal, [0.0, 0.0, 1.0] if abs(cage.normal[2]) < 0.5 else [1.0, 0.0, 0.0])

    def free(point):
        start = point - 0.004 * cage.normal
        return mujoco.mj_ray(model, data, start, cage.normal, None, 1, -1, np.zeros(1, np.int32)) < 0

    assert free(cage.hole_centre) and free(cage.hole_centre + 0.9 * cage.hole * beside)
    assert not free(cage.hole_centre + 1.5 * cage.hole * beside)


VARIANTS = {
    "Cracker box, 4 size variants": (CrackerBox, "scale", (0.75, 0.85, 1.0, 1.15), 2),
    "Plates, 4 diameters": (Plate, "radius", (0.08, 0.10, 0.12, 0.13), 0),
    "Plates for two jaws, 4 diameters": (Dish, "radius", (0.08, 0.10, 0.12, 0.13), 0),
    "Bowl, 2 sizes": (Bowl, "radius", (0.065, 0.080), 0),
}


@pytest.mark.parametrize("line", VARIANTS)
def test_every_variant_is_built_and_each_is_larger_than_the_last(line):
    kind, parameter, values, axis = VARIANTS[line]
    sizes = [extent(kind(**{parameter: value}), axis) for value in values]
    assert all(b > 1.05 * a for a, b in pairwise(sizes))


@pytest.mark.parametrize("kind", [Plate, Dish])
@pytest.mark.parametrize("thickness", [0.002, 0.003, 0.005])
def test_plates_have_three_thicknesses(kind, thickness):
    """Seen by rays through its flat middle, from above and from below."""
    model, data = compiled(kind(thickness=thickness))
    ids = np.zeros(1, np.int32)
    above = 1.0 - mujoco.mj_ray(model, data, [0.01, 0.005, 1.0], [0.0, 0.0, -1.0], None, 1, -1, ids)
    below = mujoco.mj_ray(model, data, [0.01, 0.005, -1.0], [0.0, 0.0, 1.0], None, 1, -1, ids) - 1.0
    assert above - below == pytest.approx(thickness, abs=3e-4)


def test_a_cracker_box_is_of_low_friction():
    assert friction(CrackerBox()) <= 0.25


def test_a_keyboard_has_a_key_for_every_letter_each_with_a_contact_of_its_own_and_feedback():
    """Bodies of their own tell contacts apart. The feedback, a letter that turns bold, is tested with the task."""
    model, _ = compiled(Keyboard())
    keys = [model.body(b).name for b in range(model.nbody)]
    assert {name[-1].upper() for name in keys if "key" in name} >= set("QWERTYUIOPASDFGHJKLZXCVBNM")
