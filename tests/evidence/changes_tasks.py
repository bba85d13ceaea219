"""Changes of single tasks, all of which must be noticed."""

from edit import Edit

BALANCE, CAGE = "scengen/tasks/balance.py", "scengen/tasks/ball_cage_escape.py"
MIRROR, SORT = "scengen/tasks/mirror_pick_place.py", "scengen/tasks/mass_sort.py"
OCCLUDER, SUCTION = "scengen/tasks/occluder_push.py", "scengen/tasks/cracker_box_suction.py"
TOSS, PENDULUM, YCB = "scengen/tasks/cube_toss.py", "scengen/tasks/pendulum_grasp.py", "scengen/tasks/pick_place_ycb.py"
EXTRACT, DOMINO = "scengen/tasks/cup_extract.py", "scengen/tasks/domino_single.py"
LINEAR, LAUNCHED = "scengen/tasks/linear_intercept.py", "scengen/tasks/launched_ball.py"
ROD, SLIP, FUNNEL = "scengen/tasks/rod_across.py", "scengen/tasks/slip_recovery.py", "scengen/tasks/gap_funnel.py"
RAMP, SHAPES = "scengen/tasks/galileo_ramp_drop.py", "scengen/tasks/shape_stack.py"
SHELTER, RIDGE = "scengen/tasks/sheltered_grasp.py", "scengen/tasks/rod_and_ridge.py"
DECLARED, RULE, EVENT = ("declared value",), ("success or failure",), ("events",)

