"""Solids of revolution: as hollow as they claim, still when left alone, with inertia and balance from a textbook."""

import math

import mujoco
import numpy as np
import pytest
import trimesh
from helpers import anywhere
from hypothesis import example, given, settings
from hypothesis import strategies as st
from manifold3d import CrossSection, Manifold

from scengen.assets.bowl import BEAD_HEIGHT, Bowl
from scengen.assets.box import Block
from scengen.assets.cup import MIN_HANDLE, RIM_HEIGHT, Cup
from scengen.assets.plate import Plate
from scengen.assets.prop import TABLE_TOP, place, table
from scengen.assets.turned import FOOT_PROTRUSION, SECTORS
from scengen.physics import GRAVITY
from scengen.sim.scene_text import emit

ALL = [
    Plate(),
    Plate(thickness=0.002, mass=0.02, radius=0.13),
    Plate(lip=0.0, rise=0.012, radius=0.08, thickness=0.003),
    Plate(rise=0.0),
    Plate(hole=0.015),
    Cup(),
    Cup(smooth_outside=True),
    Cup(base=0.041, rim=0.041, wall=0.004, bead=0.0),
    Bowl(),
    Bowl(radius=0.065),
    Bowl(radius=0.09, depth=0.06, foot=0.02),
]
HANDLED = [
    Cup(handle=0.045, base=0.041, rim=0.041, wall=0.004, floor=0.005, bead=0.0, mass=0.08),
    Cup(handle=0.045, curve=0.5),
    Cup(handle=0.045, curve=1.0),
]


def name(solid):
    changed = (f"{k}={v}" for k, v in vars(solid).items() if v != getattr(type(solid)(), k))
    return " ".join([type(solid).__name__, *changed])


def revolved(outline):
    """The round body of half an outline, with 720 corners to a circle: 0.001 % short of its radius."""
    return Manifold.revolve(CrossSection([outline]), 720)


def round_body(solid):
    """The solid of revolution itself, by constructive solid geometry."""
    found = sum((revolved(list(section.corners)) for section in solid.sections), Manifold()).to_mesh64()
    return trimesh.Trimesh(np.asarray(found.vert_properties)[:, :3], np.asarray(found.tri_verts))


def on_table(solid, quat=(1.0, 0.0, 0.0, 0.0), height=0.0, slope=0.0):
    """A solid on the table, off its middle; a gravity that leans by `slope` [rad] towards +x."""
    scene = table()
    scene.option.gravity = [GRAVITY * math.sin(slope), 0, -GRAVITY * math.cos(slope)]
    place(scene, solid, "solid", [0.013, 0.017, TABLE_TOP + height])
    model = mujoco.MjSpec.from_string(emit(scene)[0]).compile()
    data = mujoco.MjData(model)
    data.qpos[3:7] = quat
    return model, data


def probed(solid, spots, radius):
    """How many balls of that radius [m] at those places [m] touch the solid."""
    touching = 0
    for spot in spots:
        spec = solid.spec()
        probe = spec.worldbody.add_body(pos=spot)
        probe.add_geom(name="probe", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0, 0])
        probe.add_freejoint()
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        touching += data.ncon > 0
    return touching


@pytest.mark.parametrize("solid", ALL + HANDLED, ids=name)
@pytest.mark.parametrize("over", [False, True], ids=["upright", "upside down"])
def test_left_alone_it_stands_still(solid, over):
    """1 mm of drift is what a certificate allows; a hundredth of that is requested here."""
    model, data = on_table(solid, (0, 1, 0, 0) if over else (1, 0, 0, 0), solid.height if over else 0.0)
    mujoco.mj_step(model, data, 500)
    before = data.qpos.copy()
    mujoco.mj_step(model, data, 1000)
    assert np.linalg.norm(data.qpos[:3] - before[:3]) < 1e-5
    assert 2 * math.acos(min(1.0, abs(before[3:7] @ data.qpos[3:7]))) < math.radians(0.01)
    assert data.xmat[-1, 8] == pytest.approx(-1.0 if over else 1.0, abs=1e-6)
    assert np.abs(data.qvel).max() < 1e-3
    assert data.qpos[2] - TABLE_TOP == pytest.approx(solid.height if over else 0.0, abs=1e-5)


