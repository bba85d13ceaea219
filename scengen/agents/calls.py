"""The journal of calls: each call of a model is a line of `calls.jsonl`, so that nothing is asked twice."""

import hashlib
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..errors import BadConfig, ScengenError, cut
from ..work.log import Log
from ..work.plain import MAX_JOURNAL, read_plain
from ..work.targets import write
from ..work.typed import typed
from .endpoint import tokens
from .models import Model, Reply, Tool, Turn
from .prices import Prices

CALLS = "calls.jsonl"
"""Name of the journal in the folder of a run."""
TOKENS_PER_PICTURE = 450
"""Tokens that an estimate counts for a picture: the paper's frame batch of four pictures has about 1800 (App. F)."""
LETTERS_PER_TOKEN = 4
"""Letters of English text that an estimate counts as one token."""
ANSWER_TOKENS = 1200
"""Tokens that an estimate counts for an answer: twice those of a complete artefact, for some reasoning."""


class OutOfBudget(ScengenError):
    """The next call would exceed the budget."""


@dataclass(frozen=True)
class Budget:
    """Limits of one run of the command; calls that the journal answers are free."""

    calls: int | None = None
    """Largest number of calls; no limit by default."""
    tokens: float | None = None
    """Largest number of tokens of prompts and answers; no limit by default."""

    def check(self) -> None:
        """Raise `BadConfig` if a limit is none."""
        for name, limit in vars(self).items():
            if limit is not None and not 0 <= limit < float("inf"):
                raise BadConfig(f"budget.{name} = {limit:g}; it must be a number from 0 on")


class Calls:
    """Asks a model through the journal: what was asked before is answered from there."""

    def __init__(
        self, log: Log, model: Model | None, budget: Budget, prices: Prices | None = None, strict: bool = False
    ):
        """
        Args:
            log: the open journal.
            model: the model; None if only recorded answers count.
            budget: limits of new calls.
            prices: prices of the model; None if they are not known.
            strict: whether replies must have the asked form exactly, see `replies.read_json`.

        Raises:
            BadConfig: the journal contains other things than calls.
        """
        self.log, self.model, self.budget, self.prices, self.strict = log, model, budget, prices, strict
        self.new, self.tokens, self.cost = 0, 0, 0.0
        self.notes = Counter[str]()
        """What tables should say about requests, and of how many it is true."""
        self._counted = 0  # tokens that count for the budget
        self._recorded = {record["digest"]: record for record in _checked(log.records, log.path)}

    def recall(self, path: Path) -> None:
        """Answer from the journal of another run as well.

        Raises:
            BadConfig: the file cannot be read, or is not a journal.
        """
        self._recorded = {record["digest"]: record for record in read_calls(path)} | self._recorded

    def ask(
        self,
        about: Mapping[str, Any],
        turns: Sequence[Turn],
        tools: Sequence[Tool] = (),
        schema: Mapping[str, Any] | None = None,
        temperature: float = 0.0,
        model: Model | None = None,
    ) -> Reply:
        """The answer to a conversation, from the journal or from the model.

        Args:
            about: names of what is asked: scenario, stage, attempt and so on. Calls that differ in it are different.
            turns: the conversation.
            tools: functions of which the answer must call one.
            schema: JSON schema of the answer.
            temperature: temperature of sampling.
            model: stand-in that knows the answers; by default the run's model.

        Raises:
            OutOfBudget: the budget does not allow another call, or only recorded answers are allowed and this call has
                none.
        """
        prompt = [{"role": t.role, "text": t.text, "pictures": [_sha(p)[:16] for p in t.pictures]} for t in turns]
        asked = {"about": dict(about), "turns": prompt, "tools": [t.name for t in tools], "temperature": temperature}
        digest = _sha(json.dumps([asked, schema], sort_keys=True).encode())[:32]
        if (record := self._recorded.get(digest)) is None:
            record = self._add(digest, asked, turns, tools, schema or {}, temperature, model or self.model)
        reply = _reply(record["reply"])
        self.notes.update(reply.notes)
        return reply

    def _add(
        self,
        digest: str,
        asked: Mapping[str, Any],
        turns: Sequence[Turn],
        tools: Sequence[Tool],
        schema: Mapping[str, Any],
        temperature: float,
        model: Model | None,
    ) -> dict[str, Any]:
        """Ask the model and record the answer before anything is done with it."""
        if model is None:
            raise OutOfBudget("the journal has no answer to this call, and no model is asked")
        if self.budget.calls is not None and self.new >= self.budget.calls:
            raise OutOfBudget(f"budget.calls = {self.budget.calls} is used up; repeat the command with a larger one")
        if self.budget.tokens is not None and self._counted >= self.budget.tokens:
            raise OutOfBudget(
                f"budget.tokens = {self.budget.tokens:g} is used up; repeat the command with a larger one"
            )
        if self.prices and self.prices.most is not None and self.cost >= self.prices.most:
            raise OutOfBudget(f"max_cost = {self.prices.most:g} is used up; repeat the command with a larger one")
        for turn in turns:
            for picture in turn.pictures:
                path = picture_path(self.log.path.parent, _sha(picture)[:16])
                if not path.exists():
                    write(path, picture)
        reply = model.reply(turns, tools, schema, temperature, int(digest[:7], 16))
        if not isinstance(reply, Reply):
            raise BadConfig(
                f"the model's method reply returned {type(reply).__name__}; expected scengen.agents.models.Reply"
            )
        told = (tokens(reply.tokens_in) or 0, tokens(reply.tokens_out) or 0)
        reply = replace(reply, tokens_in=told[0], tokens_out=told[1])
        record = {"digest": digest, **asked, "reply": asdict(reply)}
        self.log.add(record)
        self._recorded[digest] = record
        self._count(told, estimate(turns) if model is self.model else (0, 0))
        return record

    def _count(self, told: tuple[int, int], estimated: tuple[int, int]) -> None:
        """Count a call. Missing token counts are estimated, so that a call does not pass a limit unseen."""
        self.new, self.tokens = self.new + 1, self.tokens + sum(told)
        counted = told if all(told) else estimated
        self._counted += sum(counted)
        self.cost += self.prices.of(counted) if self.prices else 0.0


