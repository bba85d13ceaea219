"""False claims about the scene: it is not the one that the family builds from the parameters.

Each witness solves the scene that stands in the file, and where the physics was touched the final state is the right
one: whoever only replays believes it. In the paper's tasks a slab that falls by itself needs no robot.
"""

import re

import numpy as np
from forgery import ELSEWHERE, Case, Draft
from labels import Change

NOT_THE_FAMILYS = r"scene.*(rebuilt|parameters|family)|(rebuil|family).*scene"
"""Reason of every case here: the scene in the file is not what comes out of the parameters."""
SLAB = '<body name="slab" pos="[^"]*" quat="[^"]*">'
IDLE = "idle"
SAME = "same"
"""Whether the goal is reached by doing nothing, or by the witness as it was."""


def _conditions(name: str, *numbers: float) -> Change:
    """Conditions of control that the split does not name."""
    data = " ".join(map(str, numbers))
    return lambda draft: draft.add(f'<custom><numeric name="impaired_{name}" data="{data}"/></custom>')


def _option(draft: Draft, text: str) -> None:
    draft.scene("<option ", f"<option {text} ")


def _lean(draft: Draft) -> None:
    """The slab leans by 25 deg away from the chain, and falls over."""
    pos = re.search(r'<body name="slab" pos="([^"]*)"', draft.row["scene_xml"])
    assert pos
    draft.scene(SLAB, f'<body name="slab" pos="{pos[1]}" euler="0 0.45 0">')


def _spring(draft: Draft) -> None:
    """A cart on a drawn spring stands before the slab."""
    x, y, z = np.array(re.search(r'<body name="slab" pos="([^"]*)"', draft.row["scene_xml"])[1].split(), float)
    draft.add(
        f'<body name="cart" pos="{x} {y - 0.04} {z + 0.1}"><joint name="cart" type="slide" axis="0 1 0" '
        'stiffness="60" springref="0.06" damping="2"/><geom type="box" size="0.02 0.005 0.01" mass="0.3"/></body>',
        "worldbody",
    )


def _weld(draft: Draft) -> None:
    draft.add('<equality><weld body1="tile_4" body2="tile_5" active="false"/></equality>')


def _saw_the_table(draft: Draft) -> None:
    draft.scene('(name="table_top" size=)"0.4 0.4', r'\1"0.4 0.15')


def _swap(draft: Draft) -> None:
    """Two scenarios exchange scene and witness; parameters stay."""
    first, second = draft.rows
    for name in ("scene_xml", "witness", "certificate"):
        first[name], second[name] = second[name], first[name]


def _recolour(first: str, second: str) -> Change:
    """Exchange the colours of two geoms: a policy that sees is sent elsewhere."""

    def change(draft: Draft) -> None:
        text = draft.row["scene_xml"]
        one, two = (re.search(f'name="{name}"[^>]*rgba="([^"]*)"', text) for name in (first, second))
        assert one and two and one[1] != two[1]
        draft.scene(f'(name="{first}"[^>]*rgba=)"[^"]*"', rf'\1"{two[1]}"')
        draft.scene(f'(name="{second}"[^>]*rgba=)"[^"]*"', rf'\1"{one[1]}"')

    return change


def _attribute(geom: str, name: str, value: str) -> Change:
    """Give a named element another value of one attribute."""
    return lambda draft: draft.scene(f'(<[^>]*name="{geom}"[^>]* {name}=)"[^"]*"', rf'\1"{value}"')


def _scaled(geom: str, name: str, by: float) -> Change:
    def change(draft: Draft) -> None:
        found = re.search(f'name="{geom}"[^>]* {name}="([^"]*)"', draft.row["scene_xml"])
        assert found, f"no {name} of {geom}"
        value = " ".join(f"{by * float(number):.6g}" for number in found[1].split())
        _attribute(geom, name, value)(draft)

    return change


def _extra(xml: str, to: str = "worldbody") -> Change:
    return lambda draft: draft.add(xml, to)


def _aside(body: str, by: float) -> Change:
    """A body that stands elsewhere [m]."""

    def moved(found: re.Match[str]) -> str:
        return f"{found[1]} {float(found[2]) + by:.6g}"

    return lambda draft: draft.scene(rf'(name="{body}" pos="\S+) (\S+)', moved)


