"""The command line: a verb, then Hydra overrides. `scengen generate task=domino_single split=diagonal n=100`."""

import inspect
import sys
from collections.abc import Sequence
from importlib import import_module

from .commands import BAD_INPUT, INTERRUPTED, OK, out, say, warn
from .config import conf_dir
from .control import native
from .errors import BadConfig, ScengenError, nearest

VERBS = (
    "generate",
    "verify",
    "show",
    "film",
    "view",
    "export",
    "record",
    "tasks",
    "evaluate",
    "attack",
    "axis",
    "report",
    "robosuite",
    "power",
    "bias",
    "compare",
    "subset",
    "shrink",
    "bench",
)


def main() -> None:
    """Run one verb and leave with its exit status."""
    sys.exit(run(sys.argv[1:]))


def run(argv: Sequence[str]) -> int:
    """Run one verb: 0 all well, 1 something did not hold, 2 bad input."""
    native.silence()  # MuJoCo's warnings are counted and reported; it would also print them and write a log file
    try:
        if not argv or argv[0] in ("-h", "--help", "help"):
            say(_help())
            return OK
        verb, *arguments = argv
        if verb == "--version":
            from .validate.identity import versions

            say(" ".join(f"{k} {v}" for k, v in versions().items()))
            return OK
        if verb not in VERBS:
            raise BadConfig(f"no command named {verb!r}{nearest(verb, VERBS)}; known: {', '.join(VERBS)}")
        if {"-h", "--help"} & set(arguments):
            out.print(_settings(verb), highlight=False, markup=False, end="")
            return OK
        if flags := [a for a in arguments if a.startswith("-")]:
            raise BadConfig(f"{flags[0]!r} is no option; settings are key=value, see scengen {verb} --help")
        return import_module(f".commands.{verb}", __package__).command(arguments)
    except ScengenError as error:
        warn(f"scengen: {error}")
        return BAD_INPUT
    except KeyboardInterrupt:
        warn("scengen: interrupted; what is finished is kept, the same command continues")
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return OK


def _settings(verb: str) -> str:
    """The settings of a command as its file tells them, without what only Hydra reads."""
    lines = (conf_dir() / "command" / f"{verb}.yaml").read_text().splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("# @package") and "optional /limits" not in line)


def _help() -> str:
    told = {verb: inspect.getdoc(import_module(f".commands.{verb}", __package__)) for verb in VERBS}
    return "\n".join(
        [
            "scengen: physical puzzles for robot manipulation, each proved solvable",
            "",
            "usage: scengen COMMAND [key=value ...]      settings of a command: scengen COMMAND --help",
            "",
            *(f"  {verb:<10}{what}" for verb, what in told.items()),
            "",
            "example: scengen generate task=domino_single split=diagonal n=100 workers=2 pool=generated/diagonal",
        ]
    )