def read_calls(path: Path) -> list[dict[str, Any]]:
    """The calls in a journal.

    Raises:
        BadConfig: the file cannot be read, or is not a journal.
    """
    try:
        _, *lines = read_plain(path, MAX_JOURNAL).decode().splitlines()
        return _checked([json.loads(line) for line in lines], path)
    except (OSError, ValueError, RecursionError) as error:
        raise BadConfig(
            f"{cut(str(path))} is not a journal of calls ({cut(str(error))}); name the {CALLS} of a run"
        ) from None


def _checked(records: Sequence[Any], path: Path) -> list[dict[str, Any]]:
    """Records of a journal, all of which must be calls: anyone may have written it."""
    return [_record(record, f"{cut(str(path))}, line {number}") for number, record in enumerate(records, 2)]


def _record(record: Any, where: str) -> dict[str, Any]:
    try:
        _ = [record["about"][name] + "" for name in ("task", "split", "scenario")]
        _ = [record["about"][name] + 0 for name in ("temperature", "stage")]
        for turn in record["turns"]:
            _ = "".join((turn["role"], turn["text"], *turn["pictures"]))
        return {**record, "digest": record["digest"] + "", "reply": asdict(_reply(record["reply"]))}
    except (KeyError, TypeError, ValueError, AttributeError, ScengenError):
        raise BadConfig(f"{where}, is not a call; name the {CALLS} of a run") from None


def _reply(plain: Mapping[str, Any]) -> Reply:
    """The reply in a record. Numbers of tokens and seconds that are none count as 0."""
    counts = {name: tokens(plain.get(name)) or 0 for name in ("tokens_in", "tokens_out")}
    waited = plain.get("seconds")
    seconds = waited if isinstance(waited, (int, float)) and 0.0 <= waited < 1e9 else 0.0
    return typed("", Reply, {**plain, **counts, "seconds": float(seconds)})


def picture_path(folder: Path, name: str) -> Path:
    """File of a picture that a prompt held."""
    return folder / "pictures" / f"{name}.jpg"


def estimate(turns: Sequence[Turn]) -> tuple[int, int]:
    """Estimated tokens of a prompt and of its answer."""
    letters = sum(len(turn.text) for turn in turns)
    pictures = sum(len(turn.pictures) for turn in turns)
    return letters // LETTERS_PER_TOKEN + TOKENS_PER_PICTURE * pictures, ANSWER_TOKENS


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
