"""Refactorings of single tasks, none of which may make a task another one."""

from edit import NEW, Edit

BALANCE, CAGE = "scengen/tasks/balance.py", "scengen/tasks/ball_cage_escape.py"
MIRROR, SORT = "scengen/tasks/mirror_pick_place.py", "scengen/tasks/mass_sort.py"
OCCLUDER, SUCTION = "scengen/tasks/occluder_push.py", "scengen/tasks/cracker_box_suction.py"
TOSS, PENDULUM, YCB = "scengen/tasks/cube_toss.py", "scengen/tasks/pendulum_grasp.py", "scengen/tasks/pick_place_ycb.py"
EXTRACT, DOMINO, LINEAR = (
    "scengen/tasks/cup_extract.py",
    "scengen/tasks/domino_single.py",
    "scengen/tasks/linear_intercept.py",
)
ROD, SLIP, FUNNEL = "scengen/tasks/rod_across.py", "scengen/tasks/slip_recovery.py", "scengen/tasks/gap_funnel.py"
RAMP, SHAPES, SHELTER = (
    "scengen/tasks/galileo_ramp_drop.py",
    "scengen/tasks/shape_stack.py",
    "scengen/tasks/sheltered_grasp.py",
)

EDITS = (
    Edit(
        "balance_failure_by_guards",
        ("balance_hard",),
        (
            (
                BALANCE,
                '        return Strict("the rod was touched again on the ridge") if touched and self.released(world)'
                " else None",
                "        if not (touched and self.released(world)):\n            return None\n"
                '        return Strict("the rod was touched again on the ridge")',
            ),
            (
                BALANCE,
                '        if not world.touching_bodies("rod") and world.velocity("rod")[5] < -MAX_FALL_SPEED:',
                '        if not (world.touching_bodies("rod") or -MAX_FALL_SPEED <= world.velocity("rod")[5]):',
            ),
        ),
    ),
    Edit(
        "balance_events_with_early_exit",
        ("balance_hard",),
        (
            (
                BALANCE,
                '        world.memory["alone"] = world.memory["alone"] + Loop.PERIOD if alone else 0.0',
                "        if alone:\n"
                '            world.memory["alone"] = Loop.PERIOD + world.memory["alone"]\n        else:\n'
                '            world.memory["alone"] = 0.0',
            ),
        ),
    ),
    Edit(
        "balance_rename_private_plans",
        ("balance_hard",),
        (
            (BALANCE, '"drop_it_from_above": Shortcut(self._drop)', '"drop_it_from_above": Shortcut(self._fall)'),
            (BALANCE, "    def _drop(self, world: World)", "    def _fall(self, world: World)"),
            (BALANCE, "DROP_HEIGHT = 0.06  # height", "FALL_HEIGHT = 0.06  # height"),
            (BALANCE, "self.bring(world, self.rod.com, DROP_HEIGHT)", "self.bring(world, self.rod.com, FALL_HEIGHT)"),
        ),
    ),
    Edit(
        "cage_moves_tilts_to_a_module",
        ("ball_cage_escape",),
        (
            (
                CAGE,
                'STEEP = math.radians(35.0)\n"""Tilt of a cage in which the ball cannot pass the hole [rad]."""\n',
                "",
            ),
            (CAGE, "from ..geometry import UP, Mat3", "from .cage_tilts import STEEP\nfrom ..geometry import UP, Mat3"),
            (
                "scengen/tasks/cage_tilts.py",
                NEW,
                '"""Tilts of the cage."""\n\nimport math\n\nSTEEP = math.radians(35.0)\n'
                '"""Tilt of a cage in which the ball cannot pass the hole [rad]."""\n',
            ),
        ),
    ),
    Edit(
        "cage_failure_in_two_methods",
        ("ball_cage_escape",),
        (
            (
                CAGE,
                "        if self.cage.passes(at, self.ball.radius):\n"
                '            if not world.touching(ROBOT, "cage") or not world.touching_bodies("cage") <= {ROBOT,'
                ' "ball"}:\n'
                '                return Strict("the ball left a cage that was not lifted")\n'
                "            if self.lean(world) < self.rolling_tilt + SHAKE_TILT:\n"
                '                return Strict("the ball was shaken out of the cage")\n'
                '        return Strict("the ball rolled to the end without the hole") if self.at_wrong_end(at) else'
                " None\n",
                "        if self.cage.passes(at, self.ball.radius) and (reason := self._escaped(world)):\n"
                "            return reason\n"
                '        return Strict("the ball rolled to the end without the hole") if self.at_wrong_end(at) else'
                " None\n"
                "\n    def _escaped(self, world: World) -> str | None:\n"
                '        """Reason why a ball that passes the hole has been let out wrongly, or None."""\n'
                '        if not (world.touching(ROBOT, "cage") and world.touching_bodies("cage") <= {ROBOT, "ball"}):\n'
                '            return Strict("the ball left a cage that was not lifted")\n'
                "        shaken = self.lean(world) < self.rolling_tilt + SHAKE_TILT\n"
                '        return Strict("the ball was shaken out of the cage") if shaken else None\n',
            ),
        ),
    ),
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
        "suction_pass_arm_as_local",
        ("cracker_box_suction",),
        (
            (
                SUCTION,
                "        yield from self.take(world.arm)\n        yield from self.tip(world.arm)\n"
                "        yield from self.bring(world.arm, self.laid(world))\n        yield from let_go(world.arm)\n",
                "        arm = world.arm\n        for plan in (self.take, self.tip):\n            yield from"
                " plan(arm)\n"
                "        yield from self.bring(arm, self.laid(world))\n        yield from let_go(arm)\n",
            ),
            (
                SUCTION,
                "        return self.fall_speed(world) < REST_SPEED and (math.hypot(off[0], off[1]) > aside or"
                " abs(off[2]) > high)",
                "        away = not (math.hypot(off[0], off[1]) <= aside and abs(off[2]) <= high)\n"
                "        return away and self.fall_speed(world) < REST_SPEED",
            ),
        ),
    ),
    Edit(
        "toss_caches_unit_vector",
        ("cube_toss",),
        (
            (TOSS, "import math\nfrom collections.abc", "import functools\nimport math\nfrom collections.abc"),
            (
                TOSS,
                "    @property\n    def u(self) -> Vec3:",
                "    @functools.cached_property\n    def u(self) -> Vec3:",
            ),
            (
                TOSS,
                "        return lies and math.sqrt(slips @ slips) < REST_SPEED",
                "        return bool(lies and REST_SPEED > math.sqrt(slips @ slips))",
            ),
        ),
    ),
    Edit(
        "toss_derives_constants",
        ("cube_toss",),
        (
            (TOSS, "BREADTH = 0.09  # length", "BREADTH = 9 / 100  # length"),
            (TOSS, "MAX_BEARING = 75.0  # largest", "MAX_BEARING = 1.5 * DIAGONAL_BEARING  # largest"),
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
                'from wide open") if self.narrow(world) else None',
                'from wide open") if self._was_narrow(world) else None',
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
        "extract_renames_shared_tolerance",
        ("cup_extract",),
        (
            (
                EXTRACT,
                '        x, y, z = world.rot("cup").T @ (world.com("block") - world.pos("cup"))\n'
                "        return math.hypot(x, y) <= self.cup.rim and 0.0 <= z <= self.cup.height\n",
                '        place = world.rot("cup").T @ (world.com("block") - world.pos("cup"))\n'
                "        if math.hypot(place[0], place[1]) > self.cup.rim:\n            return False\n"
                "        return bool(0.0 <= place[2] <= self.cup.height)\n",
            ),
        ),
    ),
    Edit(
        "domino_splits_failure",
        ("domino_single",),
        (
            (
                DOMINO,
                '        if touched_only(world, "tile_0"):\n            return Strict("the robot touched a tile'
                " other than"
                ' the first")\n'
                '        if carried(world, "tile_0", self.spot(0), CARRY_TOLERANCE):\n'
                '            return Strict("the robot carried the first tile away")\n        return None\n',
                "        return self._cheated(world)\n\n"
                "    def _cheated(self, world: World) -> Strict | None:\n"
                '        """A rule of ours that the robot has broken, or None."""\n'
                '        first = "tile_0"\n'
                "        if touched_only(world, first) is not None:\n"
                '            return Strict("the robot touched a tile other than the first")\n'
                "        away = carried(world, first, self.spot(0), CARRY_TOLERANCE)\n"
                '        return Strict("the robot carried the first tile away") if away else None\n',
            ),
        ),
    ),
    Edit(
        "domino_task_file_spelled_otherwise",
        ("domino_single",),
        (
            (
                "conf/task/domino_single.yaml",
                "  count:       [integer, 3, 6]\n",
                "  # three tiles are the shortest chain\n  count: [integer, 3, 6]\n",
            ),
            ("conf/task/domino_single.yaml", "[uniform, -0.05, 0.05]", "[uniform, -5.0e-2, 0.050]"),
            ("conf/task/domino_single.yaml", "horizon: 12.0  # s;", "horizon: 12  # [s];"),
            ("conf/task/domino_single.yaml", "      heading: [fixed, 45.0]", "      heading: 45.0"),
        ),
    ),
    Edit(
        "domino_whole_number_for_a_real_one",
        ("domino_single",),
        (("conf/task/domino_single.yaml", "[choice, 0.0, 90.0]", "[choice, 0, 90]"),),
    ),
    Edit(
        "domino_spots_by_comprehension",
        ("domino_single",),
        (
            (
                DOMINO,
                "(before + piece.thickness / 2 - half) * self.u",
                "(piece.thickness / 2 + (before - half)) * self.u",
            ),
        ),
        rounds=True,
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
        "launched_ball_rule_by_match",
        ("linear_intercept",),
        (
            (
                "scengen/tasks/launched_ball.py",
                '        if memory["moved"] > WAITING_TOLERANCE:\n'
                '            return Strict("the hand did not wait for the ball")\n'
                '        if not memory["caught"] and world.time - memory["first_touch"] > CATCHING_TIME:\n'
                '            return Strict("the ball was touched and not caught")\n        return None\n',
                '        late = world.time - memory["first_touch"] > CATCHING_TIME and not memory["caught"]\n'
                '        match memory["moved"] > WAITING_TOLERANCE, late:\n'
                '            case True, _:\n                return Strict("the hand did not wait for the ball")\n'
                '            case _, True:\n                return Strict("the ball was touched and not caught")\n'
                "        return None\n",
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
                "        self._carry_on(world, touched, lies)\n\n"
                "    def _carry_on(self, world: World, touched: bool, lies: bool) -> None:\n"
                '        """Track where the object is carried, and open the jaw at the place of a slip."""\n'
                '        memory, at = world.memory, world.com("thing")\n'
                '        raised = at[2] - memory["stood"] >= (MIN_CARRY_HEIGHT if memory["high"] else MIN_LIFT)\n',
            ),
        ),
    ),
    Edit(
        "funnel_failure_with_locals",
        ("gap_funnel",),
        (
            (
                FUNNEL,
                '        return Strict("the ball was lifted") if world.com("ball")[2] - self.start[2] > MAX_RISE'
                " else None",
                '        rise = world.com("ball")[2] - self.start[2]\n'
                '        return None if rise <= MAX_RISE else Strict("the ball was lifted")',
            ),
        ),
    ),
    Edit(
        "ramp_failure_reordered_conditions",
        ("galileo_ramp_drop",),
        (
            (
                RAMP,
                '        if touching and world.touched("ball", "ramp/far"):\n',
                '        if world.touched("ball", "ramp/far") and touching:\n',
            ),
            (RAMP, "        if along > 0.0 and touching:\n", "        if touching and 0.0 < along:\n"),
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
        "rename_class_of_family",
        ("mirror_pick_place",),
        (
            (MIRROR, "class MirrorPickPlace(Scenario):", "class CubeInMirror(Scenario):"),
            (
                "conf/task/mirror_pick_place.yaml",
                "family: scengen.tasks.mirror_pick_place.MirrorPickPlace",
                "family: scengen.tasks.mirror_pick_place.CubeInMirror",
            ),
        ),
        misjudged="ids of scenarios are hashes of the dotted name of the family",
    ),
    Edit(
        "reword_reason_of_failure",
        ("mirror_pick_place",),
        ((MIRROR, 'return "the cube fell off the table"', 'return "the cube has fallen off the table"'),),
        misjudged="verdicts and answers of the rules contain the words of a reason",
    ),
    Edit(
        "rename_memory",
        ("balance_hard",),
        (
            (BALANCE, '        remember(scene, "alone")', '        remember(scene, "free_time")'),
            (
                BALANCE,
                '        return world.memory["alone"] >= RELEASE_TIME',
                '        return world.memory["free_time"] >= RELEASE_TIME',
            ),
            (
                BALANCE,
                '        world.memory["alone"] = world.memory["alone"] + Loop.PERIOD if alone else 0.0',
                '        world.memory["free_time"] = world.memory["free_time"] + Loop.PERIOD if alone else 0.0',
            ),
        ),
        misjudged="the text of the scene and the answers of the rules contain the names of the memory",
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
