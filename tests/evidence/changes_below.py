"""Changes of the code below the tasks, and of the robot, all of which must be noticed."""

from edit import Edit

GRIPPER = "robot/grippers/panda_gripper.xml"
ARM_MODEL = "robot/robots/panda/robot.xml"
PANDA, PROP, BOX = "scengen/robots/panda.py", "scengen/assets/prop.py", "scengen/assets/box.py"
EPISODE, WORLD, PREDICATES = "scengen/episode.py", "scengen/sim/world.py", "scengen/predicates.py"
OSC, LOOP = "scengen/control/osc.py", "scengen/control/loop.py"
MIRROR, TOSS, YCB, DOMINO = "mirror_pick_place", "cube_toss", "pick_place_ycb", "domino_single"
DECLARED, RULE = ("declared value",), ("success or failure",)
PLAYED = ("oracle", "noise", "idle", "shortcut", "jitter", "ablation")
"""Kinds of rollouts."""
FINGERPRINT = "the fingerprint of the machine changes with the code, so that no bits are compared"
"""Why other bits are not even noticed: the fingerprint is a rollout of the same controller."""

EDITS = (
    Edit(
        "separator_of_random_keys",
        (MIRROR,),
        (("scengen/samplers/keyed.py", 'blake2b("\\x1f".join(', 'blake2b("\\x1e".join('),),
        ("draw",),
    ),
    Edit(
        "damping_of_a_finger",
        (MIRROR,),
        ((GRIPPER, 'range="0.0 0.04" damping="100"', 'range="0.0 0.04" damping="98"'),),
        DECLARED,
    ),
    Edit(
        "size_of_a_pad",
        (MIRROR,),
        ((GRIPPER, '"0.008 0.004 0.008" pos="0 -0.005', '"0.00802 0.004 0.008" pos="0 -0.005'),),
        DECLARED,
    ),
    Edit(
        "friction_of_a_pad",
        (MIRROR,),
        (
            (
                GRIPPER,
                '"2 0.05 0.0001" conaffinity="1" contype="1" name="finger1',
                '"1.96 0.05 0.0001" conaffinity="1" contype="1" name="finger1',
            ),
        ),
        DECLARED,
    ),
    Edit(
        "force_of_a_finger",
        (MIRROR,),
        (
            (
                GRIPPER,
                'name="gripper_finger_joint1" forcelimited="true" forcerange="-20 20"',
                'name="gripper_finger_joint1" forcelimited="true" forcerange="-19.6 19.6"',
            ),
        ),
        DECLARED,
    ),
    Edit(
        "margin_of_a_pad",
        (MIRROR,),
        ((GRIPPER, 'contype="1" name="finger1_pad', 'contype="1" margin="0.001" gap="0.001" name="finger1_pad'),),
        DECLARED,
    ),
    Edit(
        "scale_of_a_mesh",
        (MIRROR,),
        ((GRIPPER, '<mesh name="finger" file=', '<mesh name="finger" scale="1.001 1 1" file='),),
        DECLARED,
    ),
    Edit(
        "scale_of_a_visual_mesh",
        (MIRROR,),
        ((GRIPPER, '<mesh name="finger_vis" file=', '<mesh name="finger_vis" scale="1.1 1 1" file='),),
        DECLARED,
    ),
    Edit(
        "place_of_the_camera_at_the_wrist",
        (MIRROR,),
        ((ARM_MODEL, 'name="eye_in_hand" pos="0.05 0 0"', 'name="eye_in_hand" pos="0.06 0 0"'),),
        DECLARED,
    ),
    Edit(
        "range_of_a_joint",
        (MIRROR,),
        ((ARM_MODEL, '"-0.0175 3.7525"', '"-0.0175 3.7"'),),
        DECLARED,
    ),
    Edit(
        "inertia_of_rotors",
        (MIRROR,),
        ((PANDA, "ARMATURE = tuple(5.0 / (i + 1)", "ARMATURE = tuple(5.1 / (i + 1)"),),
        DECLARED,
    ),
    Edit(
        "posture_after_a_reset",
        (MIRROR,),
        ((PANDA, "np.array([0, np.pi / 16, 0, -np.pi / 2", "np.array([0, np.pi / 17, 0, -np.pi / 2"),),
        (*DECLARED, *PLAYED),
    ),
    Edit(
        "press_of_a_jaw_that_holds_at_the_start",
        (TOSS,),
        ((PANDA, "PRESS = 1e-4", "PRESS = 2e-4"),),
        (*DECLARED, *PLAYED),
        misjudged="other bits alone: qpos after a reset is not declared",
    ),
    Edit(
        "gain_of_the_controller",
        (MIRROR, DOMINO),
        ((OSC, "KP = 150.0\n", "KP = 153.0\n"),),
        (*DECLARED, *PLAYED),
        misjudged=f"the constants of the controller are not declared, and {FINGERPRINT}",
    ),
    Edit(
        "speed_of_the_jaw",
        (MIRROR,),
        ((OSC, "JAW_SPEED = 0.2\n", "JAW_SPEED = 0.19\n"),),
        (*DECLARED, *PLAYED),
        misjudged=f"the constants of the controller are not declared, and {FINGERPRINT}",
    ),
    Edit(
        "average_of_the_filter",
        (MIRROR, DOMINO),
        (("scengen/control/teleop.py", "ALPHA = 0.8\n", "ALPHA = 0.784\n"),),
        (*DECLARED, *PLAYED),
        misjudged=f"the constants of the filter are not declared, and {FINGERPRINT}",
    ),
    Edit(
        "pads_that_seal_a_cup",
        ("cracker_box_suction",),
        ((OSC, "MIN_SEALED_PADS = 3\n", "MIN_SEALED_PADS = 2\n"),),
        (*DECLARED, *PLAYED),
        misjudged="other bits alone: the constants of the controller are not declared",
    ),
    Edit(
        "distance_of_a_contact",
        (DOMINO, YCB),
        (
            (
                LOOP,
                "        if native.float64s(contact + scene.dist, 1)[0] <= 0.0:\n"
                "            geoms = native.int32s(contact + scene.geom, 2)\n            if geoms[0] >= 0",
                "        if native.float64s(contact + scene.dist, 1)[0] <= -1e-4:\n"
                "            geoms = native.int32s(contact + scene.geom, 2)\n            if geoms[0] >= 0",
            ),
        ),
        (*DECLARED, *PLAYED),
    ),
    Edit(
        "pull_of_the_cup",
        ("cracker_box_suction",),
        (("scengen/robots/suction.py", "PULL = 40.0\n", "PULL = 39.2\n"),),
        DECLARED,
    ),
    Edit(
        "impratio",
        (MIRROR,),
        ((PROP, "option.impratio = 20.0", "option.impratio = 19.6"),),
        ("scene",),
    ),
    Edit(
        "solref_of_props",
        (DOMINO,),
        ((PROP, "STIFF = (0.005, 1.0)", "STIFF = (0.0051, 1.0)"),),
        ("scene",),
    ),
    Edit(
        "integrator",
        (MIRROR,),
        ((PROP, "mjtIntegrator.mjINT_EULER", "mjtIntegrator.mjINT_IMPLICITFAST"),),
        ("scene",),
    ),
    Edit(
        "friction_of_the_table",
        (MIRROR,),
        ((PROP, "        friction=[1.0, 0.005, 0.0001],", "        friction=[0.98, 0.005, 0.0001],"),),
        ("scene",),
    ),
    Edit(
        "iterations_in_the_composed_scene",
        (MIRROR, DOMINO),
        (
            (
                "scengen/sim/embodiment.py",
                "    named = all_hands(embodiment)\n    for number",
                "    named = all_hands(embodiment)\n    scene.option.iterations = 2\n    for number",
            ),
        ),
        (*DECLARED, *PLAYED),
    ),
    Edit(
        "bound_of_a_parameter",
        (DOMINO,),
        ((BOX, 'height: float = param(0.080, "m", 0.03, 0.20)', 'height: float = param(0.080, "m", 0.03, 0.204)'),),
        DECLARED,
    ),
    Edit(
        "nominal_value_of_an_asset",
        (DOMINO,),
        ((BOX, 'width: float = param(0.040, "m", 0.01, 0.60)', 'width: float = param(0.0408, "m", 0.01, 0.60)'),),
        ("scene",),
    ),
    Edit(
        "hidden_parameter",
        ("mass_sort",),
        (
            (
                "scengen/tasks/mass_sort.py",
                'light: float = param(0.05, "kg", 0.02, 0.6, hidden=True)',
                'light: float = param(0.05, "kg", 0.02, 0.6)',
            ),
        ),
        DECLARED,
    ),
    Edit(
        "speed_of_stillness",
        (YCB, "gap_funnel"),
        (
            (
                PREDICATES,
                "    return math.sqrt(velocity @ velocity) < below",
                "    return math.sqrt(velocity @ velocity) < 1.02 * below",
            ),
        ),
        RULE,
    ),
    Edit(
        "height_of_a_fall",
        (MIRROR, "balance_hard"),
        ((PREDICATES, "*bodies: str, below: float = 0.05)", "*bodies: str, below: float = 0.051)"),),
        RULE,
    ),
    Edit(
        "held_by_the_robot_and_others",
        (MIRROR,),
        (
            (
                PREDICATES,
                "    return world.touching(ROBOT, body) and not any(others)",
                "    return world.touching(ROBOT, body)",
            ),
        ),
        RULE,
    ),
    Edit(
        "touch_now_instead_of_ever",
        (DOMINO,),
        (
            (
                PREDICATES,
                "body not in allowed and world.touched(ROBOT, body)",
                "body not in allowed and world.touching(ROBOT, body)",
            ),
        ),
        RULE,
    ),
    Edit(
        "pace_of_moves",
        (MIRROR, DOMINO),
        (("scengen/skills/pace.py", "COARSE = Pace(0.30, 0.02)", "COARSE = Pace(0.294, 0.02)"),),
        ("oracle", "shortcut"),
        least="bits",
    ),
    Edit(
        "time_of_a_grasp",
        (MIRROR,),
        (("scengen/skills/jaw.py", "GRASP_TIME = 0.3\n", "GRASP_TIME = 0.31\n"),),
        ("oracle",),
        least="bits",
    ),
    Edit(
        "interrupted_hold_counts",
        (MIRROR, "balance_hard"),
        (
            (
                EPISODE,
                "if self.scenario.success(self.world) else 0.0",
                "if self.scenario.success(self.world) else self.held",
            ),
        ),
        (*DECLARED, *PLAYED),
    ),
    Edit(
        "success_before_failure",
        (DOMINO, "balance_hard"),
        ((EPISODE, 'self.outcome in (None, "success") and (lost', "self.outcome is None and (lost"),),
        (*DECLARED, *PLAYED),
    ),
    Edit(
        "launch_without_spin",
        ("linear_intercept",),
        (
            (
                WORLD,
                "self.rot(body).T @ np.asarray(angular, float)",
                "0.0 * self.rot(body).T @ np.asarray(angular, float)",
            ),
        ),
        ("events", *PLAYED),
    ),
    Edit(
        "events_one_period_early",
        ("linear_intercept",),
        ((WORLD, "abs(self.time - moment) < Loop.PERIOD / 2", "abs(self.time - moment) < Loop.PERIOD"),),
        ("events", *PLAYED),
    ),
)
