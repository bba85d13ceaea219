"""Connections to policy servers: keys, addresses of a name, and descriptions that change."""

import gc
import socket
import threading
import time
from contextlib import contextmanager

import msgpack
import pytest
import zmq
from websockets.sync.server import serve

from scengen.errors import BadConfig
from scengen.evaluate.remote.client import ClientSettings, address_of
from scengen.evaluate.remote.servers import BadServer, Gr00t, OpenPi, plain
from scengen.evaluate.remote.wire import MAX_MESSAGE

KEY = "sk-very-secret"


def client(**changes):
    given = {"rate": 100.0, "execute": 1, "timeout": 2.0, "connect": 2.0, "reconnects": 1, "file": "my.yaml"}
    return ClientSettings(**{**given, "observation": {}, "action": ["actions"], **changes})


@contextmanager
def openpi(handle, **more):
    """A websocket server in a thread; yields its address and the headers of all handshakes."""
    seen = []

    def each(connection):
        seen.append(dict(connection.request.headers.raw_items()))
        handle(connection)

    with serve(each, "127.0.0.1", 0, **more) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield address_of(f"ws://127.0.0.1:{server.socket.getsockname()[1]}"), seen
        server.shutdown()


@contextmanager
def gr00t(host, answer):
    """A ZeroMQ server in a thread, on one address; yields its port."""
    context, stop = zmq.Context(), threading.Event()
    server = context.socket(zmq.REP)
    server.setsockopt(zmq.IPV6, 1)
    server.setsockopt(zmq.RCVTIMEO, 50)
    port = server.bind_to_random_port(f"tcp://{host}")

    def run():
        while not stop.is_set():
            try:
                server.send(msgpack.packb(answer(msgpack.unpackb(server.recv()))))
            except zmq.Again:
                pass

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        thread.join()
        server.close(linger=0)
        context.term()


def test_a_key_and_headers_come_from_the_environment(monkeypatch):
    monkeypatch.setenv("MY_KEY", KEY)
    monkeypatch.setenv("MY_TEAM", "blue")
    with openpi(lambda peer: peer.send(msgpack.packb({"fps": 100}))) as (address, seen):
        server = OpenPi(address, client(key="MY_KEY", headers={"X-Team": "MY_TEAM"}))
        assert server.describe() == {"fps": 100}
        server.close()
    assert seen[0]["Authorization"] == f"Api-Key {KEY}" and seen[0]["X-Team"] == "blue"


def test_a_key_that_a_server_repeats_is_not_told(monkeypatch):
    monkeypatch.setenv("MY_KEY", KEY)
    told, other = pytest.raises(BadServer, match=r"bad key \*\*\*"), pytest.raises(BadServer, match=r"token \*\*\* is")
    with openpi(lambda peer: peer.send(f"bad key {KEY}")) as (address, _), told:
        OpenPi(address, client(key="MY_KEY")).describe()
    with gr00t("127.0.0.1", lambda asked: {"error": f"token {asked['api_token']} is unknown"}) as port, other:
        Gr00t(address_of(f"zmq://127.0.0.1:{port}"), client(key="MY_KEY")).describe()
    gc.collect()  # a server that was never closed ends with its owner; it once waited here for ever


def test_a_server_that_wants_a_key_is_said_to(monkeypatch):
    refuse = {"process_request": lambda peer, request: peer.respond(401, "no")}
    told = pytest.raises(BadServer, match=r"HTTP 401.*does it need a key")
    with openpi(lambda peer: None, **refuse) as (address, _), told:
        OpenPi(address, client()).describe()


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"key": "NO_SUCH_KEY"}, "my.yaml: key = NO_SUCH_KEY; there is no such"),
        ({"key": KEY}, r"key = \(not shown\)"),
        ({"headers": {"X-Team": "NO_SUCH_KEY"}}, "headers.X-Team = NO_SUCH_KEY"),
        ({"headers": {"X:Y\r\n": "PATH"}}, "a name has letters"),
    ],
)
def test_keys_that_are_missing_are_one_line(changes, says):
    with pytest.raises(BadConfig, match=says) as error:
        client(**changes).check()
    assert KEY not in str(error.value)


def test_an_address_with_a_password_is_refused_without_telling_it():
    with pytest.raises(BadConfig, match="wss://HOST:PORT") as error:
        address_of("wss://me:pw1234@host:80")
    assert "pw1234" not in str(error.value) and str(address_of("wss://host:443")) == "wss://host:443"


def test_a_description_that_changes_between_connections_is_named():
    count = []

    def handle(peer):
        count.append(0)
        peer.send(msgpack.packb({"policy": "p", "started": len(count), "norm": float("nan")}))

    with openpi(handle) as (address, _):
        server = OpenPi(address, client())
        server.describe()
        server.close()
        with pytest.raises(BadServer, match=r"otherwise \(started\)"):
            server.describe()


def test_the_time_to_connect_does_not_bound_an_answer():
    def late(peer):
        time.sleep(0.3)
        peer.send(msgpack.packb({"fps": 100}))

    with openpi(late) as (address, _):
        server = OpenPi(address, client(connect=0.1, reconnects=0))
        assert server.describe() == {"fps": 100}
        server.close()


def test_a_message_that_is_too_large_is_called_that():
    told = pytest.raises(BadServer, match="message too big")
    with openpi(lambda peer: peer.send(bytes(MAX_MESSAGE + 1))) as (address, _), told:
        OpenPi(address, client(reconnects=0)).describe()


def test_numbers_that_are_none_are_equal_to_themselves_in_a_description():
    assert plain({"a": float("nan"), 0: b"x"}) == plain({"a": float("nan"), 0: b"x"})


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]"])
def test_a_name_with_two_addresses_reaches_the_server_behind_one_of_them(host, monkeypatch):
    config = {"state": {"delta_indices": [0], "modality_keys": []}}
    try:
        socket.create_server(("::1", 0), family=socket.AF_INET6).close()
    except OSError:
        pytest.skip("no IPv6")
    with gr00t(host, lambda asked: config) as port:
        both = [
            (socket.AF_INET6, socket.SOCK_STREAM, 6, "", ("::1", port, 0, 0)),
            (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("127.0.0.1", port)),
        ]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_: both)
        server = Gr00t(address_of(f"zmq://two.example:{port}"), client())
        assert server.describe() == config
        server.close()