SINGLE: dict[str, tuple[Change, str]] = {
    "gravity_sideways": (lambda d: _option(d, 'gravity="0 5 -9.81"'), IDLE),
    "gravity_weaker": (lambda d: _option(d, 'gravity="0 0 -9.5"'), SAME),
    "slow_gripper": (_conditions("gripper", 0.1), SAME),
    "easier_start": (_conditions("start", *([0.1] * 7)), SAME),
    "wind": (lambda d: _option(d, 'wind="0 8 0"'), IDLE),
    "thick_air": (lambda d: d.scene('density="1.2"', 'density="1.4"'), SAME),
    "leaning_slab": (_lean, IDLE),
    "table_ends_before_the_slab": (_saw_the_table, IDLE),
    "spring_behind_the_slab": (_spring, IDLE),
    "robot_passes_through": (
        _extra(
            '<contact><exclude body1="tile_1" body2="gripper0_right_leftfinger"/>'
            '<exclude body1="slab" body2="gripper0_right_leftfinger"/></contact>',
            "mujoco",
        ),
        SAME,
    ),
    "motors_on_the_robot": (
        _extra('<actuator><motor name="more" joint="robot0_joint1" gear="0"/></actuator>', "mujoco"),
        SAME,
    ),
    "dormant_weld": (_weld, SAME),
    "lighter_slab": (_scaled("slab/box", "mass", 0.5), SAME),
    "slippery_slab": (_attribute("slab/box", "friction", "0.3"), SAME),
    "tile_moved": (lambda d: d.scene(r'(name="tile_3" pos="\S+ \S+?)\d( )', r"\g<1>9\2"), SAME),
    "taller_tile": (_scaled("tile_5/box", "size", 1.02), SAME),
    "invisible_wall": (
        _extra('<geom type="box" size="0.01 0.3 0.3" pos="0.39 0 1.1" rgba="0 0 0 0" group="5"/>'),
        SAME,
    ),
    "other_time_step": (lambda d: _option(d, 'timestep="0.001"'), SAME),
    "fewer_iterations": (lambda d: _option(d, 'iterations="20"'), SAME),
    "other_integrator": (lambda d: _option(d, 'integrator="implicitfast"'), SAME),
    "floating_tile": (lambda d: d.scene('<body name="tile_5"', '<body name="tile_5" gravcomp="0.1"'), SAME),
    "green_slab": (_attribute("slab/box", "rgba", "0.1 0.78 0.1 1"), SAME),
    "camera_moved": (_attribute("frontview", "pos", "1.5 0 1.45"), SAME),
    "light_gone": (lambda d: d.scene("<light [^>]*/>", ""), SAME),
    "last_digit": (lambda d: d.scene(r'(name="tile_5" pos="\S+ 0\.\d{5})(\d)', r"\g<1>9"), SAME),
    "comment": (lambda d: d.scene("<worldbody>", "<!-- certified twice --><worldbody>"), SAME),
    "keyframe": (_extra('<keyframe><key name="home" time="0"/></keyframe>', "mujoco"), SAME),
    "user_memory": (_extra('<size nuserdata="16"/>', "mujoco"), SAME),
    "renamed": (lambda d: d.scene('model="MuJoCo Model"', 'model="certified"'), SAME),
}

ELSEWHERE_ONLY: dict[str, tuple[Change, str]] = {
    "underscore": (_attribute("slab/box", "mass", "0.0_6"), ""),
    "other_digits": (_attribute("slab/box", "mass", "\u0660.06"), ""),
    "whole_number_nearly": (lambda d: d.scene('condim="(\\d)"', r'condim="\1.0000000001"'), ""),
    "number_too_small": (lambda d: d.scene('pos="0 ', 'pos="1e-400 '), ""),
    "instruction_for_programs": (lambda d: d.scene("<worldbody>", "<?scene again?><worldbody>"), ""),
    "one_in_a_million": (_scaled("slab/box", "mass", 1.00001), SAME),
}
"""What Python reads as the same number and MuJoCo does not, or a difference that no rounding explains."""
FOREIGN = ("gravity_sideways", "robot_passes_through", "lighter_slab", "green_slab", "camera_moved", "invisible_wall")
"""Those that are also told by a machine that rounds otherwise, where texts need not be equal byte by byte."""

