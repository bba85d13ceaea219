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
