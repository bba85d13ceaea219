"""Refactorings of moves, predicates, geometry and assets, none of which may make a task another one."""

from edit import NEW, Edit

MOTION = "scengen/skills/motion.py"
JAW = "scengen/skills/jaw.py"
GRIP = "scengen/skills/grip.py"
PROP = "scengen/assets/prop.py"
BOX = "scengen/assets/box.py"
PREDICATES = "scengen/predicates.py"
MIRROR = "mirror_pick_place"
TOSS = "cube_toss"
YCB = "pick_place_ycb"

EDITS = (
    Edit(
        "facing_down_by_columns",
        (MIRROR, "domino_single"),
        (
            (
                MOTION,
                "    return np.array([[-s, c, 0.0], [c, s, 0.0], [0.0, 0.0, -1.0]])",
                "    across, along = np.array([-s, c, 0.0]), np.array([c, s, 0.0])\n"
                "    return np.column_stack([across, along, -UP]) + 0.0",
            ),
        ),
    ),
    Edit(
        "inline_grasp_and_release",
        (MIRROR, "mass_sort"),
        (
            (
                JAW,
                "    yield from come_down(arm, at, closing, above, pace)\n    yield from grasp(arm, squeeze)\n",
                "    yield from come_down(arm, at, closing, above, pace)\n    yield from hold(arm, squeeze, CLOSED)\n",
            ),
            (
                JAW,
                "    yield from lower(arm, body, at, on, hover, down, speed, near)\n    yield from release(arm)\n",
                "    yield from lower(arm, body, at, on, hover, down, speed, near)\n"
                "    yield from hold(arm, RELEASE_TIME, OPEN)\n",
            ),
        ),
    ),
    Edit(
        "reach_of_geoms_by_if",
        (YCB,),
        (
            (
                GRIP,
                "    match model.geom_type[geom]:\n"
                "        case kinds.mjGEOM_SPHERE:\n            half = size[0]\n"
                "        case kinds.mjGEOM_CAPSULE:\n            half = size[0] + z * size[1]\n"
                "        case kinds.mjGEOM_CYLINDER:\n            half = size[0] * math.hypot(x, y) + z * size[1]\n"
                "        case kinds.mjGEOM_BOX:\n            half = x * size[0] + y * size[1] + z * size[2]\n"
                "        case _:\n"
                "            corners = model.mesh_vert[_vertices(world, geom)] @ data.geom_xmat[geom]"
                ".reshape(3, 3).T @ direction\n"
                "            return middle + float(corners.min()), middle + float(corners.max())\n",
                "    kind = model.geom_type[geom]\n"
                "    if kind == kinds.mjGEOM_SPHERE:\n        half = size[0]\n"
                "    elif kind == kinds.mjGEOM_CAPSULE:\n        half = size[0] + z * size[1]\n"
                "    elif kind == kinds.mjGEOM_CYLINDER:\n        half = size[0] * math.hypot(x, y) + z * size[1]\n"
                "    elif kind == kinds.mjGEOM_BOX:\n        half = x * size[0] + y * size[1] + z * size[2]\n"
                "    else:\n"
                "        corners = model.mesh_vert[_vertices(world, geom)] @ data.geom_xmat[geom]"
                ".reshape(3, 3).T @ direction\n"
                "        return middle + float(corners.min()), middle + float(corners.max())\n",
            ),
        ),
    ),
    Edit(
        "suck_reads_time_once",
        ("cracker_box_suction",),
        (
            (
                "scengen/skills/suction.py",
                "    end, sealed, setpoint = arm.world.time + give_up, arm.world.time, np.array([spot[0], spot[1],"
                " arm.hand[2]])\n",
                "    begun = arm.world.time\n    end, sealed = begun + give_up, begun\n"
                "    setpoint = np.array([*spot[:2], arm.hand[2]])\n",
            ),
        ),
    ),
    Edit(
        "predicates_by_de_morgan",
        (MIRROR, YCB, "balance_hard"),
        (
            (
                PREDICATES,
                "    others = (name for name in world.touching_bodies(body) if name != ROBOT)\n"
                "    return world.touching(ROBOT, body) and not any(others)",
                "    others = {name for name in world.touching_bodies(body) if name != ROBOT}\n"
                "    return not (others or not world.touching(ROBOT, body))",
            ),
            (
                PREDICATES,
                "    return next((body for body in bodies if world.com(body)[2] < TABLE_TOP - below), None)",
                "    limit = TABLE_TOP - below\n    for body in bodies:\n        if limit > world.com(body)[2]:\n"
                "            return body\n    return None",
            ),
        ),
    ),
    Edit(
        "move_predicates_to_a_module",
        (MIRROR, YCB),
        (
            (
                PREDICATES,
                "def rests_on(world: World, body: str, support: str) -> bool:\n"
                '    """Whether a body touches `support`, and neither the robot nor anything else."""\n'
                "    return world.touching(body, support) and world.touching_bodies(body) == {support}\n\n\n",
                "",
            ),
            (
                PREDICATES,
                "from .sim.world import World\n",
                "from .sim.world import World\nfrom .support_predicates import rests_on as rests_on\n",
            ),
            (
                "scengen/support_predicates.py",
                NEW,
                '"""Predicates about what supports a body."""\n\nfrom .sim.world import World\n\n\n'
                "def rests_on(world: World, body: str, support: str) -> bool:\n"
                '    """Whether a body touches `support`, and neither the robot nor anything else."""\n'
                "    return world.touching(body, support) and world.touching_bodies(body) == {support}\n",
            ),
        ),
    ),
    Edit(
        "reflected_and_flight_renamed_locals",
        (TOSS,),
        (
            (
                "scengen/physics.py",
                "    up = float(velocity[2])\n    rest = up**2 - 2 * GRAVITY * (height - float(pos[2]))\n"
                "    seconds = (up + math.sqrt(max(0.0, rest))) / GRAVITY\n",
                "    rise, drop = float(velocity[2]), height - float(pos[2])\n"
                "    rest = rise**2 - 2 * GRAVITY * drop\n"
                "    seconds = (rise + math.sqrt(max(rest, 0.0))) / GRAVITY\n",
            ),
        ),
    ),
    Edit(
        "corners_by_broadcast",
        (MIRROR, "mass_sort"),
        (
            (
                "scengen/geometry.py",
                "    signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])\n"
                "    flat = about_z(yaw)[:2, :2]\n",
                "    flat, signs = about_z(yaw)[:2, :2], np.array([[1, -1, -1, 1], [1, 1, -1, -1]], float).T\n",
            ),
        ),
    ),
    Edit(
        "half_by_multiplication",
        ("balance_hard", "domino_single"),
        ((BOX, "        half = self.size / 2\n        solid", "        half = 0.5 * self.size\n        solid"),),
    ),
    Edit(
        "solid_sets_fields_in_another_order",
        (MIRROR, "cup_extract"),
        (
            (
                PROP,
                "    geom.size, geom.pos, geom.quat = full, np.asarray(pos, float), np.asarray(quat, float)\n"
                "    geom.friction, geom.condim = np.array([friction, 0.005, 0.0001]), condim\n"
                "    geom.solref, geom.priority, geom.group = np.array(solref), priority, group\n"
                "    geom.rgba = np.array(rgba, np.float32)\n",
                "    geom.rgba, geom.group = np.array(rgba, np.float32), group\n"
                "    geom.solref, geom.priority, geom.condim = np.array(solref), priority, condim\n"
                "    geom.friction = np.array([friction, 0.005, 0.0001])\n"
                "    geom.quat, geom.pos, geom.size = np.asarray(quat, float), np.asarray(pos, float), full\n",
            ),
        ),
    ),
    Edit(
        "steer_by_the_inverse_rate",
        (MIRROR, TOSS, "domino_single", "balance_hard", "pendulum_grasp", "ball_cage_escape", "gap_funnel"),
        (
            (
                MOTION,
                "        action[i] = velocity[i] / RATE + STIFFNESS * (setpoint[i] - hand[i])",
                "        action[i] = velocity[i] * (1.0 / RATE) + (STIFFNESS * setpoint[i] - STIFFNESS * hand[i])",
            ),
        ),
        rounds=True,
    ),
    Edit(
        "normalise_rotation_otherwise",
        ("domino_single", "pendulum_grasp", "cup_extract"),
        (
            (
                "scengen/geometry.py",
                "    mujoco.mju_axisAngle2Quat(q, turn / max(angle, 1e-12), angle)\n    mujoco.mju_quat2Mat(mat, q)",
                "    q[0], q[1:] = math.cos(angle / 2), turn * (math.sin(angle / 2) / max(angle, 1e-12))\n"
                "    mujoco.mju_quat2Mat(mat, q)",
            ),
        ),
        rounds=True,
    ),
)
