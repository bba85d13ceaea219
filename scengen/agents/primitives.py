"""The paper's eight motor primitives (App. F) as typed tools, compiled to plans of the arm's own moves.

Their actions pass the same filter and controller as those of every policy. Each primitive returns what was reached and
why it stopped.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..assets.prop import TABLE_TOP
from ..control.loop import Loop
from ..errors import GaveUp, ScengenError, cut
from ..geometry import Mat3, Vec3
from ..robots.panda import BASE, REACH, SHOULDER, bases
from ..scenario import Action, Plan
from ..sim.arm import Arm
from ..sim.world import World
from ..skills.motion import CLOSED, OPEN, Pace, alone, go_to, hold
from .models import Call, Reply, Tool
from .replies import FormatError, read_json

SPEED = 0.25  # speed of the hand in a move [m/s]
WITHIN = 0.005
"""Distance from the target at which a move has arrived [m] (paper, App. F: "position < 5 mm")."""
GRIP_SECONDS = 0.8
"""Duration of opening and closing [s]: the jaw of the Panda needs 0.5 s for its whole stroke."""
MAX_TICKS = 1000
"""Largest number of control periods of one primitive, 10 s."""
LOWEST = TABLE_TOP - 0.30
"""Lowest target of the hand [m]: below the table's top, beside it."""
DONE = "Done"


class BadCall(ScengenError):
    """A call of a tool that cannot be carried out; the model is told why."""


def tools(arms: int) -> tuple[Tool, ...]:
    """The eight primitives as tools, for one arm or several."""
    which = {"arm": {"type": "integer", "minimum": 0, "maximum": arms - 1}} if arms > 1 else {}
    number, ticks = {"type": "number"}, {"type": "integer", "minimum": 1, "maximum": MAX_TICKS}
    why = {"reasoning": {"type": "string"}}

    def tool(name: str, about: str, optional: tuple[str, ...] = (), **properties: Mapping[str, Any]) -> Tool:
        every = {**which, **properties, **why}
        required = [each for each in every if each not in optional]
        schema = {"type": "object", "properties": every, "required": required, "additionalProperties": False}
        return Tool(name, about, schema)

    def vector(size: int) -> dict[str, Any]:
        return {"type": "array", "items": number, "minItems": size, "maxItems": size}

    return (
        tool(
            "MoveEEF",
            "Move the hand in a straight line to a position [m], and turn it to an orientation (quaternion xyzw) if "
            "one is given. Ends within 5 mm and 5 deg, or after a number of ticks of 10 ms.",
            ("quat", "ticks"),
            pos=vector(3),
            quat=vector(4),
            ticks=ticks,
        ),
        tool("Lift", "Move the hand up by a height [m], or down by a negative one.", dz=number),
        tool("Descend", "Move the hand to a height z [m]; x and y stay.", z=number),
        tool("OpenGripper", "Open the jaw, or switch the suction off."),
        tool("CloseGripper", "Close the jaw, or switch the suction on."),
        tool("AtomicAction", "Send one raw action for a number of ticks.", action=vector(7), ticks=ticks),
        tool("Hold", "Stay in place for a number of ticks.", ticks=ticks),
        tool(DONE, "The task is finished, or cannot be finished.", reason={"type": "string"}),
    )


@dataclass(frozen=True)
class Primitive:
    """A call that can be carried out."""

    name: str
    """Name of the primitive."""
    told: str
    """The call in words, for the memory of the model."""
    plan: Callable[[], Plan]
    """Function that starts its plan of the whole robot."""


def called(reply: Reply, every: Sequence[Tool], strict: bool = True) -> Call:
    """The call in a reply. An endpoint that cannot read calls of its model leaves them in the text, as JSON.

    Raises:
        BadCall: there is none, or more than one.
    """
    found = reply.calls if reply.calls or strict else _written(reply.text)
    if len(found) != 1:
        raise BadCall(reply.ended or f"{len(found)} tools were called; call one")
    name = found[0].name
    return found[0] if strict else Call(name.removeprefix("functions."), found[0].arguments)


def _written(text: str) -> tuple[Call, ...]:
    """The call in a text such as `{"name": "Hold", "arguments": {"ticks": 5}}`; none if it is something else."""
    try:
        told = read_json(text, strict=False)
        name, given = told["name"], told.get("arguments", told.get("parameters"))
    except (FormatError, KeyError, TypeError, AttributeError):
        return ()
    return (Call(str(name), given if isinstance(given, str) else json.dumps(given)),)


def _arguments(call: Call, strict: bool) -> Any:
    """The arguments of a call as data. Some endpoints write them as JSON twice, or leave a tag behind them."""
    given = read_json(call.arguments or "{}", strict)
    given = read_json(given, strict) if isinstance(given, str) and not strict else given
    return {} if given is None else given


