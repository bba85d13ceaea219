"""Kills runs in every way and compares what they make in the end: `python tests/fuzz/kills.py 50 [seed] [demos] [ray]`.

A run of `scengen generate`, or with `demos` of `scengen demos`, is begun, killed after a random time, and continued
until it ends. Its folder must have the bytes of one that was made without a break, and no process may stay. A kill
that comes too late, after the end, is not counted. With `ray`, the runs that are killed work on a cluster of this
machine (`executor.address=local`), and are finished without it.
"""

import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
WAYS = ("SIGKILL", "SIGTERM", "SIGINT", "worker", "disk")
"""Kill the group; tell the run to stop; press Ctrl-C; kill one worker; let no file grow beyond a size."""
QUICKLY = ("certify.robust.runs=1", "certify.robust.bound=0.04")
ON_RAY = ("executor=ray", "executor.address=local")
"""Settings of a run on a cluster of this machine."""
RAY_LEAVES = 30.0
"""Time in which the processes of Ray end after those that they work for [s]."""


@dataclass(frozen=True)
class Kind:
    """A kind of run."""

    words: tuple[str, ...]
    """Command and settings."""
    target: str
    """Name of the setting for the folder."""
    summary: str
    """File of the folder that holds the hashes of all others."""


KINDS = {
    "generate": Kind(("generate", "n=3", *QUICKLY), "pool", "manifest.json"),
    "demos": Kind(("demos", "n=30", "keep=[failed]"), "to", "demonstrations.json"),
}


def start(
    kind: Kind, folder: Path, workers: int, limit: int | None = None, more: Sequence[str] = ()
) -> subprocess.Popen[str]:
    """Start or continue a run, in a process group of its own."""

    def prepare() -> None:
        os.setsid()
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    argv = [sys.executable, "-m", "scengen", *kind.words, "task=domino_single"]
    return subprocess.Popen(
        [*argv, *more, f"workers={workers}", f"{kind.target}={folder}"],
        cwd=ROOT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
    )


def group(leader: int) -> list[int]:
    """Living processes of a process group besides its leader."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, pgrp = stat.read_text().rpartition(")")[2].split()[:3]
            if int(pgrp) == leader and state != "Z" and int(stat.parent.name) != leader:
                found.append(int(stat.parent.name))
    return found


def hit(kind: Kind, folder: Path, way: str, after: float, workers: int, more: Sequence[str] = ()) -> str | None:
    """Start or continue a run and kill it. What went wrong, or nothing; None if it had ended before."""
    before = set(folder.parent.rglob("*.part"))
    process = start(kind, folder, workers, int(20_000 + 10_000 * after) if way == "disk" else None, more)
    if way != "disk":
        with suppress(subprocess.TimeoutExpired):
            process.wait(after)
    late = process.poll() is not None
    if not late:
        with suppress(ProcessLookupError):
            if way == "SIGKILL":
                os.killpg(process.pid, signal.SIGKILL)
            elif way == "SIGTERM":
                process.terminate()
            elif way == "SIGINT":
                os.killpg(process.pid, signal.SIGINT)
            elif way == "worker":
                late = not (workers_alive := group(process.pid))
                for worker in workers_alive[-1:]:
                    os.kill(worker, signal.SIGKILL)
    _, told = process.communicate()
    end = time.monotonic() + (RAY_LEAVES if more else 0.3)
    while time.monotonic() < end and (not more or group(process.pid)):
        time.sleep(0.1)
    if left := group(process.pid):
        return f"processes stay: {left}"
    lines = [line for line in told.splitlines() if line.startswith("scengen") and "a Ray cluster" not in line]
    if "Traceback" in told or len(lines) > 1 or "damaged" in told:
        return f"said {told[-600:]!r}"
    if way != "SIGKILL" and set(folder.parent.rglob("*.part")) - before:
        return "a .part is left"
    return None if late or (way == "disk" and process.returncode == 0) else ""


def finish(kind: Kind, folder: Path) -> bytes:
    """Continue a run to its end; the file that holds the hashes of all others."""
    process = start(kind, folder, workers=1)
    _, told = process.communicate()
    if process.returncode != 0:
        raise RuntimeError(f"the run does not go on: {told[-600:]}")
    return (folder / kind.summary).read_bytes()


def run(kind: Kind, kills: int, seed: int = 0, each: int = 3, more: Sequence[str] = ()) -> list[str]:
    """Kill runs, at most `each` times every folder, until so many kills have hit; what went wrong."""
    pick, wrong = random.Random(seed), []
    hits: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        begun = time.monotonic()
        whole = finish(kind, Path(folder, "whole"))
        seconds, pools = time.monotonic() - begun, 0
        if more:
            seconds += 8.0  # until a cluster has started
        ways = [way for way in WAYS if not (more and way == "disk")]  # Ray's own files would not grow, either
        while hits.total() < kills:
            pools += 1
            pool = Path(folder, f"pool{pools}")
            for _ in range(min(each, kills - hits.total())):
                way, after = min(ways, key=lambda name: (hits[name], name)), pick.uniform(0.1, seconds)
                fault = hit(kind, pool, way, after, workers=pick.choice((1, 2)), more=more)
                hits[way] += fault is not None
                if fault:
                    wrong.append(f"{way} after {after:.1f} s: {fault}")
                    print(wrong[-1], flush=True)
            try:
                if finish(kind, pool) != whole:
                    wrong.append(f"pool {pools}: other bytes")
            except RuntimeError as error:
                wrong.append(f"pool {pools}: {error}")
            print(f"{hits.total()} of {kills} kills, {len(wrong)} ended badly", flush=True)
    print(f"{pools} pools; {', '.join(f'{count} by {way}' for way, count in sorted(hits.items()))}")
    return wrong


def main() -> int:
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    more = ON_RAY if "ray" in sys.argv else ()
    wrong = run(KINDS["demos" if "demos" in sys.argv else "generate"], *numbers, more=more)
    print("\n".join(wrong))
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
