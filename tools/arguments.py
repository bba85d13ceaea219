"""Command lines of tools: names, and settings such as n=8."""

import sys
from collections.abc import Sequence

from scengen.errors import nearest


def parted(arguments: Sequence[str], *known: str) -> tuple[list[str], dict[str, str]]:
    """The names among some arguments, and the settings. An unknown setting ends the program with a line."""
    settings = dict(argument.split("=", 1) for argument in arguments if "=" in argument)
    if unknown := settings.keys() - set(known):
        sys.exit(f"no setting named {min(unknown)!r}{nearest(min(unknown), known)}; known: {', '.join(known)}")
    return [argument for argument in arguments if "=" not in argument], settings
