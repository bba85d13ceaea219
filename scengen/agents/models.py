"""Models: anything that answers turns of text and pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from ..errors import BadConfig, ScengenError, cut
from ..work.foreign import at_fault, factory_of


class ModelError(ScengenError):
    """A model cannot be reached, or refuses every request."""


class RefusedRequest(ModelError):
    """A model refuses one request, and may answer others."""


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
    ended: str = ""
    """Why there is no whole answer, as `KIND: reason` with refused, cut, filtered or empty; empty if there is one."""
    notes: tuple[str, ...] = field(default=(), compare=False)
    """What a table should say about the request, such as a field that was left out."""


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
