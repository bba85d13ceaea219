"""Keys of servers: they are in environment variables, go where a user says, and are shown nowhere."""

import difflib
import os
import re

from ..errors import BadConfig, cut

_NAME = re.compile(r"[A-Z_][A-Z0-9_]{0,63}")


def secret(setting: str, name: str) -> str:
    """The key in an environment variable; empty if no variable is named.

    Raises:
        BadConfig: there is none, or no header may hold it. A key in place of its name is not shown.
    """
    if not name:
        return ""
    told, key = name if _NAME.fullmatch(name) else "(not shown)", os.environ.get(name, "").strip()
    if not key:
        close = difflib.get_close_matches(name, os.environ, n=1, cutoff=0.8)
        hint = f" (did you mean {close[0]}?)" if close else ""
        why = "there is no such environment variable" if told == name else "it must name an environment variable"
        raise BadConfig(f"{setting} = {told}; {why}{hint}; set it to the server's key")
    if not (key.isascii() and key.isprintable()):
        why = "its value has a line end or a letter that no header may hold; set it again"
        raise BadConfig(f"{setting} = {told}; {why}")
    return key


def hidden(text: str, key: str) -> str:
    """A text without a key, which some servers repeat."""
    return text.replace(key, "***") if key else text


def shown(address: str) -> str:
    """An address for messages: without a password, or what follows the path."""
    return cut(re.sub(r"[?#].*", "?***", re.sub(r"(^|//)[^/]*@", r"\1***@", address), flags=re.S))
