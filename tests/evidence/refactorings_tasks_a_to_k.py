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
        "balance_failure_by_guard",
        ("balance_hard",),
        (
            (
                BALANCE,
                '        return "the rod fell off the table" if fallen(world, "rod") else None',
                '        if not fallen(world, "rod"):\n            return None\n'
                '        return "the rod fell off the table"',
            ),
            (
                BALANCE,
                'return world.velocity("rod")[5] < -MAX_FALL_SPEED and not world.touching_bodies("rod")',
                'return not (world.touching_bodies("rod") or -MAX_FALL_SPEED <= world.velocity("rod")[5])',
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
                '        if fallen(world, "ball", below=0.0):\n            return "the ball fell off the table"\n'
                '        return "the cage fell off the table" if fallen(world, "cage", below=0.0) else None\n',
                '        return self._lost(world, "ball") or self._lost(world, "cage")\n'
                "\n    def _lost(self, world: World, name: str) -> str | None:\n"
                '        """Reason why a thing that fell off the table is lost, or None."""\n'
                '        return f"the {name} fell off the table" if fallen(world, name, below=0.0) else None\n',
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
                "        return math.hypot(off[0], off[1]) <= aside and abs(off[2]) <= high",
                "        return not (abs(off[2]) > high or math.hypot(off[0], off[1]) > aside)",
            ),
        ),
    ),
    Edit(
        "toss_computes_unit_vector_each_time",
        ("cube_toss",),
        (
            (
                TOSS,
                "    @cached_property\n    def u(self) -> Vec3:",
                "    @property\n    def u(self) -> Vec3:",
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
                '        if world.touched(ROBOT, "slab"):\n            return "the robot touched the slab"\n'
                "        return None\n",
                "        return self._lost(world)\n\n"
                "    def _lost(self, world: World) -> str | None:\n"
                '        """Reason why the slab is lost, or None."""\n'
                '        touched = world.touched(ROBOT, "slab")\n'
                '        return "the robot touched the slab" if touched else None\n',
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
        "funnel_means_with_locals",
        ("gap_funnel",),
        (
            (
                FUNNEL,
                '            low = world.com("ball")[2] - self.start[2] <= MAX_RISE\n'
                '            return low and not world.touching(ROBOT, "ball")',
                '            rise = world.com("ball")[2] - self.start[2]\n'
                '            free = not world.touching(ROBOT, "ball")\n'
                "            return rise <= MAX_RISE and free",
            ),
        ),
    ),
    Edit(
        "ramp_means_reordered_conditions",
        ("galileo_ramp_drop",),
        (
            (
                RAMP,
                'return world.arm.grips("ball") and world.touching("ball", "ramp/near")',
                'return world.touching("ball", "ramp/near") and world.arm.grips("ball")',
            ),
            (
                RAMP,
                'return on_floor and self.along(world.com("ball")) < 0.0 and',
                'return 0.0 > self.along(world.com("ball")) and on_floor and',
            ),
        ),
    ),
)
