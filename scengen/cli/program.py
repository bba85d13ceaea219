"""The command line: a verb, then Hydra overrides. `scengen generate task=domino_single split=diagonal n=100`."""

import ast
import os
import re
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import NoReturn

from ..errors import BadConfig, ForeignCode, ScengenError, cut, nearest

OK, BAD_INPUT, INTERRUPTED = 0, 2, 130

VERBS = (
    "generate",
    "verify",
    "drift",
    "show",
    "film",
    "view",
    "export",
    "record",
    "card",
    "tasks",
    "new",
    "asset",
    "evaluate",
    "attack",
    "axis",
    "discover",
    "report",
    "robosuite",
    "power",
    "bias",
    "compare",
    "subset",
    "shrink",
    "bench",
)

CONTINUING = ("generate", "evaluate", "attack", "axis", "discover")
"""Commands that keep what is finished when they are interrupted, and go on from there."""
COMPLETING = ("--completion", "--complete")
"""What shells ask for."""
GRACE = 1.5
"""How long an interrupted command may take to put things in order before it is ended [s]."""
LONGEST = 3000
"""Letters of an error line: more than any list of known names takes."""


def main() -> NoReturn:
    """Run one verb and leave with its exit status."""
    signals = Signals()
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]  # a name need not be Unicode
    status = run(sys.argv[1:], signals)
    if status == INTERRUPTED:
        with suppress(OSError):
            sys.stdout.flush()
        signals.end()  # at once: Python takes seconds to take itself apart on a busy machine
    sys.exit(status)


class Signals:
    """What Ctrl-C and SIGTERM do: the first ends the command in order, within `GRACE`, the second one at once."""

    def __init__(self) -> None:
        self.status = INTERRUPTED
        self.working = False
        """Whether the command has begun; before, while modules are imported, nothing has to be put in order."""
        self._came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self.status = 128 + number
        if self._came or not self.working:
            self.end()
        self._came = True
        timer = threading.Timer(GRACE, self.end)
        timer.daemon = True
        timer.start()
        raise KeyboardInterrupt

    def end(self) -> NoReturn:
        """Leave without a further step of Python's, and leave nobody behind."""
        if not self.working:
            with suppress(OSError):
                os.write(2, b"scengen: interrupted, nothing was begun\n")
        end_children()
        os._exit(self.status)


def end_children() -> None:
    """Kill processes that this one has started: a worker that is still importing does not know yet whom to follow."""
    for path in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):
            for child in path.read_text().split():
                os.kill(int(child), signal.SIGKILL)


def run(argv: Sequence[str], signals: Signals | None = None) -> int:
    """Run one verb: 0 all well, 1 something did not hold, 2 bad input or a fault of the machine."""
    try:
        return _run(argv, signals)
    except ScengenError as error:
        return _told(str(error), _kept(error) if isinstance(error, ForeignCode) else "")
    except KeyboardInterrupt:
        kept = "what is finished is kept, the same command continues"
        _line(f"scengen: interrupted; {kept if argv[0] in CONTINUING else 'the same command begins anew'}")
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return OK
    except MemoryError as error:
        return _told("the memory is used up; ask for less at once, or use fewer workers", _kept(error))
    except OSError as error:
        from ..work.targets import remedy

        if told := remedy(error):
            return _told(f"{cut(str(error.filename or 'a file'))}: {told}")
        return _unforeseen(error)
    except Exception as error:
        return _unforeseen(error)