@pytest.mark.parametrize("solid", ALL, ids=name)
def test_mass_and_inertia_are_those_of_the_round_body(solid):
    model, body = solid.spec().compile(), round_body(solid)
    body.density = solid.mass / body.volume
    moments = np.diag(body.moment_inertia)
    assert model.body("body").mass == pytest.approx(solid.mass)
    assert model.body("body").ipos == pytest.approx([0, 0, body.center_mass[2]], abs=1e-7)
    assert np.sort(model.body("body").inertia) == pytest.approx(np.sort(moments), rel=2e-5)


def wedges(solid):
    """What a compiled solid collides with, but for its feet."""
    model = solid.spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for g in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        mesh = model.geom_dataid[g]
        corners = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        yield Manifold.hull_points(corners @ data.geom_xmat[g].reshape(3, 3).T + data.geom_xpos[g])


def hollow(solid):
    """The space inside, up to the rim, as a round body."""
    match solid:
        case Plate():
            well = [(0, solid.thickness), (solid.foot, solid.thickness), (solid.radius - solid.lip, solid.height)]
            bore = Manifold.cylinder(solid.thickness, solid.hole, circular_segments=720)
            return revolved([*well, (0, solid.height)]) + bore
        case Cup():
            beaded, end = solid.bead > solid.wall, solid.height
            below, edge = end - (BEAD_HEIGHT if beaded else RIM_HEIGHT), max(solid.bead, solid.wall)
            well = [(solid.outer(z) - solid.wall, z) for z in (solid.floor, below)]
            mouth = [(solid.outer(z) - edge, z) for z in (below, end)]
            return revolved([(0, solid.floor), *well, (0, below)]) + revolved([(0, below), *mouth, (0, end)])
        case Bowl():
            sphere = revolved(
                [(solid.inner * math.sin(a), -solid.inner * math.cos(a)) for a in np.linspace(0, math.pi, 181)]
            )
            sphere = sphere.translate((0, 0, solid.centre)).trim_by_plane((0, 0, 1), solid.floor)
            return sphere.trim_by_plane((0, 0, -1), -(solid.depth - 1.3 * BEAD_HEIGHT))


def test_a_bead_may_be_a_grip_on_its_inside_only():
    rough, smooth = Cup(friction=0.1), Cup(friction=0.1, smooth_outside=True)
    for solid, outside in ((rough, 0.8), (smooth, 0.1)):
        at_bead = [part for part in solid.sections if part.corners[0][1] == solid.height - BEAD_HEIGHT]
        assert min(at_bead, key=lambda part: part.corners[0][0]).friction == 0.8
        assert max(at_bead, key=lambda part: part.corners[1][0]).friction == outside
    assert smooth.inertial()[0] == pytest.approx(rough.inertial()[0])
    assert smooth.inertial()[1] == pytest.approx(rough.inertial()[1])


@given(solid=st.one_of(anywhere(Plate), anywhere(Cup), anywhere(Bowl)))
@settings(max_examples=15, deadline=None)
def test_anywhere_within_its_bounds_the_wedges_are_the_polygon_about_the_circle(solid):
    parts, body = list(wedges(solid)), round_body(solid)
    volume = SECTORS / math.pi * math.tan(math.pi / SECTORS) * body.volume
    whole = sum(parts, Manifold())
    assert (whole.volume(), sum(part.volume() for part in parts)) == pytest.approx((volume, volume), rel=1e-4)
    bounds = whole.bounding_box()
    assert (bounds[2], bounds[5]) == pytest.approx((FOOT_PROTRUSION, solid.height), abs=1e-6)


@pytest.mark.parametrize("solid", ALL, ids=name)
def test_no_wedge_reaches_into_the_hollow(solid):
    space = hollow(solid)
    assert max((part ^ space).volume() for part in wedges(solid)) < 1e-12


