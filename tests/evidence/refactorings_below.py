"""Refactorings of the code below the tasks, none of which may make a task another one."""

from edit import NEW, Edit

WORLD, ARM, EPISODE = "scengen/sim/world.py", "scengen/sim/arm.py", "scengen/episode.py"
MOTION, JAW, GRIP = "scengen/skills/motion.py", "scengen/skills/jaw.py", "scengen/skills/grip.py"
ROLLOUT, PROP, BOX = "scengen/validate/rollout.py", "scengen/assets/prop.py", "scengen/assets/box.py"
PANDA, DISTS, LOOP = "scengen/robots/panda.py", "scengen/samplers/dists.py", "scengen/control/loop.py"
OSC, PREDICATES = "scengen/control/osc.py", "scengen/predicates.py"
MIRROR, TOSS, YCB = "mirror_pick_place", "cube_toss", "pick_place_ycb"

EDITS = (
    Edit(
        "comment_in_world",
        (MIRROR,),
        ((WORLD, "    # --- queries ---", "    # Readings that change nothing.\n    # --- queries ---"),),
    ),
    Edit(
        "split_world_touching_bodies",
        (MIRROR, "domino_single"),
        (
            (
                WORLD,
                "        others = self.loop.touching[self.row(body)]\n"
                "        scene = {self.model.body(int(i)).name for i in np.flatnonzero(others[: self.model.nbody])"
                " if i not in self.own}\n",
                "        others = self.loop.touching[self.row(body)]\n        scene = self._scene_names(others)\n",
            ),
            (
                WORLD,
                "    @property\n    def free_bodies(self)",
                "    def _scene_names(self, row: NDArray[np.uint8]) -> set[str]:\n"
                '        """Names of the scene\'s bodies that a row of a contact table marks."""\n'
                "        found = set()\n"
                "        for i in np.flatnonzero(row[: self.model.nbody]):\n"
                "            if int(i) not in self.own:\n"
                "                found.add(self.model.body(int(i)).name)\n"
                "        return found\n\n"
                "    @property\n    def free_bodies(self)",
            ),
        ),
    ),
    Edit(
        "rename_world_happening",
        (YCB, "slip_recovery"),
        (
            (WORLD, "    _happening: bool = field", "    _in_events: bool = field"),
            (WORLD, "        self._happening = True\n", "        self._in_events = True\n"),
            (WORLD, "            self._happening = False\n", "            self._in_events = False\n"),
            (WORLD, "        if not self._happening:\n", "        if not self._in_events:\n"),
        ),
    ),
    Edit(
        "cache_index_of_memory",
        (YCB, "slip_recovery"),
        (
            (
                "scengen/sim/memory.py",
                "        self._data, self._check = data, check\n",
                "        self._data, self._check = data, check\n"
                "        self._places = {name: place for place, name in enumerate(self.names)}\n",
            ),
            (
                "scengen/sim/memory.py",
                '        if name not in self.names:\n            raise UnknownName("memory", name, self.names)\n'
                "        return self.names.index(name)",
                '        if name not in self._places:\n            raise UnknownName("memory", name, self.names)\n'
                "        return self._places[name]",
            ),
        ),
    ),
    Edit(
        "describe_hands_by_a_loop",
        (TOSS, "cracker_box_suction"),
        (
            (
                "scengen/sim/embodiment.py",
                '    return tuple(hand.removeprefix(SCRIPTED) for hand in embodiment.split("+"))',
                '    found = []\n    for hand in embodiment.split("+"):\n'
                "        found.append(hand[len(SCRIPTED) :] if hand.startswith(SCRIPTED) else hand)\n"
                "    return tuple(found)",
            ),
        ),
    ),
    Edit(
        "arm_finger_gap_by_index",
        (MIRROR, "pendulum_grasp"),
        (
            (
                ARM,
                "        one, other = self.finger_pos\n        return float(one - other) - OVERLAP",
                "        places = self.finger_pos\n        return float(places[0] - places[1]) - OVERLAP",
            ),
        ),
    ),
    Edit(
        "extract_setpoint_of_go_to",
        (MIRROR, "domino_single"),
        (
            (
                MOTION,
                "        ahead = goal - setpoint\n        distance = math.sqrt(ahead @ ahead)\n"
                "        speed = min(pace.speed, 4.0 * distance)\n"
                "        velocity = ahead * (speed / distance) if distance > 1e-9 else np.zeros(3)\n"
                "        setpoint = setpoint + velocity * Loop.PERIOD\n        if not manner",
                "        distance, velocity = _towards(goal, setpoint, pace.speed)\n"
                "        setpoint = setpoint + velocity * Loop.PERIOD\n        if not manner",
            ),
            (
                MOTION,
                "def _touching(arm: Arm) -> str:",
                "def _towards(goal: Vec3, setpoint: Vec3, limit: float) -> tuple[float, Vec3]:\n"
                '    """Distance to a goal [m] and velocity towards it [m/s], which falls near it."""\n'
                "    ahead = goal - setpoint\n    distance = math.sqrt(ahead @ ahead)\n"
                "    if distance <= 1e-9:\n        return distance, np.zeros(3)\n"
                "    return distance, ahead * (min(4.0 * distance, limit) / distance)\n\n\n"
                "def _touching(arm: Arm) -> str:",
            ),
        ),
    ),
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
        "panda_joint_settings_by_zip",
        (MIRROR, "cracker_box_suction"),
        (
            (
                PANDA,
                '    for i in range(JOINTS):\n        joint = arm.joint(f"joint{i + 1}")\n'
                "        joint.armature = ARMATURE[i]\n        joint.frictionloss = FRICTIONLOSS\n"
                "        set_damping(joint, DAMPING[i])\n",
                "    for i, (armature, damping) in enumerate(zip(ARMATURE, DAMPING, strict=True), 1):\n"
                '        joint = arm.joint(f"joint{i}")\n        joint.frictionloss = FRICTIONLOSS\n'
                "        set_damping(joint, damping)\n        joint.armature = armature\n",
            ),
        ),
    ),
    Edit(
        "uniform_as_interpolation",
        (MIRROR, "domino_single"),
        (
            (
                DISTS,
                "        return _within(self.low + u * (self.high - self.low), self.support[0])",
                "        width = self.high - self.low\n        return _within(width * u + self.low, self.support[0])",
            ),
        ),
    ),
    Edit(
        "parameters_renamed_locals",
        (MIRROR, "mass_sort"),
        (
            (
                "scengen/params.py",
                "    return {p.name: p.nominal for p in parameters(owner)}",
                "    found: dict[str, Value] = {}\n    for each in parameters(owner):\n"
                "        found[each.name] = each.nominal\n    return found",
            ),
        ),
    ),
    Edit(
        "rollout_splits_disturbed",
        (MIRROR, "pendulum_grasp"),
        (
            (
                ROLLOUT,
                "        for name in world.free_bodies:\n            start = model.qpos0",
                "        self._move(model, world)\n        for hinge in hinges:\n"
                '            _turn_start(model, hinge, np.radians(spread(self.turn, self.key, hinge, "turn")))\n'
                "        hung = [model.body(int(model.joint(hinge).bodyid[0])).name for hinge in hinges]\n"
                "        for name in (*world.free_bodies, *hung):\n"
                '            heavier = 1.0 + spread(self.mass, self.key, name, "mass")\n'
                '            rougher = 1.0 + spread(self.friction, self.key, name, "friction")\n'
                "            for part in _subtree(model, world.body(name)):\n"
                "                model.body_mass[part] *= heavier\n"
                "                model.body_inertia[part] *= heavier\n"
                "                model.geom_friction[model.geom_bodyid == part, 0] *= rougher\n"
                "        mujoco.mj_setConst(model, mujoco.MjData(model))\n"
                "        return World.of(model, world.scripted)\n\n"
                "    def _move(self, model: mujoco.MjModel, world: World) -> None:\n"
                '        """Move and turn the free bodies of a model at its start."""\n'
                "        for name in world.free_bodies:\n            start = model.qpos0",
            ),
            (
                ROLLOUT,
                "            start[3:7] = turned\n        for hinge in hinges:\n"
                '            _turn_start(model, hinge, np.radians(spread(self.turn, self.key, hinge, "turn")))\n'
                "        hung = [model.body(int(model.joint(hinge).bodyid[0])).name for hinge in hinges]\n"
                "        for name in (*world.free_bodies, *hung):\n"
                '            heavier = 1.0 + spread(self.mass, self.key, name, "mass")\n'
                '            rougher = 1.0 + spread(self.friction, self.key, name, "friction")\n'
                "            for part in _subtree(model, world.body(name)):\n"
                "                model.body_mass[part] *= heavier\n"
                "                model.body_inertia[part] *= heavier\n"
                "                model.geom_friction[model.geom_bodyid == part, 0] *= rougher\n"
                "        mujoco.mj_setConst(model, mujoco.MjData(model))\n"
                "        return World.of(model, world.scripted)\n\n    def shaken(",
                "            start[3:7] = turned\n\n    def shaken(",
            ),
        ),
    ),
    Edit(
        "episode_judge_in_two_methods",
        (MIRROR, "balance_hard"),
        (
            (
                EPISODE,
                "        elif self.outcome is None:\n            self.held = ",
                "        elif self.outcome is None:\n            self._advance()\n        return self.outcome\n\n"
                "    def _advance(self) -> None:\n"
                '        """Count the time for which the goal has held, and end the episode in time."""\n'
                "        if self.outcome is None:\n            self.held = ",
            ),
            (
                EPISODE,
                'f"the goal was not reached in {self.horizon:g} s"\n        return self.outcome\n',
                'f"the goal was not reached in {self.horizon:g} s"\n',
            ),
        ),
    ),
    Edit(
        "loop_and_controller_helpers",
        (MIRROR, TOSS, "cracker_box_suction", "domino_single"),
        (
            (
                LOOP,
                "    return (seen & 1) + (seen >> 1 & 1) + (seen >> 2 & 1) + (seen >> 3)",
                "    pads = 0\n    for pad in range(4):\n        pads += seen >> pad & 1\n    return pads",
            ),
            (
                LOOP,
                '        self._arms[arm]["state"]["jammed"] = float(on)',
                '        self._arms["state"]["jammed"][arm] = 1.0 if on else 0.0',
            ),
            (
                OSC,
                "        middle, half = 0.5 * (limits[1] + limits[0]), 0.5 * (limits[1] - limits[0])\n"
                "        motor[0] = clip(middle + half * state.jaw[i], limits[0], limits[1])",
                "        motor[0] = clip(_scaled(state.jaw[i], limits[0], limits[1]), limits[0], limits[1])",
            ),
            (
                OSC,
                "@njit\ndef clip(value: float",
                "@njit\ndef _scaled(share: float, low: float, high: float) -> float:\n"
                '    """`share` in [-1, 1] of the range from `low` to `high`."""\n'
                "    return (high + low) / 2.0 + (high - low) / 2.0 * share\n\n\n@njit\ndef clip(value: float",
            ),
        ),
    ),
    Edit(
        "controller_sums_backwards",
        (MIRROR, TOSS, "domino_single", "balance_hard", "pendulum_grasp"),
        (
            (
                OSC,
                "    total = 0.0\n    for i in range(a.shape[0]):\n        total += a[i] * b[i]\n    return total",
                "    total = 0.0\n    for i in range(a.shape[0] - 1, -1, -1):\n        total += a[i] * b[i]\n"
                "    return total",
            ),
        ),
        rounds=True,
    ),
    Edit(
        "steer_by_the_inverse_rate",
        (MIRROR, TOSS, "domino_single", "balance_hard", "pendulum_grasp", "ball_cage_escape", "gap_funnel"),
        (
            (
                MOTION,
                "    action[:3] = velocity / RATE + STIFFNESS * (setpoint - arm.hand)",
                "    action[:3] = velocity * (1.0 / RATE) + (STIFFNESS * setpoint - STIFFNESS * arm.hand)",
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
    Edit(
        "rename_field_of_choice",
        ("domino_single",),
        (
            (DISTS, "    options: tuple[Value, ...]\n", "    listed: tuple[Value, ...]\n"),
            (DISTS, "self.options[int(u * len(self.options))]", "self.listed[int(u * len(self.listed))]"),
            (DISTS, "for v in sorted(set(self.options)))", "for v in sorted(set(self.listed)))"),
            ("scengen/samplers/designs.py", "        return len(dist.options)", "        return len(dist.listed)"),
            ("scengen/samplers/axis.py", "for v in dist.options]", "for v in dist.listed]"),
        ),
    ),
)
