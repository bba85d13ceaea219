"""One pool, one checker, one process: what came of it.

A checker runs in a child with an empty working folder, which is ended when it takes too long. Whatever does not end
with exit status 0 to 3, in time, without a traceback, within its memory, without a file left behind or a process
left running, is a crash of the checker and counts against it.
"""

import json
import os
import re
import resource
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree

from checkers import CHECKERS, CONTROLS
from forgery import Case

LIMIT = 60
"""How much processor time a checker may take for one pool [s]; three times that at level full."""
PATIENCE = 5
"""How much a control may take [s]: they hang where nobody looks."""
BUSY = 4
"""How much longer that may take on a busy machine."""
MEMORY = 1500
"""How much memory it may use [MB]."""
VERDICTS = {0: "accept", 1: "reject", 2: "decline", 3: "decline"}
MEANT = {"refuse": ("reject", "decline"), "end": ("accept", "reject", "decline")}
"""Verdicts that will do where more than one will."""


@dataclass(frozen=True)
class Outcome:
    """What a checker made of one pool."""

    name: str
    kind: str
    expect: str
    verdict: str
    """`accept`, `reject`, `decline` or `crash`."""
    why: str
    """What a crash was; or what is wrong with the verdict or its reason; empty if all is well."""
    text: str
    """What the checker said."""
    wall: float
    cpu: float
    """[s]"""
    memory: float
    """Largest memory of a process [MB]."""

    def __str__(self) -> str:
        return f"{self.verdict:<8}{self.name} {self.why} ({self.cpu:.1f} s, {self.memory:.0f} MB)"

    @property
    def right(self) -> bool:
        """Whether the verdict is one of those that are expected."""
        return self.verdict in MEANT.get(self.expect, (self.expect,))

    @property
    def noticed(self) -> bool:
        """Of a pool that is not sound: whether it was kept out, for whatever reason."""
        return self.verdict in ("reject", "decline")


def attempt(case: Case, pool: Path, checker: str) -> Outcome:
    """Let a checker judge one pool in a separate process."""
    before = _listing(pool)
    with tempfile.TemporaryDirectory() as scratch:
        here, told = Path(scratch, "here"), Path(scratch, "told")
        here.mkdir()
        start = time.monotonic()
        child = os.fork()
        if child == 0:
            _judge(case, pool, checker, here, told)
        patience = 1 if checker in CONTROLS else BUSY
        status, usage = _ended(child, start + patience * _limit(case, checker))
        wall = time.monotonic() - start
        text = told.read_text(errors="replace").replace(str(pool), "POOL") if told.exists() else ""
        verdict, why = _verdict(status, text)
        memory = usage.ru_maxrss / 1000 if usage else 0.0
        left = _survivors(child)
        if left and status is not None:
            verdict, why = "crash", f"{len(left)} processes were left running"
        elif files := sorted(path.name for path in here.iterdir() if path.stem != "out"):
            verdict, why = "crash", f"wrote {', '.join(files)}"
        elif broken := _broken(here):
            verdict, why = "crash", broken
        elif _listing(pool) != before:
            verdict, why = "crash", "changed the pool"
        elif memory > MEMORY:
            verdict, why = "crash", f"used {memory:.0f} MB"
        cpu = usage.ru_utime + usage.ru_stime if usage else wall
    outcome = Outcome(case.name, case.kind, case.expect, verdict, why, text[:4000], wall, cpu, memory)
    return outcome if why else _compared(outcome, case)


def _limit(case: Case, checker: str) -> int:
    if checker in (*CONTROLS, "replay"):
        return PATIENCE
    return 3 * LIMIT if case.level == "full" or checker == "robosuite" else LIMIT


def _compared(outcome: Outcome, case: Case) -> Outcome:
    if not outcome.right:
        return Outcome(**{**asdict(outcome), "why": f"{outcome.verdict} instead of {case.expect}"})
    if not re.search(case.says, outcome.text, re.I | re.S):
        return Outcome(**{**asdict(outcome), "why": f"does not say {case.says}"})
    return outcome


def _judge(case: Case, pool: Path, checker: str, here: Path, told: Path) -> None:
    """In the child: never returns."""
    status = 99
    try:
        os.setsid()
        os.chdir(here)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, 2 * (_limit(case, checker),))
        out = os.open(told, os.O_WRONLY | os.O_CREAT)
        os.dup2(out, 1)
        os.dup2(out, 2)
        sys.path[:0] = [str(here), str(pool)]  # as after `python -m`: who imports what a pool names, finds it
        status = CHECKERS[checker](pool, case.level, case.arguments)
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(status if isinstance(status, int) and 0 <= status < 99 else 99)


def _ended(child: int, deadline: float) -> tuple[int | None, resource.struct_rusage | None]:
    """Exit status and use of a child; None if it had to be ended."""
    while True:
        done, status, usage = os.wait4(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), usage
        if time.monotonic() > deadline:
            os.killpg(child, signal.SIGKILL)
            os.wait4(child, 0)
            return None, None
        time.sleep(0.005)


def _verdict(status: int | None, text: str) -> tuple[str, str]:
    if status in (None, -signal.SIGXCPU, -signal.SIGKILL):
        return "crash", "did not end in time"
    if "Traceback (most recent call last)" in text:
        return "crash", text.strip().splitlines()[-1][:200]
    if "\x1b" in text or "\x07" in text:
        return "crash", "lets control characters through"
    if status not in VERDICTS:
        return "crash", f"ended with status {status}"
    return VERDICTS[status], ""


def _broken(here: Path) -> str:
    """What is wrong with the reports that a checker has written, if it has: they are for other programs."""
    try:
        for path in here.glob("out.*"):
            if read := {".json": json.loads, ".xml": ElementTree.fromstring}.get(path.suffix):
                read(path.read_text())
    except (ValueError, ElementTree.ParseError) as error:
        return f"writes a report that nobody can read: {error}"
    return ""


def _survivors(session: int) -> list[int]:
    """Processes of a child's session that still run; they are ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, _, _, its = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
            except OSError:
                continue
            if int(its) == session and state != "Z":
                found.append(int(entry.name))
                os.kill(int(entry.name), signal.SIGKILL)
    return found


def _listing(pool: Path) -> list[tuple[str, int, int]]:
    return sorted((path.name, path.lstat().st_size, path.lstat().st_mtime_ns) for path in pool.iterdir())
