"""Plans written by hand from the paper's text (App. B) and the words of the sheets, as a person grades them.

A line is a plan: names of sub-goals, some with objects after `@`, joined by `+` for blanks. Wrong plans are wrong in
one way, named by the kind of error that a person sees.
"""

MISSING, ORDER, MORE, AFFORDANCE, STRANGE = (
    "missing", "wrong order", "additional", "affordance", "hallucinated object"
)  # fmt: skip

RIGHT = {
    "domino_single": """
        reach_behind tip_first chain_falls
        close_jaw reach_behind tip_first step_back chain_falls
        reach_behind close_jaw tip_first chain_falls step_back
        reach_behind@first+domino tip_first@first+domino,another+domino chain_falls@red+slab
        """,
    "edge_slide": """
        reach_inner_side slide_out reach_lip pinch lift
        reach_inner_side slide_out leave_plate reach_lip pinch lift
        reach_inner_side@plate,fingers slide_out@the+plate,edge,table reach_lip@jaw pinch lift
        """,
    "mass_sort": """
        weigh_left weigh_middle weigh_right place_lightest place_middle place_heaviest
        weigh_right weigh_left weigh_middle place_heaviest place_lightest place_middle
        weigh_middle weigh_right weigh_left place_middle place_heaviest place_lightest
        weigh_left weigh_middle weigh_right weigh_left place_lightest place_middle place_heaviest
        """,
    "mirror_pick_place": """
        find_frame go_above come_down grasp lift
        find_frame find_frame go_above come_down grasp lift
        find_frame@camera go_above@red+block come_down@hand grasp@gripper lift
        """,
    "seesaw_balance": """
        take_weight put_on_arm look correct level
        take_weight put_on_arm look correct look correct look level
        look take_weight put_on_arm look correct level
        """,
    "tool_retrieve": """
        take_hook pass_behind draw_in put_hook_down grasp_cube lift_cube
        take_hook@blue+hook,handle pass_behind@tip,red+cube draw_in@red+cube put_hook_down grasp_cube lift_cube
        take_hook@the+blue+hook pass_behind draw_in put_hook_down@table grasp_cube@the+red+cube,jaw lift_cube
        """,
    "cup_extract": """
        take_handle lift_cup pour put_cup_aside take_block place_block
        take_handle@cup,handle lift_cup pour@block put_cup_aside@table take_block place_block@green+square
        """,
    "packing": """
        find_arrangement take_piece turn_piece lower_piece
        take_piece find_arrangement turn_piece lower_piece
        find_arrangement take_piece turn_piece lower_piece take_piece turn_piece lower_piece
        find_arrangement take_piece turn_piece lower_piece take_piece lower_piece take_piece turn_piece lower_piece
        find_arrangement@bin take_piece@piece,suction+cup turn_piece lower_piece@bin
        """,
    "slip_recovery": """
        take_object carry notice_slip find_object take_again put_down
        take_object carry notice_slip find_object take_again carry put_down
        take_object carry notice_slip find_object take_again carry notice_slip put_down
        take_object carry notice_slip find_object take_again carry notice_slip find_object take_again carry put_down
        """,
    "occluder_push": """
        uncover_first look take_red place_red
        uncover_first look uncover_first look take_red place_red
        uncover_first look uncover_first look uncover_first look take_red place_red
        uncover_first uncover_first uncover_first look take_red place_red
        uncover_first@lid look@camera take_red@red+cube place_red@green+patch
        """,
    "galileo_ramp_drop": """
        take_ball find_height bring_to_height release turns_on_patch
        find_height take_ball bring_to_height release turns_on_patch
        find_height@ramp,patch take_ball@ball bring_to_height@ramp release@jaw turns_on_patch@ball,patch
        """,
    "pick_place_ycb": """
        take_object approach find_square follow put_down
        take_object approach find_square approach find_square follow put_down
        take_object approach find_square follow find_square follow put_down
        take_object approach find_square follow approach find_square follow put_down
        """,
}
"""Right plans by task."""