@given(cup=anywhere(Cup))
@example(cup=Cup(height=0.125, base=0.032, rim=0.054, wall=0.002, floor=0.008, bead=0.0, handle=0.031, bar=0.016))
@settings(max_examples=25, deadline=None)
def test_a_ball_fits_into_a_cup_by_size_alone_and_feels_no_handle(cup):
    """Where the wall leans the ball touches it at the foot of the perpendicular, half a ball's lean lower or higher."""
    middle = 0.5 * (cup.floor + cup.height - BEAD_HEIGHT)
    lean = math.atan2(cup.rim - cup.base, cup.height)
    room = (cup.outer(middle) - cup.wall) * math.cos(lean)
    radius = min(room, middle - cup.floor, (cup.height - BEAD_HEIGHT - middle) / (1 + abs(math.sin(lean))))
    assert probed(cup, [(0, 0, middle)], radius - 1e-5) == 0
    if radius == room:
        assert probed(cup, [(0, 0, middle)], 1.01 * radius) == 1


@pytest.mark.parametrize("tilt", [0.0, 0.02], ids=["put down", "dropped askew"])
def test_a_box_stands_in_a_cup_on_its_floor_and_does_not_rock(tilt):
    cup, scene = Cup(), table()
    place(scene, cup, "cup", [0, 0, TABLE_TOP])
    place(scene, Block(width=0.040), "block", [0.002, 0.001, TABLE_TOP + cup.floor + tilt * 0.02])
    model = mujoco.MjSpec.from_string(emit(scene)[0]).compile()
    data = mujoco.MjData(model)
    data.joint("block_free").qpos[3:] = [math.cos(tilt / 2), math.sin(tilt / 2), 0, 0]
    mujoco.mj_step(model, data, 2000)
    assert data.body("block").xpos[2] - TABLE_TOP == pytest.approx(cup.floor, abs=1e-4)
    assert np.abs(data.qvel).max() < 1e-3


def test_underneath_two_faces_of_a_cup_that_are_seen_do_not_lie_in_one_plane():
    """They would flicker in pictures, of a cup that is upside down from the start."""
    model = Cup().spec().compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    below, upwards = np.array([0.003, 0.001, -0.1]), np.array([0.0, 0.0, 1.0])

    def distance(g):
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            return mujoco.mj_rayMesh(model, data, g, below, upwards)
        where = data.geom_xpos[g], data.geom_xmat[g], model.geom_size[g]
        return mujoco.mju_rayGeom(*where, below, upwards, model.geom_type[g])

    seen = sorted(d for g in np.flatnonzero(model.geom_group < 3) if (d := distance(g)) >= 0.0)
    assert seen[0] == pytest.approx(0.1 + FOOT_PROTRUSION, abs=1e-6)
    assert np.diff(seen).min(initial=1.0) > 1e-4


@given(bowl=anywhere(Bowl), turn=st.floats(0, 2 * math.pi), tilt=st.floats(0.0, 1.0))
@settings(max_examples=25, deadline=None)
def test_a_ball_may_lie_anywhere_against_the_inner_sphere_of_a_bowl(bowl, turn, tilt):
    radius = 0.010
    low, high = (bowl.inner * math.cos(a) for a in (bowl._foot_angle, bowl._foot_angle + 5 * bowl._band_angle))
    up = low + tilt * (high - low)
    away = bowl.inner - radius
    out = np.array([math.cos(turn), math.sin(turn)]) * math.sqrt(1 - (up / bowl.inner) ** 2)
    spot = np.array([*(away * out), bowl.centre - away * up / bowl.inner])
    bead = bowl._corner(bowl.outer - bowl.bead, bowl._foot_angle + 6 * bowl._band_angle)
    off_bead = math.hypot(math.hypot(*spot[:2]) - bead[0], spot[2] - bead[1])
    if spot[2] - radius > bowl.floor and off_bead > radius + 0.001:
        assert probed(bowl, [spot], radius - 1e-5) == 0
        assert probed(bowl, [spot], radius + 0.01 * bowl.inner) == 1


