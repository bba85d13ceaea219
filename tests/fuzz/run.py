"""Runs command lines of the grammar and judges how they end: `python tests/fuzz/run.py 2000 [seed]`."""

import contextlib
import importlib
import io
import os
import re
import resource
import shutil
import signal
import socket
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parents[1])]

from fuzz.grammar import Grammar  # noqa: E402
from scengen import cli  # noqa: E402
from scengen.cli.program import MAX_LINE  # noqa: E402
from scengen.cli.verbs import file_stem  # noqa: E402

REFERENCE = ROOT / "generated" / "reference" / "domino_single-id"
LIMIT = 60
"""Processor time of one command line [s]: more than any needs that does no work."""
WALL_LIMIT = 600
"""Wall-clock time of one command line [s], for one that waits."""
REMEDY = re.compile(
    r"did you mean|known: |expected |must |see scengen|see the |choose |name (a|an|the|it|one|another) |name=|give |"
    r"leave it|quote|make (it|room)|ask for|say |repeat |restore|generate the pool|is not an option|install|"
    r"accepts one pool|it accepts |correct |delete |wait for|needs (either )?\w+=|widen|wants a display"
)
"""Words with which an error says what would be right."""


class Work(BaseException):
    """The work itself starts: the command line was accepted."""


def judge(line: list[str], place: Path) -> str:
    """Run a command line; what is wrong with how it ends, or nothing."""
    before = tree(place)
    out, err = io.StringIO(), io.StringIO()
    with _shown(out, err), _alarm():
        try:
            status: int | str = cli.run(line)
        except Work:
            status = 0
        except BaseException:
            return f"escaped: {traceback.format_exc().splitlines()[-1][:300]}"
    told = err.getvalue()
    errors = [x for x in told.split("\n") if x and not re.match(r".*: \d+ of \d+", x)]
    if status not in (0, 1, 2, 3):
        return f"status {status}: {told[:300]}"
    if status == 2 and len(errors) != 1:
        return f"{len(errors)} lines of error: {told[:500]}"
    if re.search(r"\w+Warning: ", told):
        return f"a warning of Python: {told[:300]}"
    if "Traceback" in told + out.getvalue() or "unforeseen" in told:
        return f"unforeseen: {told[:500]}"
    if status == 2 and not REMEDY.search(told):
        return f"no remedy: {told[:300]}"
    if any(len(x) > MAX_LINE + 100 for x in errors):
        return f"a line of {max(map(len, errors))} letters"
    if re.search("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", told + out.getvalue()):
        return f"control characters: {told[:300]!r}"
    left = tree(place) - before
    if status == 2 and left:
        return f"left behind: {sorted(left)[:5]}"
    return ""


def tree(place: Path) -> set[str]:
    """Everything around the folder of targets: the pool, the working folder, tracebacks."""
    return {str(p) for p in place.parent.rglob("*")}


@contextlib.contextmanager
def playground() -> Iterator[Path]:
    """A working folder with targets that cannot be written, and work that ends the command at once."""
    here = Path.cwd()
    with tempfile.TemporaryDirectory(prefix="fuzz") as made, contextlib.ExitStack() as stack:
        place = Path(made, "place")
        (place / "folder").mkdir(parents=True)
        (place / "file").write_text("a file")
        os.mkfifo(place / "pipe")
        (place / "loop").symlink_to(place / "loop")
        (place / "dangling").symlink_to("/nowhere/at/all")
        (place / "cut").mkdir()
        (place / "cut" / "manifest.json").write_text("{")
        shutil.copytree(REFERENCE, Path(made, "pool"))
        _strange(place)
        (Path(made, "cwd")).mkdir()
        stack.callback(os.chdir, here)
        os.chdir(Path(made, "cwd"))
        stack.enter_context(mock.patch.object(tempfile, "tempdir", made))
        for verb in cli.VERBS:  # a command that is first imported now would keep what takes the place of its work
            importlib.import_module(f"scengen.cli.commands.{file_stem(verb)}")
        for name in WORK if robosuite_runs() else set(WORK) - ROBOSUITE_WORK:
            stack.enter_context(mock.patch(name, side_effect=Work))
        try:
            yield place
        finally:
            shutil.rmtree(place, ignore_errors=True)


MARKED = {
    "pool": "manifest.json",
    "recording": "meta/info.json",
    "demonstrations": "demonstrations.json",
    "policy": "policy.json",
    "run": "settings.json",
}
"""Folders of commands by their kind, with the file that is read first."""


