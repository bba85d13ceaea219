"""Stand-ins for models, which show what grades mean: `facts` must score 100 %, `wrong` 0 %, `garbage` nothing but
format errors. They know the answers, so they measure the graders and not themselves."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .facts import Answer, Fact
from .models import Model, Reply, Tool, Turn
from .order import Order
from .replies import METADATA


@dataclass(frozen=True)
class Key:
    """Data of a scenario that stand-ins use."""

    facts: tuple[Fact, ...]
    """Facts of the scenario."""
    order: Order
    """Order of the task's sub-goals."""
    priors: Mapping[str, Answer]
    """Best fixed answers in training, by question: what `blind` says."""


@dataclass(frozen=True)
class StandIn:
    """A stand-in that answers by the title of the schema."""

    key: Key

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """Answer with a whole artefact or plan; free text is not needed."""
        title = schema.get("title")
        told = self.understood() if title == "understanding" else self.planned() if title == "plan" else {}
        return Reply(json.dumps(told) if told else "See the plan below.")

    def understood(self) -> dict[str, Any]:
        """The artefact of stage 1 with the right answers."""
        known = {fact.id: fact.right for fact in self.key.facts if fact.right is not None}
        return artefact(known, [fact.id for fact in self.key.facts if fact.hidden])

    def planned(self) -> dict[str, Any]:
        """The plan of stage 2 in a right order."""
        return plan(self.key.order, self.key.order.required, self.key.facts)


class Wrong(StandIn):
    """A stand-in that is wrong about everything, in the right form."""

    def understood(self) -> dict[str, Any]:
        """Every answer wrong: another option, a number far off, and a claim about everything hidden."""
        return artefact({fact.id: _wrong(fact) for fact in self.key.facts}, [])

    def planned(self) -> dict[str, Any]:
        """The sub-goals in reverse order, without the first one."""
        return plan(self.key.order, tuple(reversed(self.key.order.required[1:])), self.key.facts)


class Blind(StandIn):
    """A stand-in that sees nothing, and knows which answer to each question is most often right in training."""

    def understood(self) -> dict[str, Any]:
        """The best fixed answers; what has none, or not among the options of this scenario, is unknown."""
        options = {fact.id: fact.options for fact in self.key.facts if not fact.hidden}
        known = {id_: answer for id_, answer in self.key.priors.items() if id_ in options}
        fits = {k: a for k, a in known.items() if not isinstance(a, tuple) or set(a) <= set(options[k])}
        return artefact(fits, [fact.id for fact in self.key.facts if fact.id not in fits])


class Silent(StandIn):
    """A stand-in that says nothing."""

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """An empty reply."""
        return Reply("")


class Garbage(StandIn):
    """A stand-in whose replies have no form."""

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """Text, JSON that is cut off, JSON of another form, an unknown question, or two artefacts."""
        right = json.dumps(self.understood())
        strange = json.dumps(
            {"episodic": [], "semantic": [], "unknown": [{"fact": "colour_of_the_sky", "sense": "look"}]}
        )
        return Reply(
            ("I see a robot.", right[: len(right) // 2], "[1, 2]", "null", strange, f"{right} {strange}")[seed % 6]
        )


STAND_INS: dict[str, Callable[[Key], Model]] = {
    "facts": StandIn,
    "wrong": Wrong,
    "blind": Blind,
    "silent": Silent,
    "garbage": Garbage,
}
"""Stand-ins by the name that `model=` has."""


def artefact(known: Mapping[str, Answer], unknown: Sequence[str]) -> dict[str, Any]:
    """An artefact of stage 1 that claims some answers, and lists other questions as unknown."""
    answers = {id_: list(told) if isinstance(told, tuple) else told for id_, told in known.items()}
    semantic = [
        {"fact": id_, "answer": answer, "evidence": [METADATA], "rank": rank}
        for rank, (id_, answer) in enumerate(answers.items(), 1)
    ]
    return {"episodic": [], "semantic": semantic, "unknown": [{"fact": id_, "sense": "by contact"} for id_ in unknown]}


def plan(order: Order, names: Sequence[str], facts: Sequence[Fact]) -> dict[str, Any]:
    """A plan of stage 2 with some sub-goals of the order, each with its own conditions."""
    reason = facts[-1].id
    steps = [
        {
            "subgoal": name,
            "outcome": order.subgoals[name].outcome,
            "objects": order.subgoals[name].objects,
            "before": order.subgoals[name].needs,
            "after": order.subgoals[name].gives,
            "constraint": reason,
        }
        for name in names
    ]
    audit = {"f1_prerequisites": True, "f2_order": True, "f3_probing": True}
    return {"why": {"constraint": reason, "reason": "see the constraint"}, "steps": steps, "audit": audit}


def _wrong(fact: Fact) -> Answer:
    """An answer that is wrong and has the right form."""
    if isinstance(fact.right, float):
        return fact.right + 10 * fact.within + 1.0
    right = fact.right if isinstance(fact.right, tuple) else ()
    others = [option for option in fact.options if option not in right]
    return (others[0],)
