"""The journal of calls: each call of a model is a line of `calls.jsonl`, so that nothing is asked twice."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import BadConfig, ScengenError
from ..work.log import Log
from ..work.targets import write
from .models import Call, Model, Reply, Tool, Turn

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


class Calls:
    """Asks a model through the journal: what was asked before is answered from there."""

    def __init__(self, log: Log, model: Model | None, budget: Budget):
        """
        Args:
            log: the open journal.
            model: the model; None if only recorded answers count.
            budget: limits of new calls.
        """
        self.log, self.model, self.budget = log, model, budget
        self.new, self.tokens = 0, 0
        self._recorded = {record["digest"]: record for record in log.records}

    def recall(self, path: Path) -> None:
        """Answer from the journal of another run as well.

        Raises:
            BadConfig: the file cannot be read, or is not a journal.
        """
        try:
            _, *lines = path.read_text().splitlines()
            found = [json.loads(line) for line in lines]
            self._recorded = {record["digest"]: record for record in found} | self._recorded
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise BadConfig(f"{path} is not a journal of calls ({error}); name the {CALLS} of a run") from None

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
        told = record["reply"]
        calls = tuple(Call(**call) for call in told["calls"])
        return Reply(told["text"], calls, told["tokens_in"], told["tokens_out"], told["seconds"])

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
        if self.budget.tokens is not None and self.tokens >= self.budget.tokens:
            raise OutOfBudget(
                f"budget.tokens = {self.budget.tokens:g} is used up; repeat the command with a larger one"
            )
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
        record = {"digest": digest, **asked, "reply": asdict(reply)}
        self.log.add(record)
        self._recorded[digest] = record
        self.new += 1
        self.tokens += reply.tokens_in + reply.tokens_out
        return record


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
