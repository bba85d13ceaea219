"""The client of OpenAI-compatible endpoints: what it sends, and how it reads what endpoints answer.

The client is one HTTP post through the standard library. Providers' libraries would add tens of packages and hide what
is sent; retries, time limits and the journal are here anyway.
"""

import base64
import json
import re
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from email.utils import parsedate_to_datetime
from typing import Any

from ..errors import BadConfig, cut
from ..work.secrets import hidden, secret, shown
from .models import Call, ModelError, RefusedRequest, Reply, Tool, Turn
from .post import Broken, Refusal, check_address, post

TRIES = 5
"""Largest number of tries of a request that the server was too busy for, or whose answer was broken."""
LONGEST_WAIT = 60.0
"""Longest wait between two tries [s]."""
BUSY = (408, 409, 429, 500, 502, 503, 504, 529)
"""HTTP status codes after which a request is tried again."""
ONE_REQUEST = (400, 413, 422)
"""HTTP status codes that are about one request, and not about the key or the model."""
OPTIONAL = ("temperature", "seed", "response_format", "tool_choice")
"""Fields of a request that can be left out."""
LEFT_OUT = "left out of requests: "
"""Beginning of the note about a field that a request left out."""
MAX_TOKENS = 10**12
"""Largest number of tokens that is believed."""
_ENDS = {
    "length": "cut: the limit of tokens was reached (finish_reason = length)",
    "content_filter": "filtered: the endpoint withholds the answer (finish_reason = content_filter)",
}


@dataclass(frozen=True)
class Endpoint:
    """A model behind an OpenAI-compatible endpoint (`POST <url>/chat/completions`)."""

    name: str
    """Name of the model at that endpoint."""
    url: str
    """Address up to the version, such as `http://127.0.0.1:8000/v1`."""
    key: str = ""
    """Name of the environment variable that holds the key; empty for an endpoint without keys."""
    timeout: float = 600.0
    """Time limit of one request [s]."""
    omit: Sequence[str] = ()
    """Fields of `OPTIONAL` that requests leave out. Those that the endpoint refuses by name are found out."""
    _omitted: set[str] = field(default_factory=set, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_address("url", self.url)
        if odd := [name for name in self.omit if name not in OPTIONAL]:
            raise BadConfig(f"omit = {cut(str(odd[0]))}; known: {', '.join(OPTIONAL)}")
        secret("key", self.key)
        self._omitted.update(self.omit)

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """Ask the endpoint; a busy one is asked again, at most `TRIES` times.

        Raises:
            RefusedRequest: it refuses this request.
            ModelError: it cannot be reached, refuses every request, or its answer is not a completion.
        """
        began = time.monotonic()
        body = _body(self.name, turns, tools, schema, temperature, seed)
        answer, omitted = self._answer(body)
        try:
            found = reply_of(answer)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError):
            told = self._hidden(cut(json.dumps(answer)))
            raise ModelError(f"{shown(self.url)} answers no chat completion: {told}") from None
        notes = (*(f"{LEFT_OUT}{name}" for name in OPTIONAL if name in omitted & body.keys()), *found.notes)
        return Reply(
            found.text, found.calls, found.tokens_in, found.tokens_out, time.monotonic() - began, found.ended, notes
        )

    def _answer(self, body: Mapping[str, Any]) -> tuple[Any, set[str]]:
        """The answer, and the fields that were left out: more than before if the endpoint refuses some by name."""
        omitted = {*self._omitted}
        while True:
            try:
                answer = self._post({name: value for name, value in body.items() if name not in omitted})
            except Refusal as error:
                refused = _refused_fields(error, body.keys() - omitted)
                if not refused:
                    raise self._refusal(error) from None
                omitted.add(refused[0])
                continue
            self._omitted.update(omitted)
            return answer, omitted

    def _post(self, body: Mapping[str, Any]) -> Any:
        """The answer to a body, after as many tries as it needs.

        Raises:
            Refusal: the endpoint refuses the request.
            ModelError: it stays busy, or gives no whole answer.
        """
        wait, last = None, ModelError("")
        for tried in range(TRIES):
            if tried:
                time.sleep(_wait(wait, tried))
            wait = None
            try:
                answer = post(f"{self.url.rstrip('/')}/chat/completions", body, secret("key", self.key), self.timeout)
                if (error := _error_in(answer)) is None:
                    return answer
                raise error
            except Refusal as error:
                if error.status not in BUSY:
                    raise
                wait, last = error.wait, self._refusal(error)
            except Broken as error:
                last = ModelError(self._hidden(f"{shown(self.url)} {error}"))
        raise last

    def _refusal(self, error: Refusal) -> ModelError:
        """The error for a refused request, in one line."""
        kind = RefusedRequest if error.status in ONE_REQUEST else ModelError
        told = f"{error.status} {cut(self._hidden(error.text))}".strip()
        return kind(f"{shown(self.url)} refuses the request for {cut(self.name)}: {told}")

    def _hidden(self, text: str) -> str:
        return hidden(text, secret("key", self.key))


