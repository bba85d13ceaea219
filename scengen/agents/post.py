"""One HTTP request to an address that a user gives: nothing follows it elsewhere, and the answer has limits.

Redirects are not followed, because a key would go with them. An address on this machine is not asked through a proxy.
"""

import http.client
import ipaddress
import json
import queue
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar
from urllib.parse import urlsplit

from ..errors import BadConfig, cut
from ..work.secrets import shown

T = TypeVar("T")
MAX_ANSWER = 16_000_000
"""Size of the largest answer that is read [bytes]. The longest ones of models have some 100 kB."""


@dataclass
class Refusal(Exception):
    """An answer with an HTTP status that is not a success."""

    status: int
    """HTTP status code."""
    text: str
    """Beginning of the body, as one line; of a redirect, where it leads."""
    wait: str | None
    """The header Retry-After."""


class Broken(Exception):
    """No whole answer in JSON came."""


def check_address(name: str, url: str) -> None:
    """Raise `BadConfig` unless a setting is an address of an endpoint without a password in it."""
    wanted = "expected an address such as http://127.0.0.1:8000/v1"
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise BadConfig(f"{name} = {shown(url)}; {cut(str(error))}; {wanted}") from None
    if parts.scheme not in ("http", "https") or not host or port == 0 or not url.isprintable() or " " in url:
        raise BadConfig(f"{name} = {shown(url)}; {wanted}")
    if "@" in parts.netloc or parts.query or parts.fragment:
        why = "a password in it would be written into files; give the key with key=NAME, and nothing after the path"
        raise BadConfig(f"{name} = {shown(url)}; {why}")


def post(url: str, body: Mapping[str, Any], key: str, timeout: float) -> Any:
    """The answer in JSON to a body in JSON.

    Args:
        key: key of the endpoint; empty for none.
        timeout: time limit of the request and the whole answer [s].

    Raises:
        Refusal: the server answers with a status that is not a success.
        Broken: there is no answer, or it is cut short, too large, too slow, or not JSON.
    """
    headers = {"Content-Type": "application/json"} | ({"Authorization": f"Bearer {key}"} if key else {})
    request = urllib.request.Request(url, json.dumps(body).encode(), headers, method="POST")
    try:
        content = _within(timeout, lambda: _content(request, timeout))
    except http.client.HTTPException as error:
        raise Broken(f"gives no whole answer in HTTP ({type(error).__name__}: {cut(repr(str(error)))})") from None
    except TimeoutError:
        raise Broken(f"gives no whole answer within {timeout:g} s") from None
    except OSError as error:
        raise Broken(f"cannot be reached: {cut(str(error))}") from None
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        told = "".join(letter for letter in content[:80].decode(errors="ignore") if letter.isprintable())
        raise Broken(f"does not answer JSON ({type(error).__name__}: {told}); is it OpenAI-compatible?") from None


def _content(request: urllib.request.Request, timeout: float) -> bytes:
    handlers = [_NoRedirect, *([urllib.request.ProxyHandler({})] if _is_here(request.host) else [])]
    try:
        with urllib.request.build_opener(*handlers).open(request, timeout=timeout) as answer:
            content = answer.read(MAX_ANSWER + 1)
            if len(content) > MAX_ANSWER:
                raise Broken(f"answers more than {MAX_ANSWER} bytes")
            if answer.length:  # a read with a limit does not complain of a body that is cut short
                raise http.client.IncompleteRead(content[:0], answer.length)
            return content
    except urllib.error.HTTPError as error:
        with error:
            text = " ".join(error.read(MAX_ANSWER).decode(errors="replace").split())
        if 300 <= error.code < 400:
            text = f"a redirect to {shown(error.headers.get('Location') or '')}, which is not followed"
        raise Refusal(error.code, text, error.headers.get("Retry-After")) from None


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """A redirect counts as a failed request."""

    def redirect_request(self, req: Any, fp: Any, code: int, msg: str, headers: Any, newurl: str) -> None:
        return None


def _is_here(host: str) -> bool:
    """Whether a host, with or without a port, is this machine."""
    name = urlsplit(f"//{host}").hostname or ""
    try:
        return ipaddress.ip_address(name).is_loopback
    except ValueError:
        return name == "localhost" or name.endswith(".localhost")


def _within(seconds: float, work: Callable[[], T]) -> T:
    """The result of some work, or `TimeoutError`. A server that sends a byte now and then does not make it longer."""
    done: queue.SimpleQueue[tuple[T | None, BaseException | None]] = queue.SimpleQueue()

    def run() -> None:
        try:
            done.put((work(), None))
        except BaseException as error:
            done.put((None, error))

    threading.Thread(target=run, daemon=True).start()  # a daemon: it does not keep the process
    try:
        found, error = done.get(timeout=seconds)
    except queue.Empty:
        raise TimeoutError from None
    if error is not None:
        raise error
    return found  # type: ignore[return-value]
