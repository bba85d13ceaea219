"""Lists of primitives written by hand from the poses that a prompt tells, as models for stage 3."""

import itertools
import json
import math
import re

import numpy as np
from scipy.spatial.transform import Rotation

from scengen.agents.models import Call, Reply

POSE = re.compile(r"^(.+): position \[([^\]]*)\], quaternion xyzw \[([^\]]*)\], size \[([^\]]*)\]$", re.M)


def poses(text):
    """Middles of the lower sides of the things in a prompt, which stand upright, quaternions and sizes, by name."""
    told = {m[1]: tuple([float(v) for v in group.split(",")] for group in m.groups()[1:]) for m in POSE.finditer(text)}
    return {name: ([x, y, z - size[2] / 2], quat, size) for name, ((x, y, z), quat, size) in told.items()}


class Listed:
    """A model that writes its list of primitives when it sees the start, and then goes through it."""

    def reply(self, turns, tools, schema, temperature, seed):
        text = turns[-1].text
        done = len(re.findall(r"^\d+\. ", text, re.M))
        if not done:
            self.calls = self.listed(poses(text))
        name, arguments = self.calls[done] if done < len(self.calls) else ("Done", {"reason": "the list is over"})
        return Reply("", (Call(name, json.dumps({**arguments, "reasoning": "by hand"})),))


class Domino(Listed):
    """Close the jaw, go behind the first domino, push along the chain."""

    def listed(self, things):
        (x, y, z), _, (*_, height) = things["first domino"]
        slab = things["red slab"][0]
        way = math.hypot(slab[0] - x, slab[1] - y)
        u = ((slab[0] - x) / way, (slab[1] - y) / way)

        def at(along, up):
            return {"pos": [x + along * u[0], y + along * u[1], z + up]}

        push = 0.8 * height
        return [
            ("CloseGripper", {}),
            ("MoveEEF", at(-0.05, 0.15)),
            ("MoveEEF", at(-0.05, push)),
            ("MoveEEF", {**at(0.03, push), "ticks": 60}),
            ("MoveEEF", at(-0.06, push)),
            ("Hold", {"ticks": 200}),
        ]


class Block(Listed):
    """Come down on the block, close, lift."""

    def listed(self, things):
        (x, y, z), quat, (_, _, height) = things["red block"]
        yaw = math.remainder(2 * math.atan2(quat[2], quat[3]), math.pi / 2)
        turn = [math.cos((yaw + math.pi / 2) / 2), math.sin((yaw + math.pi / 2) / 2), 0.0, 0.0]
        over, low = {"pos": [x, y, z + 0.15], "quat": turn}, {"pos": [x, y, z + 0.65 * height], "quat": turn}
        reach = [("OpenGripper", {}), ("MoveEEF", over), ("MoveEEF", low)]
        return [*reach, ("CloseGripper", {}), ("Lift", {"dz": 0.12}), ("Hold", {"ticks": 60})]


class Carry:
    """Take the object across its narrow side, go to where the square is now, look again, put it down."""

    def reply(self, turns, tools, schema, temperature, seed):
        text = turns[-1].text
        done = 24 - int(re.search(r"(\d+) primitives are left", text)[1])
        things = poses(text)
        (x, y, z), quat, (along, across, height) = things["object"]
        yaw = 2 * math.atan2(quat[2], quat[3]) + (math.pi / 2 if across < along else 0.0)
        yaw = math.remainder(yaw - math.pi / 2, math.pi) + math.pi / 2  # the way that joint 7 can turn
        turn = [math.cos(yaw / 2), math.sin(yaw / 2), 0.0, 0.0]
        square = things["green square"][0]
        take = [
            ("OpenGripper", {}),
            ("MoveEEF", {"pos": [x, y, z + height + 0.10], "quat": turn}),
            ("MoveEEF", {"pos": [x, y, max(0.812, z + height - 0.03)], "quat": turn}),
            ("CloseGripper", {}),
            ("Lift", {"dz": 0.12}),
        ]
        over = ("MoveEEF", {"pos": [*square[:2], 0.92 + height / 2]})
        put = [over] * 8 + [
            ("Descend", {"z": max(0.814, 0.802 + height - 0.03)}),
            ("OpenGripper", {}),
            ("Lift", {"dz": 0.1}),
        ]
        name, arguments = [*take, *put, *[("Hold", {"ticks": 50})] * 3, *[("Done", {"reason": "placed"})] * 24][done]
        return Reply("", (Call(name, json.dumps({**arguments, "reasoning": "by hand"})),))


