"""Refactorings of tasks from A to K, none of which may make a task another one."""

from edit import NEW, Edit

BALANCE = "scengen/tasks/balance.py"
CAGE = "scengen/tasks/ball_cage_escape.py"
SUCTION = "scengen/tasks/cracker_box_suction.py"
TOSS = "scengen/tasks/cube_toss.py"
EXTRACT = "scengen/tasks/cup_extract.py"
DOMINO = "scengen/tasks/domino_single.py"
FUNNEL = "scengen/tasks/gap_funnel.py"
RAMP = "scengen/tasks/galileo_ramp_drop.py"

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
)
