"""The command line: a verb, then Hydra overrides. `scengen generate task=domino_single split=diagonal n=100`."""

import ast
import io
import os
import re
import signal
import sys
import tempfile
import textwrap
import threading
import traceback
import warnings
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, TextIO

from ..errors import BadConfig, ForeignCode, OtherVersions, ScengenError, cut, nearest, place_of
from .verbs import COMMANDS, CONTINUING, FORMS, GROUPS, ONLY_FORMS, RENAMED, VERBS, file_stem, parsed

OK = 0
"""Exit status of a command that succeeded."""
BAD_INPUT = 2
"""Exit status after wrong input or a fault of the machine."""
DECLINED = 3
"""Exit status if something cannot be judged with what is installed here."""
INTERRUPTED = 130
"""Exit status after Ctrl-C."""
COMPLETING = ("--completion", "--complete")
"""Options that shells use."""
GRACE = 1.5
"""Time that an interrupted command has to clean up before it is ended [s]."""
AGAIN = 0.05
"""Time after which an interruption that C has ignored comes again [s]."""
OUT_OF_MEMORY = "out of memory; process less at once, use fewer workers, or raise the limit of memory (ulimit -v)"
"""Message for a command that has no memory left."""
NO_MEMORY = "Could not allocate memory"
"""Words with which MuJoCo reports a lack of memory, in exceptions of multiple types."""
MAX_LINE = 3000
"""Largest length of an error line [characters]: longer than any list of known names."""


def main() -> NoReturn:
    """Run one verb and leave with its exit status."""
    signals = Signals()
    warnings.showwarning = print_warning
    sys.stdout, sys.stderr = _lasting(sys.stdout), _lasting(sys.stderr)
    status = run(sys.argv[1:], signals)
    if status == INTERRUPTED:
        with suppress(OSError):
            sys.stdout.flush()
        signals.end()  # at once: Python takes seconds to take itself apart on a busy machine
    signals.finish(status)
    sys.exit(status)


class LastingFile(io.FileIO):
    """A file that discards what a pipe refuses because its reader has gone, as `| head` does.

    The command goes on and ends with its own status.
    """

    def write(self, data: Any) -> int:
        """Write some bytes, or discard them."""
        try:
            return super().write(data)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return super().write(data)


def _lasting(stream: TextIO | None) -> TextIO:
    """A standard stream that outlives its reader and can print names that are not Unicode; nowhere if it is closed."""
    if stream is None:
        return open(os.devnull, "w")
    lines = bool(stream.line_buffering or stream.write_through)  # type: ignore[attr-defined]  # PYTHONUNBUFFERED sets the latter
    file = io.BufferedWriter(LastingFile(stream.fileno(), "w", closefd=False))
    return io.TextIOWrapper(file, stream.encoding, "backslashreplace", line_buffering=lines)


