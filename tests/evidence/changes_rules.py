"""Changes of the rules and events of tasks, all of which must be noticed."""

from edit import Edit

BALANCE = "scengen/tasks/balance.py"
CAGE = "scengen/tasks/ball_cage_escape.py"
MIRROR = "scengen/tasks/mirror_pick_place.py"
SUCTION = "scengen/tasks/cracker_box_suction.py"
TOSS = "scengen/tasks/cube_toss.py"
PENDULUM = "scengen/tasks/pendulum_grasp.py"
YCB = "scengen/tasks/pick_place_ycb.py"
EXTRACT = "scengen/tasks/cup_extract.py"
DOMINO = "scengen/tasks/domino_single.py"
LINEAR = "scengen/tasks/linear_intercept.py"
LAUNCHED = "scengen/tasks/launched_ball.py"
ROD = "scengen/tasks/rod_across.py"
SLIP = "scengen/tasks/slip_recovery.py"
FUNNEL = "scengen/tasks/gap_funnel.py"
RAMP = "scengen/tasks/galileo_ramp_drop.py"
SHAPES = "scengen/tasks/shape_stack.py"
SHELTER = "scengen/tasks/sheltered_grasp.py"
RIDGE = "scengen/tasks/rod_and_ridge.py"
RULE = ("success or failure",)
EVENT = ("events",)

EDITS = (
    Edit(
        "tilt_of_a_rod",
        ("balance_hard", "rod_across"),
        ((RIDGE, "MAX_TILT = math.radians(10.0)", "MAX_TILT = math.radians(10.2)"),),
        RULE,
    ),
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
        EVENT,
    ),
    Edit(
        "mean_removed",
        ("balance_hard",),
        (
            (
                BALANCE,
                '            "the rod was not dropped": throughout(lambda world: not dropped(world)),\n',
                "",
            ),
        ),
        RULE,
    ),
    Edit(
        "mean_becomes_a_rule_of_the_source",
        ("balance_hard",),
        (
            (
                BALANCE,
                '        return "the rod fell off the table" if fallen(world, "rod") else None',
                '        return "the rod fell off the table" if fallen(world, "rod") or (\n'
                '            world.velocity("rod")[5] < -MAX_FALL_SPEED and not world.touching_bodies("rod")\n'
                "        ) else None",
            ),
        ),
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
        ("constraint", *EVENT),
    ),
    Edit(
        "height_of_success",
        ("mirror_pick_place",),
        ((MIRROR, "LIFT_HEIGHT = 0.04\n", "LIFT_HEIGHT = 0.0408\n"),),
        RULE,
    ),
    Edit(
        "height_of_an_event",
        ("pick_place_ycb",),
        ((YCB, "MIN_LIFT = 0.03 ", "MIN_LIFT = 0.0306 "),),
        EVENT,
    ),
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
        ("constraint", *EVENT),
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
        ("idle", "jitter", "noise", "oracle", "shortcut", *EVENT),
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
        "tolerance_of_a_crossing",
        ("rod_across",),
        ((ROD, "CROSSING_TOLERANCE = math.radians(30.0)", "CROSSING_TOLERANCE = math.radians(30.6)"),),
        RULE,
    ),
    Edit(
        "angle_of_a_fall",
        ("shape_stack",),
        ((SHAPES, "world.tilt(name) <= FALL_ANGLE", "world.tilt(name) <= 1.02 * FALL_ANGLE"),),
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
        ((RAMP, "MAX_HOP = 0.01 ", "MAX_HOP = 0.0102 "),),
        RULE,
    ),
    Edit(
        "rise_of_a_ball",
        ("gap_funnel",),
        (
            (
                FUNNEL,
                'low = world.com("ball")[2] - self.start[2] <= MAX_RISE',
                'low = world.com("ball")[2] - self.start[2] <= 1.02 * MAX_RISE',
            ),
        ),
        RULE,
    ),
    Edit(
        "depth_between_the_fingers",
        ("sheltered_grasp",),
        ((SHELTER, "MIN_BETWEEN = 0.010\n", "MIN_BETWEEN = 0.0102\n"),),
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
        "tilt_of_a_laid_box",
        ("cracker_box_suction",),
        ((SUCTION, 'world.tilt("box") >= LEANING', 'world.tilt("box") >= 1.02 * LEANING'),),
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
        ("oracle",),
        least="bits",
        longer=True,
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
        ("oracle",),
        longer=True,
    ),
)