def _strange(place: Path) -> None:
    """Make a recording, demonstrations, and files that wait, never end, or stand for others."""
    (place / "pointer.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n")
    _sparse(place / "sparse")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(place / "socket"))
    for kind, mark in MARKED.items():
        piped, sparse = place / "piped" / kind / mark, place / f"sparse_{kind}" / mark
        for path in (piped, sparse):
            path.parent.mkdir(parents=True)
        os.mkfifo(piped)
        _sparse(sparse)
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        assert cli.run(["record", f"pool={REFERENCE}", f"to={place / 'recording'}", "cameras=none", "n=2"]) == 0
        assert cli.run(["demos", "task=domino_single", "n=1", f"to={place / 'demonstrations'}"]) == 0
    shutil.copytree(REFERENCE, place / "both")
    shutil.copytree(place / "demonstrations", place / "both", dirs_exist_ok=True)


def _sparse(path: Path) -> None:
    """Make a file of a terabyte that needs no room."""
    with open(path, "wb") as file:
        file.truncate(10**12)


def robosuite_runs() -> bool:
    """Whether robosuite's environments run here."""
    try:
        importlib.import_module("scengen.envs.robosuite_models")
    except ImportError:
        return False
    return True


WORK = (
    "scengen.validate.certify.certify",
    "scengen.runs.attempts.each",
    "scengen.evaluate.rollouts.each",
    "scengen.evaluate.scenarios.unplayable",
    "scengen.export.recording.unplayable",
    "scengen.validate.verify.pools.verify",
    "scengen.cli.commands.verify.verify",
    "scengen.cli.commands.verify_mujoco.environment",
    "scengen.cli.commands.attack.attack",
    "scengen.cli.commands.bench.bench",
    "scengen.cli.commands.axis_shrink.certify",
    "scengen.cli.commands.try._played",
    "scengen.cli.commands.axis_card.make_axis_card",
    "scengen.cli.commands.edition.differences",
    "scengen.cli.commands.measure.measure",
    "scengen.cli.commands.axis_discover.discover",
    "scengen.cli.commands.axis_cues.audit",
    "scengen.export.recording._writer",
    "scengen.export.hub.publish",
    "scengen.envs.agreement.compare_all",
    "scengen.pictures.film.Take.moments",
    "scengen.pictures.view.view",
    "scengen.studio.app.Studio",
    "scengen.cli.commands.asset.encode",
    "scengen.intake.asset.make_asset",
    "scengen.agents.runner.exams",
    "scengen.demos.generate.generate_demonstrations",
    "scengen.cli.commands.demos.generate_demonstrations",
    "scengen.demos.curate.curation._examined",
    "scengen.cli.commands.train.train",
    "scengen.demos.teleop.collect.Run",
    "scengen.cli.commands.demos_pad.Run",
    "scengen.evaluate.remote.servers.Server._reach",
)
"""Where work starts that takes seconds: a command line that gets so far has been accepted."""
ROBOSUITE_WORK = {"scengen.envs.agreement.compare_all"}
"""Those of them that cannot be imported without robosuite."""


@contextlib.contextmanager
def _shown(out: io.StringIO, err: io.StringIO) -> Iterator[None]:
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):  # rich asks for the stream at every line
        yield


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    def over(*_: object) -> None:
        raise TimeoutError(f"no end within {LIMIT} s of processor time, or {WALL_LIMIT} s")

    before = {number: signal.signal(number, over) for number in (signal.SIGALRM, signal.SIGPROF)}
    signal.alarm(WALL_LIMIT)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        for number, handler in before.items():
            signal.signal(number, handler)


def run(count: int, seed: int) -> list[tuple[list[str], str]]:
    """Judge as many command lines; those that end badly, with what is wrong."""
    bad = []
    with playground() as place:
        grammar = Grammar(seed, place.parent / "pool", place)
        for _ in range(count):
            line = grammar.line()
            if wrong := judge(line, place):
                bad.append((line, wrong))
            for left in (place / "new", place / "é"):
                shutil.rmtree(left, ignore_errors=True)
    return bad


def main() -> int:
    count, seed = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    resource.setrlimit(resource.RLIMIT_AS, (8_000_000_000, 8_000_000_000))
    start = time.process_time()
    bad = run(count, seed)
    for line, wrong in bad:
        print(" ".join(x if len(x) < 100 else f"{x[:60]}...({len(x)})" for x in line).encode("unicode_escape").decode())
        print(f"    {wrong.encode('unicode_escape').decode()}")
    spent = time.process_time() - start
    print(f"{len(bad)} of {count} command lines end badly; seed {seed}, {spent:.0f} CPU s")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