def _run(argv: Sequence[str], signals: Signals | None) -> int:
    _check_platform()
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(_help())
        return OK
    verb, *arguments = argv
    if verb == "--version":
        from ..versions import versions

        print(" ".join(f"{k} {v}" for k, v in versions().items()))
        return OK
    if verb not in (*VERBS, *COMPLETING):
        raise BadConfig(f"no command named {cut(repr(verb))}{nearest(verb, VERBS)}; known: {', '.join(VERBS)}")

    from ..task_files import ORIGINS
    from .usage import usage

    if {"-h", "--help"} & set(arguments) and verb in VERBS:
        print(usage(verb, [a for a in arguments if not a.startswith("-")]), end="")
        return OK

    # What follows takes seconds to import on a busy machine; nothing above needs it.
    from ..commands import out
    from ..control import compilation, native
    from .completion import BASH, completions

    compilation.announce()
    native.silence()  # MuJoCo's warnings are counted and reported; it would also print them and write a log file
    if verb == "--completion":
        if arguments != ["bash"]:
            raise BadConfig(f"{cut(' '.join(argv))}; expected --completion bash: no other shell is known")
        out.print(BASH, end="", soft_wrap=True)
        return OK
    if verb == "--complete":
        out.print("\n".join(completions(" ".join(arguments), VERBS)), soft_wrap=True)
        return OK
    if verb == "generate":  # several values are a sweep there, with Hydra's option or without it
        arguments = [a for a in arguments if a not in ("-m", "--multirun")]
    flags = [a for a in arguments if a.startswith("-")]
    if flags and flags[0].partition("=")[0] in SHOWING:
        return _show(verb, arguments)
    if flags:
        known = "settings are key=value, options --help, --cfg job and --info " + "|".join(ORIGINS)
        raise BadConfig(f"{cut(repr(flags[0]))} is no option; {known}; see scengen {verb} --help")
    command = import_module(f"scengen.commands.{verb}").command
    if signals:
        signals.working = True
    return command(arguments)


def _check_platform() -> None:
    """Raise `BadConfig` where scengen cannot run, before modules are imported that fail there in many lines."""
    if sys.platform != "linux":  # the control loop is compiled against the libmujoco.so of MuJoCo's Linux wheel
        raise BadConfig(f"scengen runs on Linux, this is {sys.platform}; use its Dockerfile, or WSL on Windows")


SHOWING = {"-c": "--cfg", "--cfg": "--cfg", "-i": "--info", "--info": "--info"}
"""Hydra's options that show a configuration, by how they may be written."""


def _show(verb: str, arguments: Sequence[str]) -> int:
    """Show what a command would work with, or where it comes from: `--cfg job`, `--info defaults`."""
    from .. import compose
    from ..commands import out

    words = list(arguments)
    place = next(i for i, word in enumerate(words) if word.startswith("-"))
    option, _, what = words.pop(place).partition("=")
    if not what and place < len(words):
        what = words.pop(place)
    if others := [word for word in words if word.startswith("-")]:
        raise BadConfig(f"{cut(repr(others[0]))} cannot be said together with {option}; say one of them")
    if SHOWING[option] == "--info":
        compose.show_origin(verb, words, what)
    elif what == "job":
        out.print(compose.shown(verb, words), end="", soft_wrap=True)
    else:
        raise BadConfig(f"{option} {cut(repr(what))}; the configuration of a command is that of its job, say --cfg job")
    return OK


def _line(text: str) -> None:
    """One line on standard error, whatever stands in the text."""
    from ..work.printed import printable

    words = re.sub(r"\S{1000,}", lambda found: cut(found[0]), printable(text))
    if len(words) > LONGEST:  # what would be right stands at the end
        words = f"{words[: LONGEST // 2]} ... {words[-LONGEST // 2 :]}"
    print(words, file=sys.stderr, flush=True)


def _told(text: str, file: str = "") -> int:
    _line(f"scengen: {text}{f'; the traceback is in {file}' if file else ''}")
    return BAD_INPUT


def _unforeseen(error: Exception) -> int:
    """The last net: whatever nobody thought of is one line too."""
    what = cut(" ".join(str(error).split()))
    return _told(f"unforeseen {type(error).__name__}: {what}; please report it", _kept(error) or "(no file: no room)")


def _kept(error: BaseException) -> str:
    """The file that a traceback was written to; empty if there is no room for one."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="scengen-", suffix=".txt", delete=False, errors="backslashreplace"
        ) as file:
            traceback.print_exception(error, file=file)
            return file.name
    except OSError:
        return ""


def _help() -> str:
    folder = Path(__file__).parents[1] / "commands"
    told = {verb: ast.get_docstring(ast.parse((folder / f"{verb}.py").read_text())) for verb in VERBS}
    return "\n".join(
        [
            "scengen: physical puzzles for robot manipulation, each proved solvable",
            "",
            "usage: scengen COMMAND [key=value ...]      settings of a command: scengen COMMAND --help",
            "",
            *(f"  {verb:<10}{what}" for verb, what in told.items()),
            "",
            "example: scengen generate task=domino_single split=diagonal n=100 workers=2 pool=generated/diagonal",
            'completion in bash: eval "$(scengen --completion bash)"',
        ]
    )