class Signals:
    """Handlers of Ctrl-C and SIGTERM: the first ends the command in order, within `GRACE`, the second one at once."""

    def __init__(self) -> None:
        self.status = INTERRUPTED
        self.working = False
        """Whether the command has started. Before that, while modules are imported, nothing has to be cleaned up."""
        self.received = False
        """Whether the command has been interrupted."""
        self._finished = False
        """Whether the command has ended, and Python and Ray take themselves apart."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)
        sys.unraisablehook = self._ignored

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self._finished:
            self.end()
        self.status = 128 + number
        if self.received or not self.working:
            self.end()
        self.received = True
        timer = threading.Timer(GRACE, self.end)
        timer.daemon = True
        timer.start()
        raise KeyboardInterrupt

    def _ignored(self, error: "sys.UnraisableHookArgs") -> None:
        """Interrupt again what was interrupted in a function that C has called, as the compiler does: it ends there."""
        if not issubclass(error.exc_type, KeyboardInterrupt):
            sys.__unraisablehook__(error)
            return
        self.received = False
        again = threading.Timer(AGAIN, signal.pthread_kill, [threading.main_thread().ident, self.status - 128])
        again.daemon = True
        again.start()

    def finish(self, status: int) -> None:
        """Let a signal from now on end the process with the status of the command."""
        self.status, self._finished, self.working = status, True, True

    def end(self) -> NoReturn:
        """Leave without a further step of Python, and end child processes."""
        if not self.working:
            with suppress(OSError):
                os.write(2, b"scengen: interrupted; the command had not started\n")
        end_children()
        os._exit(self.status)


def end_children() -> None:
    """Kill the child processes and theirs: a worker that is still importing modules does not end with its parent yet,
    and agents of Ray outlive its servers by half a minute."""
    found = [os.getpid()]
    for process in found:  # grows while it is read
        for path in Path(f"/proc/{process}/task").glob("*/children"):
            with suppress(OSError):
                found += map(int, path.read_text().split())
    for process in found[1:]:
        with suppress(OSError):
            os.kill(process, signal.SIGKILL)


def run(argv: Sequence[str], signals: Signals | None = None) -> int:
    """Run one command.

    Returns:
        Exit status: 0 success, 1 a check failed, 2 bad input or a fault of the machine, 3 no verdict, 130 interrupted.
    """
    if isinstance(argv, str) or not all(isinstance(word, str) for word in argv):
        what = f"{cut(argv)!r}" if isinstance(argv, str) else repr(next(w for w in argv if not isinstance(w, str)))
        _print_error(f"scengen: {cut(what)}; give the command as a list of texts, as in ['tasks', 'task=packing']")
        return BAD_INPUT
    try:
        return _run(argv, signals)
    except KeyboardInterrupt:
        return _interrupted(argv)
    except Exception as error:
        if signals and signals.received:  # OmegaConf for one raises an error of its own when it cleans up after Ctrl-C
            return _interrupted(argv)
        return _status_of(error)


def _interrupted(argv: Sequence[str]) -> int:
    continues = parsed(argv)[0] in CONTINUING
    remedy = "finished work is kept; repeat the command to continue" if continues else "repeat it to start over"
    _print_error(f"scengen: interrupted; {remedy}")
    return INTERRUPTED


def _status_of(error: Exception) -> int:
    """Print an error in one line. Returns the exit status."""
    place = place_of(error)
    if isinstance(error, ForeignCode):
        return _failed(str(error), _write_traceback(error))
    if isinstance(error, ScengenError):
        status = _failed(f"{place}: {error}" if place else str(error))
        return DECLINED if isinstance(error, OtherVersions) else status
    if isinstance(error, MemoryError) or NO_MEMORY in str(error):
        return _failed(OUT_OF_MEMORY, _write_traceback(error))
    if isinstance(error, OSError):
        from ..work.targets import remedy as disk_remedy

        if what := disk_remedy(error):
            return _failed(f"{cut(str(error.filename or 'a file'))}: {what}")
    failed = (frame.f_globals.get("__name__") for frame, _ in traceback.walk_tb(error.__traceback__))
    if "mujoco" not in sys.modules and "mujoco" in failed and (chosen := os.environ.get("MUJOCO_GL")):
        remedy = "install what it needs (on Debian libegl1 libgl1 libosmesa6), or unset MUJOCO_GL"
        return _failed(f"MuJoCo cannot draw with MUJOCO_GL={cut(chosen)} ({cut(str(error), 80)}); {remedy}")
    return _unforeseen(error, place)


def _run(argv: Sequence[str], signals: Signals | None) -> int:
    _warn_of_platform()
    if argv[:1] == ["help"] and len(argv) > 1:
        argv = [*argv[1:], "--help"]
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(_help())
        return OK
    if argv[0] in RENAMED:
        _print_error(f"scengen: `{argv[0]}` is now `{RENAMED[argv[0]]}`; the old name goes with 0.4")
    verb, arguments = parsed(argv)
    if verb == "--version":
        from ..installation import versions

        print(" ".join(f"{k} {v}" for k, v in versions().items()))
        return OK
    if verb not in (*VERBS, *COMPLETING):
        raise _unknown(verb, arguments)

    from ..samplers.task_files import ORIGINS
    from .usage import usage

    if {"-h", "--help"} & set(arguments) and verb in VERBS:
        print(usage(verb, [a for a in arguments if not a.startswith("-")]), end="")
        return OK

    # These modules take seconds to import on a busy machine; nothing above needs them.
    from ..control import compilation, native
    from .commands import out
    from .completion import BASH, completions

    compilation.announce()
    native.silence()  # MuJoCo's warnings are counted and reported; it would also print them and write a log file
    if verb == "--completion":
        if arguments != ["bash"]:
            raise BadConfig(f"{cut(' '.join(argv))}; expected --completion bash; other shells are not supported")
        out.print(BASH, end="", soft_wrap=True)
        return OK
    if verb == "--complete":
        out.print("\n".join(completions(" ".join(arguments), VERBS)), soft_wrap=True)
        return OK
    arguments = [a for a in arguments if a not in ("-m", "--multirun")]  # multiple values say it by themselves
    flags = [a for a in arguments if a.startswith("-")]
    if flags and flags[0].partition("=")[0] in SHOW_OPTIONS:
        return _show(verb, arguments)
    if flags and flags[0].partition("=")[0] in ("--config-dir", "-cd", "--config-path", "-cp"):
        raise BadConfig(
            f"{flags[0]} is not an option of scengen; give hydra.searchpath=FOLDER, which is searched as well"
        )
    if flags:
        known = "settings are key=value, options --help, --cfg job and --info " + "|".join(ORIGINS)
        raise BadConfig(f"{cut(repr(flags[0]))} is not an option; {known}; see scengen {verb} --help")
    command = import_module(f"scengen.cli.commands.{file_stem(verb)}").command
    if signals:
        signals.working = True
    return command(arguments)


def _unknown(verb: str, arguments: Sequence[str]) -> BadConfig:
    """Reason why the beginning of a command line names no command."""
    if verb in FORMS:
        given = next((cut(repr(word)) for word in arguments if not word.startswith("-")), "nothing")
        forms = FORMS[verb]
        return BadConfig(
            f"{verb} needs one of {', '.join(forms)} after it, and got {given}; see scengen {verb} {forms[0]} --help"
        )
    return BadConfig(f"no command named {cut(repr(verb))}{nearest(verb, COMMANDS)}; known: {', '.join(COMMANDS)}")


def _warn_of_platform() -> None:
    """Print a line on a platform on which scengen was never tried."""
    if sys.platform != "linux":
        limits = "workers have no limit of memory, and a killed command may leave some behind"
        _print_error(f"scengen: not tried on {sys.platform}: {limits}; on Linux, or in its Dockerfile, all tests pass")


SHOW_OPTIONS = {"-c": "--cfg", "--cfg": "--cfg", "-i": "--info", "--info": "--info"}
"""Hydra's options that show a configuration, by their spellings."""