@given(
    mass=st.floats(0.02, 0.3), radius=st.floats(0.03, 0.05), height=st.floats(0.07, 0.14), wall=st.floats(0.002, 0.005)
)
@settings(max_examples=20, deadline=None)
def test_a_straight_cup_has_the_inertia_of_a_tube_and_a_disc(mass, radius, height, wall):
    """Tube: m (R^2 + r^2) / 2 and m (3 (R^2 + r^2) + h^2) / 12; disc: m R^2 / 2 and m (3 R^2 + h^2) / 12."""
    cup = Cup(mass=mass, base=radius, rim=radius, height=height, wall=wall, bead=0.0)
    tall, flat, inner = height - cup.floor + FOOT_PROTRUSION, cup.floor - 2 * FOOT_PROTRUSION, radius - wall
    areas = np.array([radius**2 - inner**2, radius**2])
    m = mass * areas * [tall, flat] / (areas @ [tall, flat])
    z = np.array([height - tall / 2, FOOT_PROTRUSION + flat / 2])
    squares = np.array([radius**2 + inner**2, radius**2])
    com, inertia = cup.inertial()
    assert com == pytest.approx([0, 0, m @ z / mass])
    across = m @ ((3 * squares + np.array([tall, flat]) ** 2) / 12 + (z - com[2]) ** 2)
    assert np.diag(inertia) == pytest.approx([across, across, m @ squares / 2])


@given(bowl=anywhere(Bowl))
@settings(max_examples=20, deadline=None)
def test_a_bowl_has_nearly_the_mass_in_its_shell_that_two_spheres_enclose(bowl):
    """Zone of a sphere between two angles: 2 pi (R^3 - r^3) / 3 times the difference of the cosines."""
    shell = [s.moments()[0] for s in bowl.sections if s.name.startswith("shell")]
    first, last = bowl._foot_angle, bowl._foot_angle + 6 * bowl._band_angle
    zone = (bowl.outer**3 - bowl.inner**3) / 3 * (math.cos(first) - math.cos(last))
    assert 0.8 * zone < sum(shell) < zone


@pytest.mark.parametrize(("factor", "tips"), [(0.95, False), (1.05, True)])
@pytest.mark.parametrize(
    "cup", [Cup(friction=1.5), Cup(friction=1.5, height=0.14, base=0.035), Bowl(friction=1.5)], ids=name
)
def test_a_cup_tips_where_its_centre_of_mass_passes_its_edge(cup, factor, tips):
    foot = cup.foot if isinstance(cup, Bowl) else cup.base
    assert math.tan(cup.tipping_angle) == pytest.approx(foot / round_body(cup).center_mass[2], rel=1e-4)
    model, data = on_table(cup, slope=factor * cup.tipping_angle)
    mujoco.mj_step(model, data, 750)
    assert (data.xmat[-1, 8] < math.cos(math.radians(20))) == tips


@pytest.mark.parametrize(("factor", "tips"), [(0.92, False), (1.05, True), (-1.05, False)])
def test_a_cup_tips_sooner_towards_its_handle(factor, tips):
    """A narrow one, whose handle stays off the table; feet are 1 mm inside its edge. Leaning away it stands."""
    cup = Cup(base=0.035, handle=0.03, friction=1.5)
    model, data = on_table(cup, slope=factor * cup.tipping_angle)
    mujoco.mj_step(model, data, 500)
    assert (data.xmat[-1, 8] < math.cos(math.radians(15))) == tips


@pytest.mark.parametrize("cup", HANDLED, ids=name)
def test_the_handle_has_the_inertia_of_its_bars(cup):
    """Against MuJoCo's own sum over geoms of one density; bars overlap at their joints, and walls are polygons."""
    spec = cup.spec()
    body = spec.body("body")
    body.explicitinertial = False
    feet = [geom for geom in body.geoms if geom.name.startswith("foot")]
    for geom in body.geoms:
        geom.mass, geom.density = float("nan"), 1.0
    for geom in feet:
        geom.mass = 0.0
    model = spec.compile()
    scale = cup.mass / model.body("body").mass
    com, inertia = cup.inertial()
    assert model.body("body").ipos == pytest.approx(com, abs=1e-3)
    assert np.sort(scale * model.body("body").inertia) == pytest.approx(np.linalg.eigvalsh(inertia), rel=0.03)