def _body(
    name: str, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
) -> dict[str, Any]:
    """The request as OpenAI's chat completions define it."""
    body: dict[str, Any] = {"model": name, "temperature": temperature, "seed": seed}
    body["messages"] = [{"role": turn.role, "content": _content(turn)} for turn in turns]
    if tools:
        body["tool_choice"] = "required"
        body["tools"] = [
            {"type": "function", "function": {"name": t.name, "description": t.about, "parameters": t.schema}}
            for t in tools
        ]
    elif schema:
        told = {"name": schema["title"], "schema": schema}
        body["response_format"] = {"type": "json_schema", "json_schema": told}
    return body


def _content(turn: Turn) -> str | list[dict[str, Any]]:
    """Content of a message: a text, or parts with pictures as data addresses."""
    if not turn.pictures:
        return turn.text
    pictures = (base64.b64encode(picture).decode() for picture in turn.pictures)
    parts = [{"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{p}"}} for p in pictures]
    return [{"type": "text", "text": turn.text}, *parts]


def _refused_fields(error: Refusal, fields: set[str]) -> list[str]:
    """The fields of a request that a refusal names."""
    if error.status not in ONE_REQUEST:
        return []
    return [name for name in OPTIONAL if name in fields and re.search(rf"(?<!\w){name}(?!\w)", error.text[:10_000])]


def _error_in(answer: Any) -> Refusal | None:
    """The refusal in an answer with the status of a success, as routers of several providers give it."""
    if not isinstance(answer, dict) or answer.get("choices") or not answer.get("error"):
        return None
    error = answer["error"]
    told, code = (error.get("message"), error.get("code")) if isinstance(error, dict) else (error, None)
    return Refusal(code if type(code) is int and 100 <= code < 1000 else 200, " ".join(str(told).split()), None)


def reply_of(answer: Any) -> Reply:
    """The reply in a completion.

    Raises:
        KeyError, IndexError, TypeError, ValueError, AttributeError: it is not a completion.
    """
    choice = answer["choices"][0]
    message, usage = choice["message"], answer.get("usage")
    text, refusal = _texts(message.get("content"))
    calls = [each["function"] for each in message.get("tool_calls") or ()]
    if not calls and message.get("function_call"):  # as until 2023
        calls = [message["function_call"]]
    found = tuple(Call(_clean(call["name"]), _arguments(call.get("arguments"))) for call in calls)
    refusal = _clean(message.get("refusal")) or refusal
    thought = _clean(message.get("reasoning_content") or message.get("reasoning"))
    counts = [tokens(_entry(usage, name)) for name in ("prompt_tokens", "completion_tokens")]
    notes = ("usage that is not a number of tokens is ignored",) if None in counts else ()
    ended = "" if found else _ended(choice.get("finish_reason"), text, refusal, thought)
    return Reply(text, found, counts[0] or 0, counts[1] or 0, 0.0, ended, notes)


def _ended(reason: Any, text: str, refusal: str, thought: str) -> str:
    """Why there is no whole answer; empty if there may be one."""
    if refusal:
        return f"refused: {cut(refusal)}"
    if isinstance(reason, str) and reason in _ENDS:
        return _ENDS[reason]
    return f"empty: there is only reasoning, of {len(thought)} letters" if thought and not text.strip() else ""


def _texts(content: Any) -> tuple[str, str]:
    """Text and refusal of a content: a text, or parts of which some are thoughts."""
    if not isinstance(content, list):
        return _clean(content), ""
    parts = [part if isinstance(part, dict) else {"type": "text", "text": part} for part in content]
    texts = [_clean(part.get("text")) for part in parts if part.get("type") in ("text", "output_text", None)]
    return "".join(texts), " ".join(_clean(part.get("refusal")) for part in parts if part.get("refusal"))


def _arguments(given: Any) -> str:
    """Arguments of a call as JSON; some endpoints give the object itself."""
    return json.dumps(given) if isinstance(given, (dict, list)) else _clean(given)


def _clean(text: Any) -> str:
    """A text without halves of characters, which no file can hold; empty for what is none."""
    return text.encode(errors="replace").decode() if isinstance(text, str) else ""


def _entry(usage: Any, name: str) -> Any:
    return usage.get(name) if isinstance(usage, dict) else usage


def tokens(given: Any) -> int | None:
    """A number of tokens; 0 if it is missing, None if it is not a number of tokens."""
    if given is None:
        return 0
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        return None
    return int(given) if 0 <= given <= MAX_TOKENS else None


def _wait(asked: str | None, tried: int) -> float:
    """Wait before the next try [s]: what the server requests, in seconds or until a date, else 1, 2, 4 s and so on."""
    seconds = 2.0 ** (tried - 1)
    if asked and re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", asked):
        seconds = float(asked)
    elif asked:
        with suppress(ValueError, OverflowError, TypeError):
            seconds = max(seconds, parsedate_to_datetime(asked[:100]).timestamp() - time.time())
    return min(seconds, LONGEST_WAIT)