class Chains(Domino):
    """Find the chain whose dominoes stand in line, evenly and close enough, up to the red slab; then as `Domino`."""

    def listed(self, things):
        return super().listed({**things, "first domino": self.intact(things)})

    def intact(self, things):
        firsts = [thing for name, thing in things.items() if name.startswith("first domino")]
        others = [thing for name, thing in things.items() if name.startswith("another domino")]
        red, height = things["red slab"], others[0][2][2]
        middle = [sum(thing[0][k] for thing in firsts) / len(firsts) for k in (0, 1)]
        ends = [things[name][0] for name in ("red slab", "blue slab")]
        side = math.atan2(ends[0][1] - ends[1][1], ends[0][0] - ends[1][0])  # along the row of the slabs
        u = (-math.sin(side), math.cos(side))
        if sum((red[0][k] - middle[k]) * u[k] for k in (0, 1)) < 0:
            u = (-u[0], -u[1])

        def place(thing):
            x, y = thing[0][0] - middle[0], thing[0][1] - middle[1]
            return x * u[0] + y * u[1], y * u[0] - x * u[1]

        def widest(first):
            """Widest step from one domino in the line of a first one to the next, up to the red slab."""
            across = place(first)[1]
            line = sorted(place(each)[0] for each in others if abs(place(each)[1] - across) < 0.01)
            line = [place(first)[0], *line, place(red)[0]]
            return max(b - a for a, b in itertools.pairwise(line))

        reached = [first for first in firsts if abs(place(first)[1] - place(red)[1]) < max(red[2]) / 2]
        assert min(map(widest, reached)) < height, "no chain is close enough"
        return min(reached, key=widest)


class Lip:
    """Push the plate over the nearer edge until it sticks out by 6 cm, look again, and pinch its lip from outside."""

    def reply(self, turns, tools, schema, temperature, seed):
        text = turns[-1].text
        done = 24 - int(re.search(r"(\d+) primitives are left", text)[1])
        (x, y, z), quat, (long, wide, thick) = poses(text)["plate"]
        side = math.copysign(1.0, y)
        yaw = 2 * math.atan2(quat[2], quat[3])
        half = (abs(math.sin(yaw)) * long + abs(math.cos(yaw)) * wide) / 2
        behind, low = y - side * (half + 0.03), z + 0.011
        edge = -float(re.search(r"reaches from\s(-[\d.]+)\s", text)[1])
        left = edge + 0.06 - half - abs(y)  # from where the plate is to where it sticks out by 6 cm

        def slide(speed):
            ticks = max(1, round((left + (0.02 if speed > 0.05 else 0.0)) / speed * 100))
            return "AtomicAction", {"action": [0, side * speed / 0.3, 0, 0, 0, 0, 1], "ticks": ticks}

        ahead, down = math.radians(30.0), math.radians(15.0)  # the hand looks back to the table, and a little down
        level = (math.cos(ahead), -side * math.sin(ahead), 0.0)
        along = [math.cos(down) * level[0], math.cos(down) * level[1], -math.sin(down)]
        closing = [-side * math.sin(down) * level[0], -side * math.sin(down) * level[1], -side * math.cos(down)]
        turn = Rotation.from_matrix(np.stack([closing, np.cross(along, closing), along], axis=1)).as_quat().tolist()
        at = [x - long / 2 + 0.014, y + side * (half - 0.018), z + thick / 2]

        def before(back, out, up):
            return {
                "pos": [at[0] - back * along[0], at[1] - back * along[1] + side * out, at[2] - back * along[2] + up]
            }

        calls = [
            ("CloseGripper", {}),
            ("MoveEEF", {"pos": [x, behind, 0.90]}),
            ("MoveEEF", {"pos": [x, behind, low], "ticks": 150}),
            slide(0.06),
            slide(0.03),
            ("AtomicAction", {"action": [0, -side * 0.3, 0.1, 0, 0, 0, 1], "ticks": 40}),
            ("Lift", {"dz": 0.15}),
            ("MoveEEF", {"pos": [-0.08, side * 0.30, 1.0]}),  # nearer to the robot the wrist cannot turn
            ("OpenGripper", {}),
            ("MoveEEF", {**before(0.07, 0.05, 0.18), "quat": turn}),
            ("MoveEEF", {**before(0.07, 0.0, 0.0), "quat": turn}),
            ("MoveEEF", {**before(0.0, 0.0, 0.0), "quat": turn}),
            ("CloseGripper", {}),
            ("Lift", {"dz": 0.16}),
            *[("Hold", {"ticks": 50})] * 12,
        ]
        name, arguments = calls[done]
        return Reply("", (Call(name, json.dumps({**arguments, "reasoning": "by hand"})),))
