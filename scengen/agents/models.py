"""Models: anything that answers turns of text and pictures, and the client for OpenAI-compatible endpoints.

The client is one HTTP post through the standard library. Providers' libraries would add tens of packages and hide what
is sent; retries, time limits and the journal are here anyway.
"""

import base64
import json
import os
import time
import urllib.error
import urllib.request
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..errors import BadConfig, ScengenError, cut
from ..work.foreign import at_fault, factory_of

TRIES = 5
"""Largest number of tries of a request that the server was too busy for."""
LONGEST_WAIT = 60.0
"""Longest wait between two tries [s]."""
BUSY = (408, 409, 429, 500, 502, 503, 504)
"""HTTP status codes after which a request is tried again."""


class ModelError(ScengenError):
    """A model cannot be reached, or refuses a request."""


@dataclass(frozen=True)
class Turn:
    """One message of a conversation."""

    role: str
    """Speaker: `system`, `user` or `assistant`."""
    text: str
    """Text of the message."""
    pictures: tuple[bytes, ...] = ()
    """JPEG pictures after the text."""


@dataclass(frozen=True)
class Tool:
    """A function that a model may call."""

    name: str
    """Name of the function."""
    about: str
    """Description for the model."""
    schema: Mapping[str, Any]
    """JSON schema of the arguments."""


@dataclass(frozen=True)
class Call:
    """A call of a tool."""

    name: str
    """Name of the tool."""
    arguments: str
    """Arguments as the model wrote them: JSON if it follows the schema."""


@dataclass(frozen=True)
class Reply:
    """Answer of a model."""

    text: str
    """Text of the answer; may be empty if there are calls."""
    calls: tuple[Call, ...] = ()
    """Calls of tools."""
    tokens_in: int = 0
    """Number of tokens of the prompt, as the model counts them; 0 if it does not report it."""
    tokens_out: int = 0
    """Number of tokens of the answer, reasoning included."""
    seconds: float = field(default=0.0, compare=False)
    """Duration of the request [s]."""


class Model(Protocol):
    """The interface of a model: `module:factory` names a function without arguments that returns one."""

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """Answer a conversation.

        Args:
            turns: the conversation, oldest first.
            tools: functions of which the answer must call one; none if it must be JSON.
            schema: JSON schema of the answer; empty for free text and with tools.
            temperature: temperature of sampling.
            seed: seed of sampling, for models that have one.
        """
        ...


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

    def __post_init__(self) -> None:
        if not self.url.startswith(("http://", "https://")):
            raise BadConfig(f"url = {cut(self.url)}; expected an address such as http://127.0.0.1:8000/v1")
        if self.key and not os.environ.get(self.key):
            raise BadConfig(
                f"key = {cut(self.key)}; there is no such environment variable; set it to the endpoint's key"
            )

    def reply(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> Reply:
        """Ask the endpoint; a busy one is asked again, at most `TRIES` times.

        Raises:
            ModelError: it cannot be reached, refuses the request, or answers something other than a completion.
        """
        started = time.monotonic()
        answer = self._post(self._body(turns, tools, schema, temperature, seed))
        try:
            message, usage = answer["choices"][0]["message"], answer.get("usage") or {}
            calls = tuple(
                Call(str(c["function"]["name"]), str(c["function"]["arguments"]))
                for c in message.get("tool_calls") or ()
            )
            tokens = int(usage.get("prompt_tokens") or 0), int(usage.get("completion_tokens") or 0)
            return Reply(str(message.get("content") or ""), calls, *tokens, time.monotonic() - started)
        except (KeyError, IndexError, TypeError, ValueError, AttributeError):
            raise ModelError(f"{self.url} answers no chat completion: {cut(json.dumps(answer))}") from None

    def _body(
        self, turns: Sequence[Turn], tools: Sequence[Tool], schema: Mapping[str, Any], temperature: float, seed: int
    ) -> dict[str, Any]:
        """The request as OpenAI's chat completions define it."""
        body: dict[str, Any] = {"model": self.name, "temperature": temperature, "seed": seed}
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

    def _post(self, body: Mapping[str, Any]) -> Any:
        headers = {"Content-Type": "application/json"}
        if self.key:
            headers["Authorization"] = f"Bearer {os.environ[self.key]}"
        request = urllib.request.Request(
            f"{self.url.rstrip('/')}/chat/completions", json.dumps(body).encode(), headers, method="POST"
        )
        for tried in range(1, TRIES + 1):
            try:
                with urllib.request.urlopen(request, timeout=self.timeout) as answer:
                    return json.loads(answer.read())
            except urllib.error.HTTPError as error:
                why = f"{error.code} {cut(' '.join(error.read().decode(errors='replace').split()))}"
                if error.code not in BUSY or tried == TRIES:
                    raise ModelError(f"{self.url} refuses the request for {self.name}: {why}") from None
                time.sleep(_wait(error.headers.get("Retry-After"), tried))
            except ValueError:
                raise ModelError(f"{self.url} does not answer JSON; is it an OpenAI-compatible endpoint?") from None
            except OSError as error:
                if tried == TRIES:
                    raise ModelError(f"{self.url} cannot be reached: {cut(str(error))}") from None
                time.sleep(_wait(None, tried))
        raise AssertionError("unreachable")


def _content(turn: Turn) -> str | list[dict[str, Any]]:
    """Content of a message: a text, or parts with pictures as data addresses."""
    if not turn.pictures:
        return turn.text
    pictures = (base64.b64encode(picture).decode() for picture in turn.pictures)
    parts = [{"type": "image_url", "image_url": {"url": f"data:image/jpeg;base64,{p}"}} for p in pictures]
    return [{"type": "text", "text": turn.text}, *parts]


def _wait(asked: str | None, tried: int) -> float:
    """Wait before the next try [s]: the time that the server requests, else 1, 2, 4 s and so on."""
    seconds = float(asked) if asked and asked.replace(".", "", 1).isdigit() else 2.0 ** (tried - 1)
    return min(seconds, LONGEST_WAIT)


def made(name: str) -> Model:
    """The model that `module:factory` returns; the module is looked for on the path and in the working directory.

    Raises:
        BadConfig: there is no such factory.
        ForeignCode: it raises an error.
    """
    factory = factory_of("model", name)
    try:
        model: Any = factory()
    except ScengenError:
        raise
    except Exception as error:
        raise at_fault("model", name, "its factory fails", error) from error
    if not callable(getattr(model, "reply", None)):
        raise BadConfig(f"model = {cut(name)}; its factory returned {type(model).__name__}, which has no method reply")
    return model
