"""Kills runs in every way and compares what they make: `python tests/fuzz/kills.py 40 [seed] [kind ... | all] [ray]`.

A run of each kind is begun, killed after a random time, and repeated until it ends. What it makes must have the bytes
of a run without a break, no process may stay, and nothing unfinished. A kill that comes too late, after the end, is not
counted. The kind `studio` judges episodes in a browser: each score that the page has shown must be in the table after
the kill. With `ray`, the runs that are killed work on a cluster of this machine (`executor.address=local`), and are
finished without it.
"""

import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]  # as a program it has only its own folder there
REFERENCE = ROOT / "generated" / "reference" / "domino_single-id"
WAYS = ("SIGKILL", "SIGTERM", "SIGINT", "worker", "disk")
"""Kill the group; tell the run to stop; press Ctrl-C; kill one worker; let no file grow beyond a size."""
ALONE = ("SIGKILL", "SIGTERM", "SIGINT")
"""Ways to kill a run that has no other processes, or whose files are small."""
QUICKLY = ("certify.robust.runs=1", "certify.robust.bound=0.04")
ON_RAY = ("executor=ray", "executor.address=local")
"""Settings of a run on a cluster of this machine."""
RAY_LEAVES = 30.0
"""Time in which the processes of Ray end after those that they work for [s]."""
MEASURED = re.compile(rb'"(cpu|waited|cpu_seconds)": [-+.0-9e]+')
"""Entries that are measured, and differ from run to run."""
LONGEST_START = 60.0
"""Longest time until the page of the studio can be used [s]."""


@dataclass(frozen=True)
class Kind:
    """A kind of run."""

    words: tuple[str, ...]
    """Command and settings. {demos}, {recording} and {pool} stand for what it may read."""
    target: str
    """Name of the setting for the folder."""
    made: tuple[str, ...]
    """Patterns of the files that are compared."""
    ways: tuple[str, ...] = ALONE
    workers: bool = False
    """Whether it has a setting for the number of processes."""
    starts_from: str = ""
    """What is copied to the folder before the first run, such as recording."""


SUMMARY = ("demonstrations.json",)
KINDS = {
    "generate": Kind(
        ("generate", "task=domino_single", "n=3", *QUICKLY), "pool", ("manifest.json",), WAYS, workers=True
    ),
    "demos": Kind(("demos", "task=domino_single", "n=30", "keep=[failed]"), "to", SUMMARY, WAYS, workers=True),
    "pad": Kind(("demos", "pad", "task=domino_single", "device=pads:Domino", "n=8"), "to", SUMMARY),
    "record": Kind(("record", "pool={demos}", "cameras=none"), "to", ("**/*.parquet", "**/*.json"), (*ALONE, "disk")),
    "curate": Kind(
        ("curate",), "data", ("curation/reports.jsonl", "curation/kept.json"), workers=True, starts_from="recording"
    ),
    "train": Kind(("train", "data={recording}", "epochs=40"), "to", ("policy.json", "weights.npz")),
    "evaluate": Kind(
        ("evaluate", "policy=oracle", "pool={pool}", "seeds=6", "rollouts=5"),
        "to",
        ("episodes.jsonl", "table.json"),
        workers=True,
    ),
    "agent": Kind(
        ("agent", "model=facts", "pool={pool}", "stage=2", "pictures=false"), "to", ("results-2.jsonl", "table-2.json")
    ),
    "attack": Kind(("attack", "task=domino_single", "n=3", "budget=150"), "to", ("attack.jsonl",), workers=True),
    "hub": Kind(("export", "hub", "pool={pool}"), "to", ("README.md", "*/*"), workers=True),
    "batch": Kind(("export", "pool={pool}", "format=batch", "layout=1"), "to", ("*.*", "meshes/*")),
    "subset": Kind(("subset", "pool={pool}", "n=3"), "to", ("manifest.json", "*.parquet")),
}
STUDIO = "studio"
"""Kind in which a person judges episodes on a page."""


@cache
def given() -> dict[str, str]:
    """Folders that runs read, made once: demonstrations and a recording of them."""
    folder = Path(tempfile.mkdtemp(prefix="scengen-kills-"))
    demos, recording = folder / "demos", folder / "recording"
    for words in (("demos", "task=domino_single", "n=6", f"to={demos}"), ("record", f"pool={demos}", "cameras=none")):
        more = [f"to={recording}"] if words[0] == "record" else []
        subprocess.run([*COMMAND, *words, *more], cwd=ROOT, env=environment(), check=True, capture_output=True)
    return {"demos": str(demos), "recording": str(recording), "pool": str(REFERENCE)}


COMMAND = (sys.executable, "-m", "scengen")


