"""The command line: `scengen COMMAND key=value ...`."""

from .program import BAD_INPUT, INTERRUPTED, OK, main, run
from .verbs import VERBS

__all__ = ["BAD_INPUT", "INTERRUPTED", "OK", "VERBS", "main", "run"]
