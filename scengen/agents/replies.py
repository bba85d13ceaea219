"""Replies under their JSON schemas: the required form of stages 1 and 2, and the faults of a reply."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeVar

from ..errors import ScengenError, cut
from ..work.typed import typed
from .facts import Fact
from .models import Reply

T = TypeVar("T")
METADATA = "metadata"
"""Name of the evidence that is not a frame: instruction, robot, controller and readings."""
LISTS = ("answer", "evidence", "objects", "before", "after")
"""Entries of replies that are lists of words."""
MAX_OBJECTS = 100
"""Largest number of places in a reply at which a JSON object is looked for."""
FENCE = "```"
KINDS = ("refused", "cut", "filtered", "empty", "not JSON")
"""Kinds of replies that cannot be read, the first words of their faults."""
OTHER = "other"
"""Name of a step that is none of the sub-goals in the vocabulary."""


class FormatError(ScengenError):
    """A reply does not follow its schema."""


@dataclass(frozen=True)
class Seen:
    """Description of one frame."""

    frame: str
    """Name of the frame."""
    seen: str
    """Description as text."""


@dataclass(frozen=True)
class Claim:
    """An answer that the model claims to know."""

    fact: str
    """Id of the question."""
    answer: float | list[str]
    """A number, or the options that hold."""
    evidence: list[str]
    """Names of the frames that show it, or `metadata`."""
    rank: int
    """Importance for success: 1 is the most important."""


@dataclass(frozen=True)
class Unknown:
    """A question that the model does not claim to know."""

    fact: str
    """Id of the question."""
    sense: str
    """Way to find the answer."""


@dataclass(frozen=True)
class Understanding:
    """The artefact of stage 1 (paper, App. F): what was seen, what is known, and what must be sensed."""

    episodic: list[Seen]
    semantic: list[Claim]
    unknown: list[Unknown]

    def faults(self, facts: Sequence[Fact], frames: Sequence[str]) -> list[str]:
        """Faults that show without the answers: they make the stage be repeated."""
        told = {claim.fact for claim in self.semantic} | {each.fact for each in self.unknown}
        found = [
            f"the question {fact.id} is neither answered nor listed as unknown" for fact in facts if fact.id not in told
        ]
        known = {*frames, METADATA}
        for claim in self.semantic:
            if not claim.evidence or not known.issuperset(claim.evidence):
                found.append(f"{claim.fact} has no evidence that is one of the frames or {METADATA}")
        return found


@dataclass(frozen=True)
class Why:
    """Reason why the simplest action fails."""

    constraint: str
    """Id of the question of stage 1 whose answer is the reason."""
    reason: str
    """Reason as text."""


@dataclass(frozen=True)
class Step:
    """One sub-goal of a plan."""

    subgoal: str
    """Name in the vocabulary, or `other`."""
    outcome: str
    """Physical outcome as text."""
    objects: list[str]
    """Names of the objects."""
    before: list[str]
    """Conditions that must hold before."""
    after: list[str]
    """Conditions that hold after it."""
    constraint: str
    """Id of the question of stage 1 whose answer makes it necessary."""


@dataclass(frozen=True)
class Audit:
    """The model's own audit of its plan (paper, App. F)."""

    f1_prerequisites: bool
    """Whether all prerequisites are in the plan."""
    f2_order: bool
    """Whether no order is invalid."""
    f3_probing: bool
    """Whether no step that brings information was dropped."""


@dataclass(frozen=True)
class Planned:
    """The plan of stage 2."""

    why: Why
    steps: list[Step]
    audit: Audit

    def faults(self, artefact: Understanding) -> list[str]:
        """Faults that show without the answers: the artefact binds, and the model's own audit must pass."""
        ids = {claim.fact for claim in artefact.semantic} | {each.fact for each in artefact.unknown}
        found = [] if self.steps else ["the plan has no step"]
        for name in [self.why.constraint, *(step.constraint for step in self.steps)]:
            if name not in ids:
                found.append(f"{cut(name)} is not a constraint of the artefact")
        return found + [f"your audit {name} failed" for name, passed in vars(self.audit).items() if not passed]


def read_json(text: str, strict: bool = True) -> Any:
    """The JSON value of a reply. A code fence around it is allowed.

    Args:
        strict: whether nothing else is; otherwise thoughts before it are, and words around one JSON object.

    Raises:
        FormatError: it is not JSON.
    """
    text = text if strict else without_thoughts(text)
    if not text.strip():
        raise FormatError("empty: the reply has no text")
    whole = text.strip()
    fenced = len(whole) >= 6 and whole.startswith(FENCE) and whole.endswith(FENCE)
    try:
        return json.loads(whole[3:-3].removeprefix("json") if fenced else whole)
    except (ValueError, RecursionError) as error:
        found = [] if strict else _objects(text)
        if len(found) == 1:
            return found[0]
        why = f"it has {len(found)} objects; give one" if found else cut(str(error))
        raise FormatError(f"not JSON: {why}") from None


def without_thoughts(text: str) -> str:
    """A reply without the thoughts before it, of which some endpoints leave out the first tag."""
    return text.rpartition("</think>")[2]


def _objects(text: str) -> list[dict[str, Any]]:
    """The different JSON objects among the words of a reply; those in code fences if there are any."""
    fences = text.split(FENCE)[1::2]
    found = [value for part in (fences or [text])[:MAX_OBJECTS] for value in _objects_in(part)]
    return [value for number, value in enumerate(found) if value not in found[:number]]