def environment() -> dict[str, str]:
    """Environment of a run, which finds the programs of the tests."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests")))}


def start(
    kind: Kind, folder: Path, workers: int, limit: int | None = None, more: Sequence[str] = ()
) -> subprocess.Popen[str]:
    """Start or continue a run, in a process group of its own."""

    def prepare() -> None:
        os.setsid()
        if limit:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    if kind.starts_from and not folder.exists():
        shutil.copytree(given()[kind.starts_from], folder)
    words = [word.format(**given()) if "{" in word else word for word in kind.words]
    return subprocess.Popen(
        [*COMMAND, *words, *more, *([f"workers={workers}"] if kind.workers else ()), f"{kind.target}={folder}"],
        cwd=ROOT,
        env=environment(),
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
    hints = ("a Ray cluster", "was not curated")
    lines = [each for each in told.splitlines() if each.startswith("scengen") and not any(h in each for h in hints)]
    if "Traceback" in told or len(lines) > 1 or "damaged" in told:
        return f"said {told[-600:]!r}"
    if way != "SIGKILL" and set(folder.parent.rglob("*.part")) - before:
        return "a .part is left"
    return None if late or (way == "disk" and process.returncode == 0) else ""


def finish(kind: Kind, folder: Path) -> bytes:
    """Continue a run to its end; the content of what it makes.

    Raises:
        RuntimeError: it does not go on, or something unfinished is left.
    """
    process = start(kind, folder, workers=1)
    _, told = process.communicate()
    if process.returncode != 0:
        raise RuntimeError(f"the run does not go on: {told[-600:]}")
    if left := [*folder.parent.glob("*.unfinished*"), *folder.rglob("*.part"), *folder.parent.glob(".trial-*")]:
        raise RuntimeError(f"left behind: {left}")
    paths = sorted({path for pattern in kind.made for path in folder.glob(pattern)})
    if not paths:
        raise RuntimeError("it has made nothing")
    return b"".join(MEASURED.sub(b"", path.read_bytes()) for path in paths)


def run(kind: Kind, kills: int, seed: int = 0, each: int = 3, more: Sequence[str] = ()) -> list[str]:
    """Kill runs, at most `each` times every folder, until so many kills have hit; what went wrong."""
    pick, wrong = random.Random(seed), []
    hits: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        given()
        begun = time.monotonic()
        whole = finish(kind, Path(folder, "whole"))
        seconds, pools = time.monotonic() - begun, 0
        if more:
            seconds += 8.0  # until a cluster has started
        ways = [way for way in kind.ways if not (more and way == "disk")]  # Ray's own files would not grow, either
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
                fault = "" if finish(kind, pool) == whole else "other bytes"
            except RuntimeError as error:
                fault = str(error)
            if fault:
                wrong.append(f"pool {pools}: {fault}")
                print(wrong[-1], flush=True)
            print(f"{kind.words[0]}: {hits.total()} of {kills} kills, {len(wrong)} ended badly", flush=True)
    print(f"{pools} pools; {', '.join(f'{count} by {way}' for way, count in sorted(hits.items()))}")
    return wrong


def judge(kills: int, seed: int = 0) -> list[str]:
    """Kill studios in which a person scores the first episode again and again; what went wrong."""
    from playwright.sync_api import sync_playwright
    from studio.browser import ARGUMENTS, installed

    pick, wrong = random.Random(seed), list[str]()
    with tempfile.TemporaryDirectory() as made, sync_playwright() as player:
        folder = Path(shutil.copytree(given()["recording"], Path(made, "recording")))
        subprocess.run([*COMMAND, "curate", f"data={folder}", "replay=false"], env=environment(), check=True)
        browser = player.chromium.launch(executable_path=installed(), args=ARGUMENTS)
        for number in range(kills):
            page = browser.new_page()
            page.set_default_timeout(1000 * LONGEST_START)
            fault = _judged_until_killed(folder, page, pick.randrange(3, 8), pick.choice(ALONE))
            page.close()
            wrong += [f"studio, kill {number}: {fault}"] if fault else []
        browser.close()
    print(f"studio: {kills} kills, {len(wrong)} ended badly", flush=True)
    return wrong


def _judged_until_killed(folder: Path, page: Any, presses: int, way: str) -> str:
    """Score the first episode some times in a studio, kill it while it writes, and look for the last score shown."""
    words = (*COMMAND, "studio", f"data={folder}", "port=0", "open=false")
    process = subprocess.Popen(words, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout and process.stderr
    line = process.stdout.readline()
    page.goto(line.split()[-1])
    page.get_by_text("episode 0:").wait_for()
    shown = 0
    for press in range(presses):
        score = 1 + (press + presses) % 5
        page.get_by_role("button", name=str(score), exact=True).click()
        if press < presses - 1:
            page.get_by_text(f"score {score} (person)").wait_for()
            shown = score
    process.send_signal(getattr(signal, way))
    told = process.communicate()[1]
    table = dict(line.split(",") for line in (folder / "curation" / "scores.csv").read_text().splitlines())
    wanted = {shown, 1 + (2 * presses - 1) % 5}  # the last click may have come too late
    if int(table["0"]) not in wanted:
        return f"{way}: the score is {table['0']}, the page has shown {shown}"
    return f"{way}: {told[-300:]}" if "Traceback" in told else ""


def main() -> int:
    numbers = [int(word) for word in sys.argv[1:] if word.isdecimal()]
    kills, seed = (*numbers, 0)[:2] if numbers else (40, 0)
    more = ON_RAY if "ray" in sys.argv else ()
    names = [word for word in sys.argv[1:] if word in (*KINDS, STUDIO)] or ["generate"]
    if "all" in sys.argv:
        names = [*KINDS, STUDIO]
    wrong = []
    for place, name in enumerate(names):
        own = kills // len(names) + (place < kills % len(names))
        wrong += judge(own, seed) if name == STUDIO else run(KINDS[name], own, seed, more=more)
    print("\n".join(wrong))
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