WRONG = {
    "domino_single": {
        MISSING: """
            tip_first chain_falls
            reach_behind chain_falls
            """,
        ORDER: """
            tip_first reach_behind chain_falls
            reach_behind chain_falls tip_first
            """,
        MORE: """
            reach_behind tip_first tip_first chain_falls
            reach_behind tip_first chain_falls other
            """,
        AFFORDANCE: """
            reach_behind tip_first chain_falls push_slab
            push_slab
            reach_behind push_middle tip_first chain_falls
            carry_first reach_behind tip_first chain_falls
            """,
        STRANGE: "reach_behind@hammer tip_first chain_falls",
    },
    "edge_slide": {
        MISSING: """
            reach_lip pinch lift
            reach_inner_side slide_out pinch lift
            """,
        ORDER: """
            reach_inner_side slide_out pinch reach_lip lift
            slide_out reach_inner_side reach_lip pinch lift
            """,
        MORE: "reach_inner_side slide_out reach_lip pinch lift other",
        AFFORDANCE: """
            close_from_above lift
            reach_inner_side push_off reach_lip pinch lift
            """,
    },
    "mass_sort": {
        MISSING: """
            weigh_left weigh_middle place_lightest place_middle place_heaviest
            place_lightest place_middle place_heaviest
            weigh_left weigh_middle weigh_right place_lightest place_middle
            """,
        ORDER: "weigh_left weigh_middle place_lightest weigh_right place_middle place_heaviest",
        MORE: "weigh_left weigh_middle weigh_right place_lightest place_middle place_heaviest place_lightest",
        AFFORDANCE: """
            sort_by_sight weigh_left weigh_middle weigh_right place_lightest place_middle place_heaviest
            weigh_left weigh_middle weigh_right place_unlifted place_lightest place_middle place_heaviest
            """,
        STRANGE: "weigh_left@scales weigh_middle weigh_right place_lightest place_middle place_heaviest",
    },
    "mirror_pick_place": {
        MISSING: "go_above come_down grasp lift",
        ORDER: """
            go_above find_frame come_down grasp lift
            find_frame come_down go_above grasp lift
            """,
        AFFORDANCE: """
            find_frame go_where_shown come_down grasp lift
            find_frame push_to_middle go_above come_down grasp lift
            """,
    },
    "seesaw_balance": {
        MISSING: """
            take_weight put_on_arm level
            take_weight put_on_arm look level
            """,
        ORDER: """
            take_weight put_on_arm correct look level
            take_weight put_on_arm look correct level correct
            """,
        AFFORDANCE: """
            take_weight put_on_arm look correct level hold_level
            take_weight put_on_arm look move_target correct level
            """,
    },
    "tool_retrieve": {
        MISSING: """
            pass_behind draw_in put_hook_down grasp_cube lift_cube
            take_hook draw_in put_hook_down grasp_cube lift_cube
            take_hook pass_behind draw_in grasp_cube lift_cube
            take_hook pass_behind draw_in put_hook_down grasp_cube
            """,
        ORDER: """
            take_hook pass_behind draw_in grasp_cube put_hook_down lift_cube
            take_hook draw_in pass_behind put_hook_down grasp_cube lift_cube
            take_hook pass_behind put_hook_down draw_in grasp_cube lift_cube
            """,
        MORE: """
            take_hook pass_behind draw_in put_hook_down grasp_cube lift_cube take_hook
            take_hook pass_behind draw_in put_hook_down other grasp_cube lift_cube
            """,
        AFFORDANCE: """
            reach_cube lift_cube
            take_hook pass_behind draw_in lift_with_hook
            take_hook pass_behind draw_in put_hook_down grasp_with_hook grasp_cube lift_cube
            """,
        STRANGE: "take_hook@rope pass_behind draw_in put_hook_down grasp_cube lift_cube",
    },
    "cup_extract": {
        MISSING: """
            lift_cup pour put_cup_aside take_block place_block
            take_handle lift_cup put_cup_aside take_block place_block
            take_handle lift_cup pour take_block place_block
            take_handle lift_cup pour put_cup_aside take_block
            """,
        ORDER: """
            take_handle pour lift_cup put_cup_aside take_block place_block
            take_handle lift_cup put_cup_aside pour take_block place_block
            take_handle lift_cup pour take_block put_cup_aside place_block
            """,
        MORE: """
            take_handle lift_cup pour pour put_cup_aside take_block place_block
            take_handle lift_cup pour put_cup_aside take_block place_block other
            """,
        AFFORDANCE: """
            reach_in place_block
            hold_wall take_handle lift_cup pour put_cup_aside take_block place_block
            push_over take_block place_block
            """,
        STRANGE: "take_handle lift_cup pour put_cup_aside take_block@spoon place_block",
    },
    "packing": {
        MISSING: """
            take_piece turn_piece lower_piece
            find_arrangement take_piece lower_piece
            find_arrangement take_piece turn_piece
            """,
        ORDER: """
            find_arrangement turn_piece take_piece lower_piece
            find_arrangement take_piece lower_piece turn_piece
            take_piece turn_piece find_arrangement lower_piece
            """,
        MORE: "find_arrangement take_piece turn_piece lower_piece other",
        AFFORDANCE: """
            find_arrangement take_piece turn_piece lower_piece push_pieces
            find_arrangement take_piece flip_piece turn_piece lower_piece
            find_arrangement take_piece turn_piece lower_piece take_piece stack_pieces
            """,
        STRANGE: "find_arrangement take_piece turn_piece lower_piece@box+lid",
    },
    "slip_recovery": {
        MISSING: """
            take_object carry put_down
            carry notice_slip find_object take_again put_down
            take_object carry take_again put_down
            take_object carry notice_slip find_object put_down
            """,
        ORDER: """
            take_object carry find_object notice_slip take_again put_down
            take_object carry notice_slip find_object put_down take_again
            take_object notice_slip carry find_object take_again put_down
            take_object carry notice_slip find_object take_again put_down carry
            """,
        MORE: "take_object carry notice_slip find_object take_again put_down put_down",
        AFFORDANCE: """
            take_object carry_low notice_slip carry find_object take_again put_down
            take_object slide_object
            take_object carry notice_slip grip_harder find_object take_again put_down
            """,
        STRANGE: "take_object carry notice_slip find_object@bowl take_again put_down",
    },
    "occluder_push": {
        MISSING: """
            look take_red place_red
            uncover_first take_red place_red
            uncover_first look take_red
            """,
        ORDER: """
            uncover_first take_red look place_red
            uncover_first look place_red take_red
            uncover_first look take_red uncover_first place_red
            """,
        MORE: """
            uncover_first look take_red place_red take_red
            uncover_first look other take_red place_red
            """,
        AFFORDANCE: """
            lift_lid look take_red place_red
            uncover_first place_any
            reach_through place_red
            """,
        STRANGE: "uncover_first@curtain look take_red place_red",
    },
    "galileo_ramp_drop": {
        MISSING: """
            take_ball bring_to_height release turns_on_patch
            find_height bring_to_height release turns_on_patch
            take_ball find_height release turns_on_patch
            take_ball find_height bring_to_height turns_on_patch
            """,
        ORDER: """
            take_ball bring_to_height find_height release turns_on_patch
            take_ball find_height release bring_to_height turns_on_patch
            take_ball find_height bring_to_height turns_on_patch release
            """,
        MORE: "take_ball find_height bring_to_height release turns_on_patch take_ball",
        AFFORDANCE: """
            take_ball carry_to_patch
            take_ball find_height bring_to_height push_ball turns_on_patch
            take_ball find_height bring_to_height release try_again turns_on_patch
            """,
        STRANGE: "take_ball find_height@stopwatch bring_to_height release turns_on_patch",
    },
    "pick_place_ycb": {
        MISSING: """
            take_object put_down
            approach find_square follow put_down
            take_object approach follow put_down
            take_object approach find_square follow
            """,
        ORDER: """
            take_object find_square approach follow put_down
            take_object approach follow find_square put_down
            approach take_object find_square follow put_down
            take_object approach find_square put_down follow
            """,
        MORE: "take_object approach find_square follow put_down take_object",
        AFFORDANCE: """
            take_object place_at_start
            drag put_down
            take_object approach hold_square find_square follow put_down
            """,
        STRANGE: "take_object approach find_square@map follow put_down",
    },
}
"""Wrong plans by task, and the kind of error that a person sees first."""


def plans(text):
    """Plans in a text: each is a list of sub-goals with their objects."""
    return [[_step(word) for word in line.split()] for line in text.strip().splitlines()]


def _step(word):
    name, _, objects = word.partition("@")
    return name, [each.replace("+", " ") for each in objects.split(",") if each]


ALL_RIGHT = [(task, plan) for task, text in RIGHT.items() for plan in plans(text)]
ALL_WRONG = [
    (task, plan, kind) for task, kinds in WRONG.items() for kind, text in kinds.items() for plan in plans(text)
]