@pytest.mark.parametrize("cup", HANDLED, ids=name)
def test_a_finger_fits_behind_the_handle_and_the_jaw_around_its_upright(cup):
    """The palm keeps 32 mm from the wall; a finger is 21 mm wide and 10 mm thick."""
    assert cup.grip[0] - cup.outer(cup.grip[2]) == pytest.approx(cup.handle - 0.006)
    assert probed(cup, [cup.grip], 0.001) == 1
    beside = np.array([0, 0.0075, 0])
    assert probed(cup, [cup.grip + beside, cup.grip - beside], 0.001) == 0
    assert probed(cup, [cup.grip - [0.0225, 0, 0]], 0.0105) == 0


def test_a_stub_is_no_handle():
    assert Cup(handle=MIN_HANDLE).has_handle and not Cup(handle=0.9 * MIN_HANDLE).has_handle


@pytest.mark.parametrize(("slope", "slides"), [(0.9, False), (1.1, True)])
@pytest.mark.parametrize("over", [False, True], ids=["upright", "upside down"])
def test_a_cup_slides_by_the_friction_of_what_it_stands_on(over, slope, slides):
    """0.25 upside down, on its rim, and 0.4 on its foot, although its wall has 0.4 and the table 1."""
    cup = Cup(friction=0.4, height=0.07)
    friction = cup.rim_friction if over else cup.friction
    model, data = on_table(cup, (0, 1, 0, 0) if over else (1, 0, 0, 0), over * cup.height, math.atan(slope * friction))
    mujoco.mj_step(model, data, 500)
    assert (abs(data.qpos[0] - 0.013) > 0.02) == slides


@given(mass=st.floats(0.02, 0.3), radius=st.floats(0.08, 0.13), thickness=st.floats(0.002, 0.006))
@settings(max_examples=20, deadline=None)
def test_a_flat_plate_has_the_inertia_of_a_disc(mass, radius, thickness):
    """m r^2 / 2 about the axis and m r^2 / 4 + m h^2 / 12 across it; feet take `FOOT_PROTRUSION` of the height."""
    disc = Plate(mass=mass, radius=radius, thickness=thickness, rise=0.0)
    com, inertia = disc.inertial()
    height = thickness - FOOT_PROTRUSION
    assert com == pytest.approx([0, 0, FOOT_PROTRUSION + height / 2])
    across = mass * (radius**2 / 4 + height**2 / 12)
    assert np.diag(inertia) == pytest.approx([across, across, mass * radius**2 / 2])


@pytest.mark.parametrize(("factor", "tips"), [(0.9, False), (1.1, True)])
@pytest.mark.parametrize("plate", [Plate(), Plate(foot=0.03, mass=0.2)], ids=name)
def test_a_plate_tips_under_a_press_on_its_lip_that_beats_its_weight_about_the_foot(plate, factor, tips):
    """F (r - foot) = m g foot: 0.49 N x 50 / 60 on a plate of 50 g."""
    model, data = on_table(plate)
    at = plate.radius - 0.005
    force = factor * plate.mass * GRAVITY * plate.foot / (at - plate.foot)
    mujoco.mj_forward(model, data)
    body = model.body("solid").id
    for _ in range(500):
        push = np.zeros(model.nv)
        spot = data.xpos[body] + data.xmat[body].reshape(3, 3) @ [at, 0, plate.height]
        mujoco.mj_applyFT(model, data, [0, 0, -force], [0, 0, 0], spot, body, push)
        data.qfrc_applied[:] = push
        mujoco.mj_step(model, data)
    tilt = math.acos(np.clip(data.xmat[body, 8], -1, 1))
    assert (tilt > 0.9 * plate.pressed_tilt) == tips
    assert tilt < 1.1 * plate.pressed_tilt


@given(plate=anywhere(Plate).filter(lambda p: p.hole > 0.001))
@settings(max_examples=15, deadline=None)
def test_a_ball_fits_into_the_hole_of_a_plate_by_size_alone(plate):
    middle = [(0, 0, (FOOT_PROTRUSION + plate.thickness) / 2)]
    assert probed(plate, middle, plate.hole - 1e-5) == 0
    assert probed(plate, middle, plate.hole + 2e-4) == 1
