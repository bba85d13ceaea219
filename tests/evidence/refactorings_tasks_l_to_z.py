"""Refactorings of tasks from L to Z, none of which may make a task another one."""

from edit import Edit

MIRROR = "scengen/tasks/mirror_pick_place.py"
SORT = "scengen/tasks/mass_sort.py"
OCCLUDER = "scengen/tasks/occluder_push.py"
PENDULUM = "scengen/tasks/pendulum_grasp.py"
YCB = "scengen/tasks/pick_place_ycb.py"
LINEAR = "scengen/tasks/linear_intercept.py"
ROD = "scengen/tasks/rod_across.py"
SLIP = "scengen/tasks/slip_recovery.py"
SHELTER = "scengen/tasks/sheltered_grasp.py"

EDITS = (
    Edit(
        "mirror_success_operands_exchanged",
        ("mirror_pick_place",),
        (
            (
                MIRROR,
                '        return world.com("cube")[2] - TABLE_TOP - self.cube.size[2] / 2 >= LIFT_HEIGHT and held(world,'
                ' "cube")',
                '        high = world.com("cube")[2] - TABLE_TOP - self.cube.size[2] / 2\n'
                '        return held(world, "cube") and bool(LIFT_HEIGHT <= high)',
            ),
        ),
    ),
    Edit(
        "mirror_reordered_methods_and_fields",
        ("mirror_pick_place",),
        (
            (
                MIRROR,
                '    x: float = param(0.05, "m", -0.4, 0.4)\n    y: float = param(0.12, "m", -0.4, 0.4)\n',
                '    y: float = param(0.12, "m", -0.4, 0.4)\n    x: float = param(0.05, "m", -0.4, 0.4)\n',
            ),
            (
                MIRROR,
                "    @property\n    def orientation(self) -> Orientation:\n        return VIEWS[self.view]\n\n",
                "",
            ),
            (
                MIRROR,
                "    @staticmethod\n    def _below(",
                "    @property\n    def orientation(self) -> Orientation:\n        return VIEWS[self.view]\n\n"
                "    @staticmethod\n    def _below(",
            ),
        ),
    ),
    Edit(
        "mirror_steps_in_another_order",
        ("mirror_pick_place",),
        (
            (MIRROR, '            "grasp": lambda world: grasp(world.arm),\n', ""),
            (
                MIRROR,
                '            "go_where_shown": lambda world: self._go_above(world, self._shown_spot(UPRIGHT)),\n',
                '            "go_where_shown": lambda world: self._go_above(world, self._shown_spot(UPRIGHT)),\n'
                '            "grasp": lambda world: grasp(world.arm),\n',
            ),
        ),
    ),
    Edit(
        "sort_success_as_loop",
        ("mass_sort",),
        (
            (
                SORT,
                "        return all(\n"
                '            self.within(world, cube, rank) and rests_on(world, cube, "table") and still(world,'
                " cube, 0.01)\n"
                "            for cube, rank in self.belongs(world).items()\n        )\n",
                "        for cube, rank in self.belongs(world).items():\n"
                "            if not self.within(world, cube, rank):\n                return False\n"
                '            if not rests_on(world, cube, "table") or not still(world, cube, 0.01):\n'
                "                return False\n        return True\n",
            ),
            (
                SORT,
                "        weights = {cube: float(world.model.body_mass[world.body(cube)]) for cube in self.cubes}\n"
                "        return {cube: rank for rank, cube in enumerate(sorted(weights, key=weights.__getitem__))}\n",
                "        masses = world.model.body_mass\n"
                "        ordered = sorted(self.cubes, key=lambda cube: float(masses[world.body(cube)]))\n"
                "        return dict(zip(ordered, range(len(ordered)), strict=True))\n",
            ),
        ),
    ),
    Edit(
        "sort_memory_names_by_a_helper",
        ("mass_sort",),
        (
            (
                SORT,
                '        remember(scene, *(f"lifted_{cube}" for cube in self.cubes))',
                "        remember(scene, *map(self._lifted, self.cubes))",
            ),
            (
                SORT,
                '                world.memory[f"lifted_{cube}"] = 1.0',
                "                world.memory[self._lifted(cube)] = 1.0",
            ),
            (
                SORT,
                '        return all(world.memory[f"lifted_{cube}"] for cube in self.cubes)',
                "        return min(world.memory[self._lifted(cube)] for cube in self.cubes) > 0.0\n\n"
                "    @staticmethod\n    def _lifted(cube: str) -> str:\n"
                '        """Name of the memory of whether a cube has been lifted."""\n'
                '        return "lifted_" + cube',
            ),
        ),
    ),
    Edit(
        "occluder_build_without_iterator",
        ("occluder_push",),
        (
            (
                OCCLUDER,
                "        others = iter(OTHER_COLOURS[self.likeness])\n",
                "        colours = list(OTHER_COLOURS[self.likeness])\n        colours.insert(self.red, RED)\n",
            ),
            (
                OCCLUDER,
                "            coloured = replace(self.cube, rgba=RED if i == self.red else next(others))\n",
                "            coloured = replace(self.cube, rgba=colours[i])\n",
            ),
        ),
    ),
    Edit(
        "pendulum_events_split",
        ("pendulum_grasp",),
        (
            (
                PENDULUM,
                "        if world.passes(0.0):\n"
                "            _, rate = self.pendulum.swing(self.peak_angle, self.phase / 360.0)\n"
                "            angle, _ = world.hinge(HINGE)\n"
                "            world.spin(HINGE, math.copysign(self.pendulum.rate(self.peak_angle, angle), rate))\n",
                "        if world.passes(0.0):\n            self._start_swing(world)\n\n"
                "    def _start_swing(self, world: World) -> None:\n"
                '        """Give the bob its first speed."""\n'
                "        _, rate = self.pendulum.swing(self.peak_angle, self.phase / 360.0)\n"
                "        angle, _ = world.hinge(HINGE)\n"
                "        world.spin(HINGE, math.copysign(self.pendulum.rate(self.peak_angle, angle), rate))\n",
            ),
        ),
    ),
    Edit(
        "pendulum_rules_renamed_and_inverted",
        ("pendulum_grasp",),
        (
            (
                PENDULUM,
                "    def narrow(self, world: World) -> bool:",
                "    def _was_narrow(self, world: World) -> bool:",
            ),
            (
                PENDULUM,
                "throughout(lambda world: not self.narrow(world))",
                "throughout(lambda world: not self._was_narrow(world))",
            ),
            (
                PENDULUM,
                "        return abs(world.hinge(HINGE)[0]) >= APEX_SHARE * self.peak_angle",
                "        return not abs(world.hinge(HINGE)[0]) < self.peak_angle * APEX_SHARE",
            ),
        ),
    ),
    Edit(
        "ycb_jump_extracted",
        ("pick_place_ycb",),
        (
            (
                YCB,
                '        jumps = int(memory["jumps"])\n'
                '        if memory["lifted"] and jumps < self.jumps and math.dist(at[:2], self.spots[jumps][:2]) <='
                " self.near:\n"
                '            memory["jumps"] = jumps + 1\n',
                '        if memory["lifted"]:\n            self._jump(world, at)\n\n'
                "    def _jump(self, world: World, at: Vec3) -> None:\n"
                '        """Let the square jump if an object at a place [m] is near to it."""\n'
                '        jumps = int(world.memory["jumps"])\n'
                "        if jumps < self.jumps and self.near >= math.dist(at[:2], self.spots[jumps][:2]):\n"
                '            world.memory["jumps"] = jumps + 1\n',
            ),
        ),
    ),
    Edit(
        "linear_type_annotations",
        ("linear_intercept",),
        (
            (
                LINEAR,
                "        left = at - world.arm.hand\n",
                "        left: Vec3 = at - world.arm.hand\n",
            ),
            (
                LINEAR,
                '        return displaced(world, "ball", world.arm.hand) > NEAR_DISTANCE',
                '        away: float = displaced(world, "ball", world.arm.hand)\n        return NEAR_DISTANCE < away',
            ),
        ),
    ),
    Edit(
        "launched_ball_mean_by_match",
        ("linear_intercept",),
        (
            (
                "scengen/tasks/launched_ball.py",
                "            return first > 0.0 and world.time - first >= ARRIVAL_TIME\n",
                "            match first:\n                case 0.0:\n                    return False\n"
                "                case _:\n                    return world.time - first >= ARRIVAL_TIME\n",
            ),
        ),
    ),
    Edit(
        "rod_across_reassociated",
        ("rod_across",),
        (
            (
                ROD,
                "self.held_at(world) + torque / weight)\n\n    def lift",
                "torque * (1.0 / weight) + self.held_at(world))\n\n    def lift",
            ),
        ),
        rounds=True,
    ),
    Edit(
        "slip_events_in_two_methods",
        ("slip_recovery",),
        (
            (
                SLIP,
                '        raised = at[2] - memory["stood"] >= (MIN_CARRY_HEIGHT if memory["high"] else MIN_LIFT)\n',
                "        self._track_carrying(world, touched, lies)\n\n"
                "    def _track_carrying(self, world: World, touched: bool, lies: bool) -> None:\n"
                '        """Track where the object is carried, and open the jaw at the place of a slip."""\n'
                '        memory, at = world.memory, world.com("thing")\n'
                '        raised = at[2] - memory["stood"] >= (MIN_CARRY_HEIGHT if memory["high"] else MIN_LIFT)\n',
            ),
        ),
    ),
    Edit(
        "shelter_success_with_locals",
        ("sheltered_grasp",),
        (
            (
                SHELTER,
                '        x, y, _ = world.com("thing") - self.tray\n'
                "        between = abs(x) < TRAY.width / 2 and abs(y) < TRAY.length / 2\n",
                '        offset = world.com("thing") - self.tray\n'
                "        between = bool(2 * abs(offset[0]) < TRAY.width and 2 * abs(offset[1]) < TRAY.length)\n",
            ),
        ),
    ),
    Edit(
        "exchange_two_constraints",
        ("mass_sort",),
        (
            (
                SORT,
                '        yield require(self.order != 0, "the cubes lie in the order in which they belong",'
                " order=self.order)\n",
                "",
            ),
            (
                SORT,
                "        above = (2 * self.edge + CARRY_HEIGHT) * UP\n        yield within",
                '        yield require(self.order != 0, "the cubes lie in the order in which they belong",'
                " order=self.order)\n"
                "        above = (2 * self.edge + CARRY_HEIGHT) * UP\n        yield within",
            ),
        ),
    ),
)
