"""Only requests with the token are answered, those of other pages are not, and no message opens a tunnel."""

import http.client
import socket

import pytest

pytest.importorskip("viser", reason="no viser; it is in the extra studio")

import viser
import viser._messages
import websockets.exceptions
import websockets.sync.client

from scengen.studio.app import Content, Studio


@pytest.fixture(scope="module")
def studio():
    found = Studio(Content(shelf=None), "127.0.0.1", 0)
    yield found
    found.close()


def get(studio, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", studio.server.get_port(), timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    return answer, answer.read()


def connect(studio, path, origin=None):
    address = f"ws://127.0.0.1:{studio.server.get_port()}{path}"
    protocol = f"viser-v{viser.__version__}"
    return websockets.sync.client.connect(address, origin=origin, subprotocols=[protocol], open_timeout=20)


def test_the_page_is_served_with_the_token_and_with_headers_that_keep_it(studio):
    answer, body = get(studio, f"/{studio.token}/")
    assert answer.status == 200 and b"<html" in body
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy and f"ws://127.0.0.1:{studio.server.get_port()}" in policy
    assert answer.headers["Referrer-Policy"] == "no-referrer" and len(body) == int(answer.headers["Content-Length"])
    assert len(studio.token) >= 32 and studio.address.endswith(f"/{studio.token}/")


@pytest.mark.parametrize(
    "path",
    [
        "/",
        "",
        "/index.html",
        "/?token=x",
        "/x/",
        "/{part}/",
        "/{token}x/",
        "//{token}/",
        "/..%2f{token}/",
        "/%00",
        "/%C3%A9",
    ],
)
def test_a_request_without_the_token_is_not_answered(studio, path):
    path = path.format(token=studio.token, part=studio.token[:-1]) or "/"
    answer, body = get(studio, path)
    assert answer.status == 403 and not body


@pytest.mark.parametrize(
    "path", ["../server.py", "%2e%2e/%2e%2e/server.py", "..\\..\\server.py", "/etc/passwd", "build"]
)
def test_paths_outside_the_page_are_not_found(studio, path):
    answer, body = get(studio, f"/{studio.token}/{path}")
    assert answer.status == 404 and b"import" not in body


def test_a_websocket_needs_the_token_and_the_own_page(studio):
    own = f"http://127.0.0.1:{studio.server.get_port()}"
    with connect(studio, f"/{studio.token}", own) as connection:
        assert connection.recv(timeout=20)
    for path, origin in [
        ("/", own),
        ("/wrong", own),
        (f"/{studio.token}", "http://evil.example"),
        (f"/{studio.token}", "null"),
        (f"/{studio.token}", f"https://127.0.0.1:{studio.server.get_port()}"),
    ]:
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            connect(studio, path, origin)
        assert refused.value.response.status_code == 403


def test_the_page_of_another_origin_is_not_served(studio):
    answer, _ = get(studio, f"/{studio.token}/", Origin="http://evil.example")
    assert answer.status == 403


def test_no_message_opens_a_public_tunnel(studio):
    handlers = studio.server._websock_server._incoming_handlers
    assert not {viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect} & set(handlers)


def test_only_loopback_is_bound_by_default(studio):
    assert studio.server.get_host() == "127.0.0.1"
    other = socket.gethostbyname(socket.gethostname())
    if not other.startswith("127."):
        with pytest.raises(OSError):
            socket.create_connection((other, studio.server.get_port()), timeout=2)


def test_a_request_that_says_nothing_of_encodings_is_answered(studio):
    with socket.create_connection(("127.0.0.1", studio.server.get_port()), timeout=20) as peer:
        peer.sendall(f"GET /{studio.token}/ HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        assert peer.recv(12) == b"HTTP/1.1 200"