OTHERS: dict[str, dict[str, tuple[Change, str]]] = {
    "select_id": {
        "decoy_is_red": (_recolour("decoy/box", "slab/box"), SAME),
        "lighter_tiles": (_scaled("tile_2_1/box", "mass", 0.9), SAME),
        "tile_of_a_chain_moved": (_aside("tile_1_1", 0.002), SAME),
    },
    "galileo_id": {
        "patch_is_grey": (_attribute("ramp/patch_0", "rgba", "0.62 0.6 0.57 1"), SAME),
        "lighter_ball": (_scaled("ball/ball", "mass", 0.97), SAME),
        "dead_stop": (_extra('<geom type="box" size="0.2 0.01 0.05" pos="0 0.39 0.85" rgba="0 0 0 0"/>'), SAME),
    },
    "cage_id": {
        "lighter_cage": (lambda d: d.scene('(<inertial [^>]*mass=)"0.1"', r'\1"0.09"'), SAME),
        "rolling_ball": (_attribute("ball/ball", "friction", "0.5 0.005 0.0005"), SAME),
        "thinner_plate": (_scaled("cage/box_5", "size", 0.97), SAME),
    },
    "seesaw_id": {
        "stiff_axle": (lambda d: d.scene('frictionloss="0.002"', 'frictionloss="0.01"'), SAME),
        "lighter_target": (_scaled("target/box", "mass", 0.998), SAME),
        "blocks_exchanged_colours": (_recolour("weight/box", "target/box"), SAME),
    },
    "tool_id": {
        "sticky_hook": (_attribute("hook/bar_1", "friction", "1.2"), SAME),
        "lighter_cube": (_scaled("cube/box", "mass", 0.97), SAME),
        "cube_green": (_attribute("cube/box", "rgba", "0.1 0.8 0.1 1"), SAME),
    },
    "packing_id": {
        "wall_gone": (lambda d: d.scene('<geom name="bin/far"[^>]*/>', ""), SAME),
        "lighter_piece": (_scaled("piece_1/lying", "mass", 0.9), SAME),
        "wider_bin": (lambda d: d.scene('(name="bin/far"[^>]*pos=)"(\\S+)', r'\1"0.08'), SAME),
    },
    "shelf_id": {
        "white_plate": (_attribute("plate/bottom_0", "rgba", "1 1 1 1"), SAME),
        "smoother_foot": (_attribute("plate/bottom_0", "friction", "0.58"), SAME),
        "floor_of_the_slot_lower": (_scaled("shelf/base", "size", 0.99), SAME),
    },
}


def _case(base: str, name: str, change: Change, how: str, elsewhere: bool = False) -> Case:
    def forge(draft: Draft) -> None:
        before = draft.row["scene_xml"]
        change(draft)
        if how == IDLE:
            draft.idle()
        elif how == SAME:
            draft.played()
        assert draft.row["scene_xml"] != before
        if elsewhere:
            draft.everywhere(fingerprint=ELSEWHERE)

    where = "_elsewhere" if elsewhere else ""
    quick = f"{name}{where}" in QUICK
    return Case(f"{base}__{name}{where}", base, "reject", NOT_THE_FAMILYS, forge, quick=quick)


QUICK = {
    "gravity_sideways",
    "robot_passes_through",
    "lighter_slab_elsewhere",
    "green_slab_elsewhere",
    "cube_green",
}

CASES = [
    *(_case("single_quick", name, *change) for name, change in SINGLE.items()),
    *(_case("single_quick", name, *SINGLE[name], elsewhere=True) for name in FOREIGN),
    *(_case("single_quick", name, *change, elsewhere=True) for name, change in ELSEWHERE_ONLY.items()),
    *(_case(base, name, *change) for base, changes in OTHERS.items() for name, change in changes.items()),
    _case("single_quick", "scenes_exchanged", _swap, ""),
]
