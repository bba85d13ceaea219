"""Changes of declarations, draws, scenes and plans of tasks, all of which must be noticed."""

from edit import Edit

MIRROR = "scengen/tasks/mirror_pick_place.py"
SORT = "scengen/tasks/mass_sort.py"
OCCLUDER = "scengen/tasks/occluder_push.py"
TOSS = "scengen/tasks/cube_toss.py"
PENDULUM = "scengen/tasks/pendulum_grasp.py"
YCB = "scengen/tasks/pick_place_ycb.py"
EXTRACT = "scengen/tasks/cup_extract.py"
DOMINO = "scengen/tasks/domino_single.py"
LAUNCHED = "scengen/tasks/launched_ball.py"
DECLARED = ("declared value",)

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
        misjudged="two parameters must change at once, and no stored proposal is refuted for this reason",
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
        "number_of_guesses",
        ("pendulum_grasp",),
        ((PENDULUM, ".tolist()), act, right, tries=1)", ".tolist()), act, right, tries=3)"),),
        DECLARED,
    ),
    Edit(
        "plan_of_a_step",
        ("domino_single",),
        ((DOMINO, "self.topple(world, self.count // 2)", "self.topple(world, 1)"),),
        ("steps",),
        least="bits",
        longer=True,
    ),
    Edit(
        "question_about_the_scene",
        ("domino_single",),
        (("conf/facts/domino_single.yaml", "in the chain, without the slab?", "in the chain, with the slab?"),),
        DECLARED,
    ),
)