def _show(verb: str, arguments: Sequence[str]) -> int:
    """Print the configuration of a command, or its origin: `--cfg job`, `--info defaults`."""
    from .. import compose
    from .commands import out

    words = list(arguments)
    place = next(i for i, word in enumerate(words) if word.startswith("-"))
    option, _, what = words.pop(place).partition("=")
    if not what and place < len(words) and "=" not in words[place]:
        what = words.pop(place)
    words = [word for word in words if word != "--resolve"]  # what is printed is resolved
    if any(word.partition("=")[0] in ("-p", "--package") for word in words):
        raise BadConfig(f"{option} shows the whole configuration; leave -p out")
    if others := [word for word in words if word.startswith("-")]:
        raise BadConfig(f"{cut(repr(others[0]))} cannot be combined with {option}; give one of them")
    if SHOW_OPTIONS[option] == "--info":
        compose.print_origin(verb, words, what)
    elif what == "job":
        out.print(compose.as_yaml(verb, words), end="", soft_wrap=True)
    elif what in ("hydra", "all"):
        job = compose.as_yaml(verb, words) if what == "all" else ""
        out.print(job + compose.hydra_yaml(verb, words), end="", soft_wrap=True)
    else:
        raise BadConfig(
            f"{option} {cut(repr(what))}; expected --cfg job, the configuration of the command, hydra or all"
        )
    return OK


def _print_error(text: str) -> None:
    """Print one line on standard error; control characters are spelled out."""
    from ..work.printed import printable

    words = re.sub(r"\S{1000,}", lambda found: cut(found[0]), printable(text))
    if len(words) > MAX_LINE:  # the remedy is at the end
        words = f"{words[: MAX_LINE // 2]} ... {words[-MAX_LINE // 2 :]}"
    print(words, file=sys.stderr, flush=True)


def print_warning(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
    """Print a warning as a line of the command line, and one that is meant for programmers as Python does."""
    if issubclass(category, UserWarning):
        _print_error(f"scengen: {message}")
    else:
        print(warnings.formatwarning(message, category, filename, lineno), end="", file=sys.stderr)


def _failed(text: str, file: str = "") -> int:
    """Print an error and where its traceback is.

    Returns:
        Exit status.
    """
    _print_error(f"scengen: {text}{f'; the traceback is in {file}' if file else ''}")
    return BAD_INPUT


def _unforeseen(error: Exception, place: str) -> int:
    """Print an error that no check has foreseen, as one line too.

    Args:
        place: place in code that is not scengen's from which it comes; empty if there is none.
    """
    what = f"{type(error).__name__}: {cut(' '.join(str(error).split()))}"
    file = _write_traceback(error) or "(no file: no room)"
    if place:
        return _failed(f"{place}: {what}; this is not scengen's code", file)
    return _failed(f"unforeseen {what}; please report it", file)


def _write_traceback(error: BaseException) -> str:
    """Write a traceback to a temporary file.

    Returns:
        Name of the file; empty if it cannot be written.
    """
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="scengen-", suffix=".txt", delete=False, errors="backslashreplace"
        ) as file:
            traceback.print_exception(error, file=file)
            return file.name
    except (OSError, MemoryError):
        return ""


def _help() -> str:
    """The commands by purpose, each with the docstring of its module and its forms."""
    from .usage import columns

    room = columns()

    def about(verb: str) -> str:
        start = f"  {verb:<{NAMES - 3}} "
        hang = " " * NAMES
        return textwrap.fill(_purpose(verb), room, initial_indent=start, subsequent_indent=hang)

    lines = ["scengen: physical puzzles for robot manipulation, each verified to be solvable", ""]
    lines += ["usage: scengen COMMAND [key=value ...]", "settings of a command: scengen help COMMAND", ""]
    for purpose, verbs in GROUPS.items():
        lines.append(f"{purpose}:")
        for verb in verbs:
            forms = [f"{verb} {form}" for form in FORMS.get(verb, ())]
            lines += map(about, forms if verb in ONLY_FORMS else [verb, *forms])
        lines.append("")
    lines.append("example: scengen generate task=domino_single split=low_starter n=20")
    lines.append('completion in bash: eval "$(scengen --completion bash)"')
    return "\n".join(lines)


NAMES = 23
"""Width of the column of commands in the help [characters]."""


def _purpose(verb: str) -> str:
    """Docstring of the module of a command."""
    path = Path(__file__).parent / "commands" / f"{file_stem(verb)}.py"
    return ast.get_docstring(ast.parse(path.read_text())) or ""
