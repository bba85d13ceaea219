"""The Panda's jaw as it is in the model: sizes, forces and times that plans and constraints rely on.

Lengths are seen from the grip site of a hand that points down: "along" is the direction in which the fingers close,
"across" the level direction at right angles to it.
"""

OPENING = 0.080
"""Widest thing that fits between the open pads [m]: twice the range of a finger joint, panda_gripper.xml."""
SPAN = 0.133
"""Width of the open jaw along, its fingers included [m]."""
FINGER = 0.0105
"""How far the fingers, open or closed, reach across, to either side [m]: half their width."""
TIP = 0.0092
"""How far the finger tips reach below the grip site [m]."""
PAD = 0.016
"""Width of a finger pad across [m]."""
PALM_ALONG = 0.104
"""How far the palm reaches along, to either side [m]."""
PALM_ACROSS = 0.0316
"""How far the palm reaches across, to either side [m]."""
PALM_ABOVE = 0.031
"""Height of the palm's lower face above the grip site [m]."""
