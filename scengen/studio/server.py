"""The web server of the studio: viser's, behind a token.

viser has no hook for requests and answers everyone. Its server is therefore opened with `websockets.serve` replaced by
one that checks the token first. The token is the first part of every path: viser's page derives the address of its
websocket from its own, so that requests of both kinds have it, without cookies, which other servers on this machine
would see.
"""

import hmac
import secrets
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from http import HTTPStatus
from importlib.resources import files
from typing import Any
from unittest.mock import patch

import viser
import viser._messages
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob: data:; "
    "connect-src 'self' data: blob: ws://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Content security policy. viser's page is one file that unpacks its own script, which needs the two `unsafe` words;
what could run in spite of escaping still reaches no other host."""
HEADERS = {"Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff", "Cache-Control": "no-store"}
"""Further headers of every answer. The address holds the token, which must go to no other page."""
SHARING = ("ShareUrlRequest", "ShareUrlDisconnect")
"""Messages with which viser's page requests a public tunnel; they are not answered."""
Socket = Callable[[ServerConnection], Awaitable[None]]
"""Function that serves a websocket."""


def new_token() -> str:
    """A token that cannot be guessed."""
    return secrets.token_urlsafe(24)


class Guard:
    """Decides which requests are answered."""

    def __init__(
        self,
        token: str,
        sockets: Mapping[str, Socket] | None = None,
        added: Sequence[str] = (),
    ):
        """
        Args:
            sockets: functions for websockets of our own, by their paths.
            added: files of `static`, scripts and style sheets, that are added to viser's page.
        """
        self._token, self._sockets = token.encode(), sockets or {}
        self._added = {f"/{name}": files("scengen.studio").joinpath("static", name).read_bytes() for name in added}

    def serve(self, handler: Socket, host: str, port: int, **options: Any) -> Any:
        """`websockets.serve` with the guard before viser's functions."""
        answer = options.pop("process_request")

        def guarded(connection: ServerConnection, request: Request) -> Response | None:
            if not self.admits(request):
                return _answer(HTTPStatus.FORBIDDEN)
            if request.headers.get("Upgrade", "").lower() == "websocket":
                return None
            path = request.path.partition("?")[0]
            if path in self._added:
                return _answer(HTTPStatus.OK, self._added[path], {"Content-Type": _kind(path)} | HEADERS)
            is_page = path == "/"
            if is_page:  # it is changed below, which is simpler before it is packed
                request.headers.pop("Accept-Encoding", None)
            response = answer(connection, request)
            if is_page:
                response.body = _with(response.body, self._added)
                del response.headers["Content-Length"]
                response.headers["Content-Length"] = str(len(response.body))
            response.headers["Content-Security-Policy"] = POLICY.format(host=request.headers.get("Host", ""))
            for name, value in HEADERS.items():
                response.headers[name] = value
            return response

        async def served(connection: ServerConnection) -> None:
            path = connection.request.path if connection.request else "/"
            await self._sockets.get(path, handler)(connection)

        return _serve(served, host, port, process_request=guarded, **options)

    def admits(self, request: Request) -> bool:
        """Whether a request has the token and comes from the studio's own page; then its path loses the token."""
        _, _, rest = request.path.partition("/")
        given, slash, path = rest.partition("/")
        given = given.partition("?")[0] if not slash else given
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self._token):
            return False
        origin = request.headers.get("Origin")
        if origin is not None and origin != f"http://{request.headers.get('Host')}":
            return False
        request.path = f"/{path}"
        return True


_serve = websockets.asyncio.server.serve


def _kind(path: str) -> str:
    """Type of a file that is added to the page."""
    return "text/css" if path.endswith(".css") else "application/javascript"


def _with(page: bytes, added: Iterable[str]) -> bytes:
    """viser's page with scripts and style sheets of ours, after its own."""
    tags = (
        f'<link rel="stylesheet" href="{path[1:]}">'
        if path.endswith(".css")
        else f'<script src="{path[1:]}" defer></script>'
        for path in added
    )
    head, end, body = page.rpartition(b"</head>")
    return head + "".join(tags).encode() + end + body


def _answer(status: HTTPStatus, body: bytes = b"", headers: Mapping[str, str] | None = None) -> Response:
    told = {"Content-Length": str(len(body)), "Connection": "close", **(headers or {})}
    return Response(status, status.phrase, Headers(told), body)


def open_server(host: str, port: int, guard: Guard) -> viser.ViserServer:
    """Open the server; the next free port is taken if this one is in use."""
    replaced = patch.object(websockets.asyncio.server, "serve", guard.serve)
    with replaced, patch("rich.print"):  # viser would print an address without the token
        server = viser.ViserServer(host, port, label="scengen studio", verbose=False)
    for name in SHARING:
        server._websock_server.unregister_handler(getattr(viser._messages, name))
    return server


def close_server(server: viser.ViserServer) -> None:
    """Close the server."""
    with patch("rich.print"):  # viser would report it
        server.stop()
