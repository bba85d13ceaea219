"""Connections to policy servers: openpi's websocket protocol and GR00T's requests over ZeroMQ.

Protocols as of openpi-client 0.1.2 (Physical-Intelligence/openpi, websocket_client_policy.py) and Isaac GR00T N1.7
(NVIDIA/Isaac-GR00T, gr00t/policy/server_client.py). A client connects to the given address only: it uses no proxy and
follows no redirect.
"""

import json
import socket
import struct
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import ExitStack
from types import ModuleType
from typing import Any

from ...errors import ScengenError, cut
from ...work.extras import module_of_extra
from ...work.log import different
from ...work.secrets import hidden
from .client import Address, ClientSettings
from .wire import MAX_MESSAGE, BadMessage, mapping, msgpack_numpy_array, openpi_array, unpacked

RETRY = 0.2
"""Time between two tries to connect [s]."""


class BadServer(ScengenError):
    """A policy server cannot be reached, reports an error, or does not keep to its protocol."""


class Lost(Exception):
    """The connection is lost, or no reply came in time."""


class Server(ABC):
    """A connection to a policy server. It is opened when it is needed, and again after it was lost."""

    def __init__(self, address: Address, client: ClientSettings):
        self.address, self.client = address, client
        self.about: Mapping[str, Any] | None = None
        """Description that the server gave of itself; None before the first connection."""
        self._open = False
        self._key, self._headers = client.secrets()

    def describe(self) -> Mapping[str, Any]:
        """The server's description of itself."""
        self._repeated(self._connect)
        assert self.about is not None
        return self.about

    @abstractmethod
    def infer(self, observation: Mapping[str, Any]) -> Mapping[str, Any]:
        """The reply to an observation.

        Raises:
            BadServer: it does not exist, or it is not one of the protocol.
        """

    @abstractmethod
    def reset(self, seed: int) -> None:
        """Start an episode, if the protocol has a message for it."""

    @abstractmethod
    def close(self) -> None:
        """Close the connection."""
        self._open = False

    @abstractmethod
    def _dial(self) -> Mapping[str, Any]:
        """Open the connection and return the server's description of itself."""

    def _connect(self) -> None:
        """Open the connection unless it is open.

        Raises:
            Lost: it breaks off.
            BadServer: the server describes itself otherwise than before.
        """
        if self._open:
            return
        about = self._dial()
        self._open = True
        if self.about is not None and (names := different(plain(self.about), plain(about))):
            told = f"after a lost connection, the server describes itself otherwise ({cut(', '.join(names))})"
            raise self.fault(f"{told}: it serves another policy")
        self.about = about

    def _repeated(self, work: Any, *arguments: Any) -> Any:
        """The result of some work on the connection, repeated on a new one if it is lost."""
        why = ""
        for _ in range(1 + self.client.reconnects):
            try:
                self._connect()
                return work(*arguments)
            except Lost as error:
                why = str(error)
                self.close()
            except BadMessage as error:
                raise self.fault(str(error)) from None
        raise self.fault(f"{why}; {self.client.reconnects} reconnects (see {self.client.file})")

    def fault(self, what: str) -> BadServer:
        """An error of this server, as one line."""
        for value in (self._key, *self._headers.values()):
            what = hidden(what, value)
        return BadServer(f"policy = {self.address}; {' '.join(what.split())}")

    def _reach(self) -> socket.socket:
        """A plain connection to the port, after waiting for it.

        Raises:
            BadServer: there is no such host, or nothing accepts a connection in time.
        """
        limit = time.monotonic() + self.client.connect
        while True:
            try:
                return socket.create_connection((self.address.host, self.address.port), timeout=self.client.connect)
            except (socket.gaierror, UnicodeError) as error:
                raise self.fault(f"there is no host {self.address.host} ({error})") from None
            except OSError as error:
                if time.monotonic() + RETRY > limit:
                    waited = f"no server accepts a connection within {self.client.connect:g} s"
                    raise self.fault(f"{waited} ({type(error).__name__}); start it first") from None
            time.sleep(RETRY)