def _objects_in(text: str) -> Iterator[dict[str, Any]]:
    """JSON objects in a text, from left to right, until one is cut short. Other braces are passed over."""
    at, decoder = text.find("{"), json.JSONDecoder()
    for _ in range(MAX_OBJECTS):
        if at < 0:
            return
        try:
            value, end = decoder.raw_decode(text, at)
        except json.JSONDecodeError as error:
            if error.pos >= len(text.rstrip()) or error.msg.startswith("Unterminated"):
                return
            value, end = {}, at + 1
        except (ValueError, RecursionError):
            return
        if value:
            yield value
        at = text.find("{", end)


def kind_of(fault: str) -> str:
    """Kind of a fault of form, see `KINDS`; `form` for a reply in JSON."""
    return next((kind for kind in KINDS if fault.startswith(f"{kind}:")), "form")


def understanding(reply: Reply, facts: Sequence[Fact], strict: bool = True) -> Understanding:
    """Read the artefact of stage 1.

    Raises:
        FormatError: it does not follow the schema, answers a question twice, or names what is not a question or option.
    """
    found = _filled(Understanding, reply, strict, {fact.id: fact for fact in facts})
    known, told = {fact.id: fact for fact in facts}, [each.fact for each in (*found.semantic, *found.unknown)]
    for name in told:
        if name not in known:
            raise FormatError(f"{cut(repr(name))} is not a question; known: {', '.join(known)}")
        if told.count(name) > 1:
            raise FormatError(f"the question {name} is answered {told.count(name)} times")
    for claim in found.semantic:
        fact = known[claim.fact]
        if isinstance(claim.answer, list) != bool(fact.options):
            raise FormatError(f"the answer to {fact.id} must be {'a list of options' if fact.options else 'a number'}")
        if isinstance(claim.answer, list) and (odd := [name for name in claim.answer if name not in fact.options]):
            raise FormatError(f"{cut(repr(odd[0]))} is not an option of {fact.id}")
    return found


def plan(reply: Reply, vocabulary: Mapping[str, str], strict: bool = True) -> Planned:
    """Read the plan of stage 2.

    Raises:
        FormatError: it does not follow the schema, or names a sub-goal that is not in the vocabulary.
    """
    found = _filled(Planned, reply, strict, {})
    for step in found.steps:
        if step.subgoal not in (*vocabulary, OTHER):
            raise FormatError(f"{cut(repr(step.subgoal))} is not a sub-goal; known: {', '.join((*vocabulary, OTHER))}")
    return found


def _filled(cls: type[T], reply: Reply, strict: bool, facts: Mapping[str, Fact]) -> T:
    try:
        plain = read_json(reply.text, strict)
    except FormatError as error:
        raise FormatError(reply.ended or str(error)) from None
    if not isinstance(plain, dict):
        raise FormatError("the reply is not a JSON object")
    try:
        return typed("", cls, plain if strict else _with_lists(plain, facts), exact=True)
    except FormatError:
        raise
    except (ScengenError, RecursionError) as error:
        raise FormatError(str(error)) from None


def _with_lists(plain: Mapping[str, Any], facts: Mapping[str, Fact]) -> dict[str, Any]:
    """A reply with brackets around single words where lists are expected, and without them around a single number."""
    found = dict(plain)
    for group in ("semantic", "steps"):
        if isinstance(entries := found.get(group), list):
            found[group] = [_entry(each, facts) if isinstance(each, dict) else each for each in entries]
    return found


def _entry(entry: Mapping[str, Any], facts: Mapping[str, Fact]) -> dict[str, Any]:
    lists: dict[str, Any] = {name: [entry[name]] for name in LISTS if isinstance(entry.get(name), str)}
    name, answer = entry.get("fact"), entry.get("answer")
    if isinstance(name, str) and name in facts and not facts[name].options:
        lists.pop("answer", None)
        single: Any = answer[0] if isinstance(answer, list) and len(answer) == 1 else answer
        with suppress(ValueError, TypeError):
            lists["answer"] = single if isinstance(single, float | int) else float(single)
    return {**entry, **lists}


def understanding_schema(facts: Sequence[Fact], frames: Sequence[str]) -> dict[str, Any]:
    """JSON schema of the artefact of stage 1."""
    ids, evidence = [fact.id for fact in facts], [*frames, METADATA]
    options = sorted({option for fact in facts for option in fact.options})
    answer = {"anyOf": [{"type": "number"}, _list({"enum": options})]}
    claim = _object(
        fact={"enum": ids}, answer=answer, evidence=_list({"enum": evidence}), rank={"type": "integer", "minimum": 1}
    )
    return _object(
        "understanding",
        episodic=_list(_object(frame={"enum": list(frames)} if frames else TEXT, seen=TEXT)),
        semantic=_list(claim),
        unknown=_list(_object(fact={"enum": ids}, sense=TEXT)),
    )


def plan_schema(
    vocabulary: Mapping[str, str], objects: Sequence[str], conditions: Sequence[str], ids: Sequence[str]
) -> dict[str, Any]:
    """JSON schema of the plan of stage 2. Objects are free text: a plan may name one that does not exist."""
    condition, constraint = _list({"enum": list(conditions)}), {"enum": list(ids)}
    step = _object(
        subgoal={"enum": [*vocabulary, OTHER]},
        outcome=TEXT,
        objects=_list({"type": "string", "examples": list(objects)}),
        before=condition,
        after=condition,
        constraint=constraint,
    )
    passed = {"type": "boolean"}
    return _object(
        "plan",
        why=_object(constraint=constraint, reason=TEXT),
        steps=_list(step),
        audit=_object(f1_prerequisites=passed, f2_order=passed, f3_probing=passed),
    )


TEXT = {"type": "string"}
"""Schema of a free text."""


def _list(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _object(title: str = "", **properties: Mapping[str, Any]) -> dict[str, Any]:
    named = {"title": title} if title else {}
    closed = {"required": list(properties), "additionalProperties": False}
    return {**named, "type": "object", "properties": properties, **closed}
