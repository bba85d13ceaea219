"""Refactorings of simulation, control, robots, parameters and rollouts, none of which may make a task another one."""

from edit import Edit

WORLD = "scengen/sim/world.py"
ARM = "scengen/sim/arm.py"
EPISODE = "scengen/episode.py"
ROLLOUT = "scengen/validate/rollout.py"
PANDA = "scengen/robots/panda.py"
DISTS = "scengen/samplers/dists.py"
LOOP = "scengen/control/loop.py"
OSC = "scengen/control/osc.py"
MIRROR = "mirror_pick_place"
TOSS = "cube_toss"
YCB = "pick_place_ycb"

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
                "        names = self._others\n"
                "        found = {names[i] for i in self.loop.touching[self.row(body)].nonzero()[0].tolist()"
                " if i in names}\n",
                "        found = self._names_in(self.loop.touching[self.row(body)])\n",
            ),
            (
                WORLD,
                "    @property\n    def free_bodies(self)",
                "    def _names_in(self, row: NDArray[np.uint8]) -> set[str]:\n"
                '        """Names of the bodies that a row of a contact table marks."""\n'
                "        found = set()\n"
                "        for i in np.flatnonzero(row):\n"
                "            if int(i) in self._others:\n"
                "                found.add(self._others[int(i)])\n"
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
            (WORLD, "        world._happening = True\n", "        world._in_events = True\n"),
            (WORLD, "        self._world._happening = False\n", "        self._world._in_events = False\n"),
            (WORLD, "        if not self._happening:\n", "        if not self._in_events:\n"),
        ),
    ),
    Edit(
        "search_index_of_memory",
        (YCB, "slip_recovery"),
        (
            (
                "scengen/sim/memory.py",
                "            return self._index[name]",
                "            return self.names.index(name)",
            ),
            ("scengen/sim/memory.py", "        except KeyError:", "        except ValueError:"),
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