def primitive(call: Call, world: World, strict: bool = True) -> Primitive:
    """The primitive of a call.

    Raises:
        BadCall: there is no such tool, an argument is missing or unknown, or a target is out of the workspace.
    """
    found = {tool.name: tool for tool in tools(len(world.arms))}
    if call.name not in found:
        raise BadCall(f"there is no tool {cut(repr(call.name))}; tools: {', '.join(found)}")
    try:
        given = _arguments(call, strict)
    except FormatError:
        raise BadCall(f"the arguments of {call.name} are not JSON") from None
    if not isinstance(given, dict):
        raise BadCall(f"the arguments of {call.name} are not a JSON object")
    schema = found[call.name].schema
    if missing := [name for name in schema["required"] if name not in given and name != "reasoning"]:
        raise BadCall(f"{call.name} lacks {', '.join(missing)}")
    if odd := [name for name in given if name not in schema["properties"]]:
        raise BadCall(f"{call.name} has no argument {cut(repr(odd[0]))}")
    arm = world.arms[_whole(given, "arm", 0, len(world.arms) - 1)]
    shown = ", ".join(f"{name}={json.dumps(value)}" for name, value in given.items() if name != "reasoning")
    plan = _plan(call.name, given, arm)
    return Primitive(call.name, f"{call.name}({shown})", (lambda: alone(arm, plan())) if len(world.arms) > 1 else plan)


def _plan(name: str, given: Mapping[str, Any], arm: Arm) -> Callable[[], Plan]:
    """Function that starts the plan of one arm. All arguments are read and checked at once."""
    here = arm.hand
    if name == "MoveEEF":
        pos, rot = _vector(given, "pos", 3), _rotation(given) if "quat" in given else None
        pace = Pace(SPEED, WITHIN, Loop.PERIOD * _whole(given, "ticks", 1, MAX_TICKS, 600))
        _check_reach(arm, pos)
        return lambda: go_to(arm, pos, rot, pace)
    if name in ("Lift", "Descend"):
        height = here[2] + _number(given, "dz") if name == "Lift" else _number(given, "z")
        goal = np.array([here[0], here[1], height])
        _check_reach(arm, goal)
        return lambda: go_to(arm, goal, None, Pace(SPEED, WITHIN))
    if name in ("OpenGripper", "CloseGripper"):
        return lambda: hold(arm, GRIP_SECONDS, OPEN if name == "OpenGripper" else CLOSED)
    if name == "AtomicAction":
        action, ticks = _vector(given, "action", 7), _whole(given, "ticks", 1, MAX_TICKS)
        if np.abs(action).max() > 1.0:
            raise BadCall(f"action = {action.tolist()}; each number must lie in [-1, 1]")
        return lambda: (action for _ in range(ticks))
    if name == "Hold":
        seconds = Loop.PERIOD * _whole(given, "ticks", 1, MAX_TICKS)
        return lambda: hold(arm, seconds)
    return lambda: (action for action in ())


def _check_reach(arm: Arm, pos: Vec3) -> None:
    """Raise `BadCall` for a target that no posture reaches."""
    shoulder = SHOULDER + bases(len(arm.world.arms))[arm.number] - BASE
    away = float(np.linalg.norm(pos - shoulder))
    if away > REACH:
        raise BadCall(f"pos = {pos.tolist()} is {away:.2f} m from the shoulder; the arm reaches {REACH:.2f} m")
    if pos[2] < LOWEST:
        raise BadCall(f"z = {pos[2]:.3f}; it must be at least {LOWEST:.2f} m")


def _vector(given: Mapping[str, Any], name: str, size: int) -> Vec3:
    value = given.get(name)
    if not (isinstance(value, list) and len(value) == size and all(_is_number(each) for each in value)):
        raise BadCall(f"{name} = {cut(repr(value))}; expected {size} finite numbers")
    return np.array(value, float)


def _rotation(given: Mapping[str, Any]) -> Mat3:
    """Orientation of a quaternion xyzw, which need not have the length 1."""
    quat = _vector(given, "quat", 4)
    if (length := float(np.linalg.norm(quat))) < 1e-6:
        raise BadCall("quat has the length 0")
    mat = np.empty(9)
    mujoco.mju_quat2Mat(mat, quat[[3, 0, 1, 2]] / length)
    return mat.reshape(3, 3)


def _number(given: Mapping[str, Any], name: str) -> float:
    if not _is_number(given.get(name)):
        raise BadCall(f"{name} = {cut(repr(given.get(name)))}; expected a finite number")
    return float(given[name])


def _whole(given: Mapping[str, Any], name: str, low: int, high: int, default: int = 0) -> int:
    value = given.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        raise BadCall(f"{name} = {cut(repr(value))}; expected a whole number from {low} to {high}")
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def next_action(plan: Plan) -> tuple[Action | None, str]:
    """The next action of a plan; None with the reason if it has ended."""
    try:
        return next(plan), ""
    except StopIteration:
        return None, "finished"
    except GaveUp as error:
        return None, str(error)