EDITS = (
    Edit(
        "training_distribution",
        ("domino_single",),
        (("conf/task/domino_single.yaml", "[uniform, -0.05, 0.05]", "[uniform, -0.05, 0.051]"),),
        ("draw",),
    ),
    Edit(
        "distribution_of_an_axis",
        ("domino_single",),
        (("conf/task/domino_single.yaml", "[uniform, 25.0, 40.0]", "[uniform, 25.0, 40.8]"),),
        DECLARED,
    ),
    Edit(
        "severities",
        ("domino_single",),
        (("conf/task/domino_single.yaml", "severities: 5", "severities: 4"),),
        DECLARED,
    ),
    Edit(
        "mass",
        ("domino_single",),
        ((DOMINO, "thickness=0.015, mass=0.06,", "thickness=0.015, mass=0.0612,"),),
        ("scene",),
    ),
    Edit(
        "friction",
        ("cube_toss",),
        ((TOSS, "edge=0.040, mass=0.05, friction=0.8)", "edge=0.040, mass=0.05, friction=0.784)"),),
        ("scene",),
    ),
    Edit(
        "tilt_of_a_rod",
        ("balance_hard", "rod_across"),
        ((RIDGE, "MAX_TILT = math.radians(10.0)", "MAX_TILT = math.radians(10.2)"),),
        RULE,
    ),
    Edit(
        "time_limit",
        ("mirror_pick_place",),
        (("conf/task/mirror_pick_place.yaml", "horizon: 12.0 ", "horizon: 12.2 "),),
        DECLARED,
    ),
    Edit(
        "instruction",
        ("mirror_pick_place",),
        (("conf/task/mirror_pick_place.yaml", "Lift the red block off", "Raise the red block off"),),
        DECLARED,
    ),
    Edit("hold", ("mass_sort",), ((SORT, "    HOLD = 0.3\n", "    HOLD = 0.306\n"),), DECLARED),
    Edit(
        "speed_of_a_fall",
        ("balance_hard",),
        ((BALANCE, "MAX_FALL_SPEED = 0.35\n", "MAX_FALL_SPEED = 0.357\n"),),
        RULE,
    ),
    Edit(
        "time_of_release",
        ("balance_hard",),
        ((BALANCE, "RELEASE_TIME = 0.1\n", "RELEASE_TIME = 0.102\n"),),
        RULE,
    ),
    Edit(
        "strict_rule_removed",
        ("balance_hard",),
        (
            (
                BALANCE,
                '        return Strict("the rod was touched again on the ridge") if touched and self.released(world)'
                " else None",
                "        return None",
            ),
        ),
        RULE,
    ),
    Edit(
        "strict_rule_becomes_the_source's",
        ("balance_hard",),
        ((BALANCE, 'Strict("the rod was let go and tipped")', '"the rod was let go and tipped"'),),
        RULE,
    ),
    Edit(
        "comparison_inverted",
        ("linear_intercept",),
        ((LINEAR, "world.arm.hand) > NEAR_DISTANCE", "world.arm.hand) <= NEAR_DISTANCE"),),
        EVENT,
    ),
    Edit(
        "distance_of_waiting",
        ("linear_intercept",),
        ((LINEAR, "NEAR_DISTANCE = 0.15 ", "NEAR_DISTANCE = 0.153 "),),
        EVENT,
    ),
    Edit(
        "height_of_success",
        ("mirror_pick_place",),
        ((MIRROR, "LIFT_HEIGHT = 0.04\n", "LIFT_HEIGHT = 0.0408\n"),),
        RULE,
    ),
    Edit("height_of_an_event", ("pick_place_ycb",), ((YCB, "MIN_LIFT = 0.03 ", "MIN_LIFT = 0.0306 "),), EVENT),
    Edit(
        "distance_of_an_event",
        ("pick_place_ycb",),
        ((YCB, "self.spots[jumps][:2]) <= self.near:", "self.spots[jumps][:2]) <= 1.02 * self.near:"),),
        EVENT,
    ),
    Edit(
        "place_of_a_jump",
        ("pick_place_ycb",),
        ((YCB, "ends = found[-1] + jump.way *", "ends = found[-1] + 1.02 * jump.way *"),),
        EVENT,
    ),
    Edit(
        "no_jam",
        ("slip_recovery",),
        ((SLIP, "        world.arm.jam(self.pending(world))", "        world.arm.jam(False)"),),
        EVENT,
    ),
    Edit(
        "time_of_a_jam",
        ("slip_recovery",),
        ((SLIP, "world.time + self.planned[slips].seconds", "world.time + 1.02 * self.planned[slips].seconds"),),
        EVENT,
    ),
    Edit(
        "height_of_carrying",
        ("slip_recovery",),
        ((SLIP, "(MIN_CARRY_HEIGHT if", "(1.02 * MIN_CARRY_HEIGHT if"),),
        EVENT,
    ),
    Edit(
        "time_of_a_launch",
        ("linear_intercept",),
        ((LINEAR, "world.passes(self.launch)", "world.passes(1.02 * self.launch)"),),
        (*EVENT, "oracle"),
    ),
    Edit(
        "speed_of_a_launch",
        ("linear_intercept",),
        ((LINEAR, 'world.launch("ball", self.speed * self.u,', 'world.launch("ball", 1.02 * self.speed * self.u,'),),
        EVENT,
    ),
    Edit(
        "start_of_a_swing",
        ("pendulum_grasp",),
        ((PENDULUM, "world.spin(HINGE, math", "world.spin(HINGE, 1.02 * math"),),
        EVENT,
    ),
    Edit(
        "pending_event",
        ("linear_intercept",),
        ((LAUNCHED, "        return world.time < self.launch + Loop.PERIOD / 2", "        return False"),),
        RULE,
    ),
    Edit(
        "symmetry",
        ("mass_sort",),
        (
            (
                SORT,
                "    HOLD = 0.3\n",
                '    HOLD = 0.3\n    SYMMETRIES = (Symmetry("sides", swap=("first", "third")),)\n',
            ),
            (
                SORT,
                "from ..sim.world import World\n",
                "from ..sim.world import World\nfrom ..symmetry import Symmetry\n",
            ),
        ),
        DECLARED,
    ),
    Edit(
        "ablation_that_leaves_a_tile",
        ("domino_single",),
        (
            (
                DOMINO,
                "        for i in range(1, self.count):\n            scene.delete(",
                "        for i in range(2, self.count):\n            scene.delete(",
            ),
        ),
        ("ablation",),
    ),
    Edit(
        "shortcut_not_to_rest",
        ("pick_place_ycb",),
        ((YCB, "Shortcut(self._drag, to_rest=True)", "Shortcut(self._drag)"),),
        DECLARED,
    ),
    Edit(
        "plan_of_a_shortcut",
        ("domino_single",),
        ((DOMINO, "start, -0.15 * side, lambda", "start, -0.153 * side, lambda"),),
        ("shortcut",),
        least="bits",
    ),
    Edit(
        "pace_of_the_oracle",
        ("domino_single",),
        ((DOMINO, "PUSH_SPEED = 0.08 ", "PUSH_SPEED = 0.0816 "),),
        ("oracle",),
        least="bits",
    ),
    Edit(
        "constraint_of_masses",
        ("mass_sort",),
        ((SORT, "MIN_MASS_DIFFERENCE = 0.025\n", "MIN_MASS_DIFFERENCE = 0.0255\n"),),
        ("constraint",),
    ),
    Edit(
        "constraint_of_pictures",
        ("mirror_pick_place",),
        ((MIRROR, "MIN_PICTURE_OFFSET = 0.12\n", "MIN_PICTURE_OFFSET = 0.1224\n"),),
        ("constraint",),
    ),
    Edit(
        "constraint_of_a_reach",
        ("mass_sort",),
        (
            (
                SORT,
                "        above = (2 * self.edge + CARRY_HEIGHT) * UP",
                "        above = (2 * self.edge + 1.5 * CARRY_HEIGHT) * UP",
            ),
        ),
        ("constraint",),
    ),
    Edit(
        "feature",
        ("domino_single",),
        ((DOMINO, '"gap_over_height": self.gap / self.tile.height', '"gap_over_height": self.gap / self.tile.width'),),
        ("feature",),
    ),
    Edit(
        "fact",
        ("cup_extract",),
        ((EXTRACT, '            "height": self.cup.height,', '            "height": self.cup.rim,'),),
        ("fact",),
    ),
    Edit(
        "orientation",
        ("mirror_pick_place",),
        (
            (
                MIRROR,
                "VIEWS = (UPRIGHT, Orientation(2), Orientation(0, True)",
                "VIEWS = (UPRIGHT, Orientation(3), Orientation(0, True)",
            ),
        ),
        ("orientation",),
    ),
    Edit("disturbed_hinge", ("pendulum_grasp",), ((PENDULUM, "    DISTURBED = (HINGE,)\n", ""),), DECLARED),
    Edit(
        "moving_body",
        ("linear_intercept",),
        ((LAUNCHED, 'MOVING: ClassVar[tuple[str, ...]] = ("ball",)', "MOVING: ClassVar[tuple[str, ...]] = ()"),),
        DECLARED,
    ),
    Edit(
        "tolerance_of_the_solver",
        ("occluder_push",),
        ((OCCLUDER, "scene.option.tolerance = 1e-10", "scene.option.tolerance = 1e-9"),),
        ("scene",),
    ),
    Edit(
        "tolerance_of_a_crossing",
        ("rod_across",),
        ((ROD, "CROSSING_TOLERANCE = math.radians(30.0)", "CROSSING_TOLERANCE = math.radians(30.6)"),),
        RULE,
    ),
    Edit(
        "angle_of_a_fall",
        ("shape_stack",),
        ((SHAPES, "world.tilt(n) > FALL_ANGLE", "world.tilt(n) > 1.02 * FALL_ANGLE"),),
        RULE,
    ),
    Edit(
        "collar_of_the_cone",
        ("shape_stack",),
        ((SHAPES, "world.pos(cone)[2] + self.cone.collar", "world.pos(cone)[2] + 1.02 * self.cone.collar"),),
        RULE,
    ),
    Edit(
        "hop_at_a_release",
        ("galileo_ramp_drop",),
        ((RAMP, 'world.com("ball")) > 0.01:', 'world.com("ball")) > 0.0102:'),),
        RULE,
    ),
    Edit(
        "rise_of_a_ball",
        ("gap_funnel",),
        ((FUNNEL, "self.start[2] > MAX_RISE", "self.start[2] > 1.02 * MAX_RISE"),),
        RULE,
    ),
    Edit(
        "feeling_in_a_rack",
        ("sheltered_grasp",),
        ((SHELTER, "self._beside(world) > MAX_BESIDE", "self._beside(world) > 1.02 * MAX_BESIDE"),),
        RULE,
    ),
    Edit(
        "speed_of_rest",
        ("cup_extract",),
        ((EXTRACT, "REST_SPEED = 0.02  # speed", "REST_SPEED = 0.0204  # speed"),),
        RULE,
    ),
    Edit(
        "tilt_of_a_shake",
        ("ball_cage_escape",),
        ((CAGE, "SHAKE_TILT = math.radians(6.5)", "SHAKE_TILT = math.radians(6.63)"),),
        RULE,
    ),
    Edit(
        "end_of_a_cage",
        ("ball_cage_escape",),
        ((CAGE, "END_MARGIN = 0.001\n", "END_MARGIN = 0.00102\n"),),
        RULE,
    ),
    Edit(
        "box_laid_beside",
        ("cracker_box_suction",),
        ((SUCTION, 'world.tilt("box") < LEANING', 'world.tilt("box") < 1.02 * LEANING'),),
        RULE,
    ),
    Edit(
        "carried_first_tile",
        ("domino_single",),
        ((DOMINO, "CARRY_TOLERANCE = 0.01\n", "CARRY_TOLERANCE = 0.0102\n"),),
        RULE,
    ),
    Edit(
        "event_of_an_axis_alone",
        ("cube_toss",),
        ((TOSS, "self.bearing) * math.radians(self.rate))", "self.bearing) * math.radians(1.02 * self.rate))"),),
        EVENT,
    ),
    Edit(
        "rule_of_an_axis_alone",
        ("ball_cage_escape",),
        (
            (
                CAGE,
                "axis, sign = (1, 1.0) if self.cage.face == SIDE",
                "axis, sign = (1, -1.0) if self.cage.face == SIDE",
            ),
        ),
        RULE,
    ),
    Edit(
        "number_of_guesses",
        ("pendulum_grasp",),
        ((PENDULUM, ".tolist()), act, right, tries=1)", ".tolist()), act, right, tries=3)"),),
        DECLARED,
    ),
    Edit(
        "plan_of_a_step",
        ("domino_single",),
        ((DOMINO, "self.topple(world, self.count // 2)", "self.topple(world, 1)"),),
        DECLARED,
    ),
    Edit(
        "question_about_the_scene",
        ("domino_single",),
        (("conf/facts/domino_single.yaml", "in the chain, without the slab?", "in the chain, with the slab?"),),
        DECLARED,
    ),
)
