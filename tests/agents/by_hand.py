"""Lists of primitives written by hand from the poses that a prompt tells, as models for stage 3."""

import json
import math
import re

from scengen.agents.models import Call, Reply

POSE = re.compile(r"^(.+): position \[([^\]]*)\], quaternion xyzw \[([^\]]*)\], size \[([^\]]*)\]$", re.M)


def poses(text):
    """Positions, quaternions and sizes of the things in a prompt, by their names."""
    return {m[1]: tuple([float(v) for v in group.split(",")] for group in m.groups()[1:]) for m in POSE.finditer(text)}


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
