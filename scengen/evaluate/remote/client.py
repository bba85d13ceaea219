"""Files that name observations and actions for a policy server: conf/clients/*.yaml, or your own file."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ...envs.gym import action_repeat_at
from ...envs.observations import requested
from ...errors import BadConfig, UnknownName, cut
from ...samplers.task_files import conf_dir
from ...work.plain import read_yaml
from ...work.secrets import secret, shown
from ...work.typed import typed

PROTOCOLS = {"ws": "openpi", "wss": "openpi", "zmq": "gr00t"}
"""Names of the protocols, and of their files in conf/clients, by the scheme of an address."""
INSTRUCTION = "instruction"
"""Name of the instruction of the running scenario among the observations of a file."""
"""Name of all streams of the robot's own pose among the observations of a file."""


@dataclass(frozen=True)
class Address:
    """Address of a policy server: `ws://HOST:PORT`, `wss://HOST:PORT` or `zmq://HOST:PORT`."""

    scheme: str
    """Scheme: `ws`, `wss` or `zmq`."""
    host: str
    """Name or number of the host."""
    port: int
    """Port."""

    def __str__(self) -> str:
        return f"{self.scheme}://{self.location}"

    @property
    def location(self) -> str:
        """Host and port, as in an address."""
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def is_address(policy: str) -> bool:
    """Whether the name of a policy is meant as an address of a server."""
    return "://" in policy


def address_of(policy: str) -> Address:
    """The address in the name of a policy.

    Raises:
        BadConfig: it is not one that is accepted.
    """
    accepted = "; it must be ws://HOST:PORT or wss://HOST:PORT (openpi), or zmq://HOST:PORT (GR00T)"
    try:
        parts = urlsplit(policy)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port, parts = None, None, urlsplit("")
    whole = not (parts.username or parts.password or parts.query or parts.fragment or parts.path.strip("/"))
    if parts.scheme not in PROTOCOLS or not host or not port or not whole:
        raise BadConfig(f"policy = {shown(policy)}{accepted}")
    return Address(parts.scheme, host, port)


@dataclass(frozen=True)
class ClientSettings:
    """A file of conf/clients: how a policy server names observations and actions, and how long to wait for it."""

    rate: float
    """Actions of the policy in a second [Hz]; each is held for `repeat` control periods."""
    execute: int
    """Number of actions of a chunk that are executed before the next request."""
    timeout: float
    """Longest wait for a reply [s]."""
    connect: float
    """Longest wait for the server to accept a connection [s]."""
    reconnects: int
    """Number of times that a request is repeated on a new connection."""
    observation: Mapping[str, list[str]]
    """Streams and cameras that are joined into an entry of the request, by the name of the entry."""
    action: list[str]
    """Entries of the reply that are joined, along their last axis, into an action of the environment."""
    key: str = ""
    """Name of the environment variable that holds the server's key; empty for a server without keys."""
    headers: Mapping[str, str] = field(default_factory=dict)
    """Further headers of a websocket: names of the environment variables that hold their values."""
    file: str = field(default="", compare=False)
    """Path of the file."""

    @property
    def repeat(self) -> int:
        """Control periods for which an action is held."""
        return action_repeat_at(self.rate, f"{self.file}: rate")

    def streams(self, embodiment: str) -> tuple[str, ...]:
        """Names of the streams and cameras of all entries for a robot."""
        every = [name for entry in self.observation for name in self.parts(entry, embodiment)]
        return tuple(dict.fromkeys(name for name in every if name != INSTRUCTION))

    def parts(self, entry: str, embodiment: str) -> tuple[str, ...]:
        """Names of the streams and cameras of an entry for a robot."""
        return requested(self.observation[entry], embodiment)

    def identity(self) -> dict[str, Any]:
        """The settings on which the outcome of an episode depends."""
        return {"rate": self.rate, "execute": self.execute, "observation": self.observation, "action": self.action}

    def secrets(self) -> tuple[str, dict[str, str]]:
        """The key, and the values of the headers by name.

        Raises:
            BadConfig: an environment variable is missing, or a header is none.
        """
        if odd := [name for name in self.headers if not re.fullmatch(r"[A-Za-z0-9-]{1,100}", name)]:
            raise BadConfig(f"{self.file}: headers has {cut(repr(odd[0]))}; a name has letters, digits and hyphens")
        values = {name: secret(f"{self.file}: headers.{name}", of) for name, of in self.headers.items()}
        return secret(f"{self.file}: key", self.key), values

    def check(self) -> None:
        """Raise `BadConfig` if a setting is not valid."""
        where = self.file
        action_repeat_at(self.rate, f"{where}: rate")
        for name, low, high in (("execute", 1, 1000), ("reconnects", 0, 1000)):
            if not low <= getattr(self, name) <= high:
                raise BadConfig(f"{where}: {name} = {getattr(self, name)}; it must lie in [{low}, {high}]")
        for name in ("timeout", "connect"):
            if not 0 < getattr(self, name) <= 86_400:
                raise BadConfig(f"{where}: {name} = {getattr(self, name):g}; it must lie in (0, 86400] s")
        for entry, names in self.observation.items():
            if not names or (INSTRUCTION in names and len(names) > 1):
                why = f"it must name streams that can be joined, a camera, or {INSTRUCTION} alone"
                raise BadConfig(f"{where}: observation.{entry} = {names}; {why}")
        self.secrets()
        if not self.action:
            raise BadConfig(f"{where}: action = []; name the entries of the reply that hold the actions")


def read_client(name: str | None, address: Address) -> ClientSettings:
    """The settings of a file, or those that come with scengen for the protocol of an address.

    Args:
        name: path of a YAML file, or name of a file in conf/clients; None for the protocol's own.

    Raises:
        ScengenError: there is no such file, or it is not valid.
    """
    folder = conf_dir() / "clients"
    known = sorted(path.stem for path in folder.glob("*.yaml"))
    name = name or PROTOCOLS[address.scheme]
    path = folder / f"{name}.yaml" if name in known else Path(name)
    if not path.exists() or path.is_dir():
        raise UnknownName("client", name, [*known, "FILE.yaml"])
    node = read_yaml("client", path)
    if "file" in node:
        raise UnknownName(
            f"key of {path}", "file", [key for key in ClientSettings.__dataclass_fields__ if key != "file"]
        )
    found = typed("", ClientSettings, {**node, "file": str(path)})
    found.check()
    return found