class OpenPi(Server):
    """openpi's protocol: after connecting, the server sends its metadata; then one reply for each observation."""

    def __init__(self, address: Address, client: ClientSettings):
        super().__init__(address, client)
        self._websockets = _library("websockets.sync.client")
        self._errors: tuple[type[Exception], ...] = (
            _library("websockets.exceptions").WebSocketException,
            OSError,
            EOFError,
        )
        self._opened = ExitStack()
        self._key_header = {"Authorization": f"Api-Key {self._key}"} if self._key else {}  # as openpi-client has it
        self._socket: Any = None

    def infer(self, observation: Mapping[str, Any]) -> Mapping[str, Any]:
        return self._repeated(self._exchange, _packed(observation, openpi_array))

    def reset(self, seed: int) -> None:
        """Start an episode: the protocol has no message for it."""

    def close(self) -> None:
        super().close()
        self._opened.close()

    def _dial(self) -> Mapping[str, Any]:
        plain = self._reach()
        plain.settimeout(None)  # else the time to connect would bound every reply
        wait = struct.pack("ll", int(self.client.timeout), int(self.client.timeout % 1 * 1e6))
        plain.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, wait)
        try:
            # A given socket rules out proxies and redirects. Servers do not answer pings during an inference.
            dialled = self._websockets.connect(
                str(self.address),
                additional_headers=self._key_header | self._headers,
                sock=plain,
                compression=None,
                proxy=None,
                max_size=MAX_MESSAGE,
                open_timeout=self.client.timeout,
                ping_interval=None,
                close_timeout=1,
            )
            self._socket = self._opened.enter_context(dialled)
        except (*self._errors, ValueError) as error:
            plain.close()
            why = f"the server refuses a websocket ({type(error).__name__}: {cut(str(error))})"
            raise Lost(f"{why} (does it need a key?)" if "HTTP 40" in why else why) from None
        return mapping(self._received(), "the metadata")

    def _exchange(self, request: bytes) -> Mapping[str, Any]:
        try:
            self._socket.send(request)
        except self._errors as error:
            raise Lost(f"the connection is lost ({type(error).__name__}: {cut(str(error))})") from None
        return mapping(self._received(), "a reply")

    def _received(self) -> Any:
        try:
            message = self._socket.recv(timeout=self.client.timeout)
        except TimeoutError:
            raise Lost(f"no reply within {self.client.timeout:g} s") from None
        except self._errors as error:
            raise Lost(f"the connection is lost ({type(error).__name__}: {cut(str(error))})") from None
        if isinstance(message, str):  # openpi sends a traceback as text, and closes
            raise self.fault(f"the server reports an error: {_last_line(message)}")
        return unpacked(message)


class Gr00t(Server):
    """GR00T's protocol: requests `{endpoint, data}` over ZeroMQ, each with one reply."""

    def __init__(self, address: Address, client: ClientSettings):
        super().__init__(address, client)
        self._zmq = _library("zmq")
        self._context = self._zmq.Context.instance()  # garbage collection of a context waits for its sockets
        self._socket: Any = None

    def infer(self, observation: Mapping[str, Any]) -> Mapping[str, Any]:
        return self._repeated(self._action, {"observation": nested(observation), "options": None})

    def reset(self, seed: int) -> None:
        """Start an episode; the seed is an option that GR00T's own policies ignore."""
        self._repeated(self._call, "reset", {"options": {"seed": seed}})

    def close(self) -> None:
        super().close()
        if self._socket is not None:
            self._socket.close(linger=0)
            self._socket = None

    def _dial(self) -> Mapping[str, Any]:
        with self._reach() as reached:  # a name may have several addresses, of which ZeroMQ would take the first one
            host, port, *_ = reached.getpeername()
        self._socket = self._context.socket(self._zmq.REQ)
        wait = max(1, round(1000 * self.client.timeout))
        for option, value in (("RCVTIMEO", wait), ("SNDTIMEO", wait), ("LINGER", 0), ("MAXMSGSIZE", MAX_MESSAGE)):
            self._socket.setsockopt(getattr(self._zmq, option), value)
        self._socket.setsockopt(self._zmq.IPV6, 1)
        self._socket.connect(f"tcp://{Address('zmq', host, port).location}")
        return mapping(self._call("get_modality_config"), "the modality configuration")

    def _action(self, data: Mapping[str, Any]) -> Mapping[str, Any]:
        reply = self._call("get_action", data)
        if not isinstance(reply, list) or len(reply) != 2:
            raise BadMessage(f"a reply is {cut(repr(reply))}, not a list of an action and information")
        return mapping(reply[0], "an action")

    def _call(self, endpoint: str, data: Mapping[str, Any] | None = None) -> Any:
        request: dict[str, Any] = {"endpoint": endpoint} if data is None else {"endpoint": endpoint, "data": data}
        if self._key:
            request["api_token"] = self._key
        try:
            self._socket.send(_packed(request, msgpack_numpy_array))
            message = self._socket.recv()
        except self._zmq.Again:
            raise Lost(f"no reply within {self.client.timeout:g} s") from None
        except self._zmq.ZMQError as error:
            raise Lost(f"the connection is lost ({error})") from None
        reply = unpacked(message)
        if isinstance(reply, Mapping) and "error" in reply:
            why = _last_line(str(reply["error"]))
            hint = " (does it need a key?)" if "unauthori" in why.lower() else ""
            raise self.fault(f"the server reports an error: {why}{hint}")
        return reply


SERVERS: dict[str, type[Server]] = {"ws": OpenPi, "wss": OpenPi, "zmq": Gr00t}
"""Kinds of connections, by the scheme of an address."""


def plain(about: Mapping[str, Any]) -> Any:
    """A server's description of itself as it can be compared and written."""
    told = json.dumps({str(key): value for key, value in about.items()}, default=repr)
    return json.loads(told, parse_constant=str)  # numbers that are none are words, which are equal to themselves


def nested(observation: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """An observation as GR00T expects it: `{"state": {"eef_pos": ...}}` for an entry `state.eef_pos`."""
    found: dict[str, dict[str, Any]] = {}
    for entry, value in observation.items():
        modality, _, name = entry.partition(".")
        found.setdefault(modality, {})[name] = value
    return found


def _packed(value: Any, default: Any) -> bytes:
    return _library("msgpack").packb(value, default=default)


def _last_line(text: str) -> str:
    """The last line of a traceback, which names the error."""
    return cut(next((line for line in reversed(text.splitlines()) if line.strip()), "(empty)").strip())


def _library(name: str) -> ModuleType:
    """A module of the extra `remote`."""
    return module_of_extra(name, "policies behind a socket need", "remote")
