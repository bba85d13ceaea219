"""Measure the cost of large pools: each command that reads pools, in a separate process, as a table.

    python tools/large_pools.py POOL [POOL ...]

The pools are those of `tools/synthetic_pool.py`, of several sizes. Told are processor time, the largest memory of any
process, and size of the page or the pool that was written; for the access to one row the longest and the median of a
hundred rows that are chosen at random. The last column is the processor time of a further thousand scenarios, between
the smallest and the largest pool.
"""

import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from scengen.envs.gym import PoolEnv
from scengen.pool import Pool

COMMANDS = {
    "show": "show pool={pool}",
    "show id=": "show pool={pool} id={id}",
    "show to=, 10 images": "show pool={pool} to={to}.html images=10",
    "report": "report pool={pool} to={to}.html",
    "compare": "compare pool={pool}",
    "audit": "audit pool={pool}",
    "subset n=100": "subset pool={pool} n=100 to={to}",
    "evaluate, 5 scenarios": "evaluate pool={pool} policy=idle seeds=5 rollouts=1 to={to}",
    "record n=2": "record pool={pool} n=2 cameras=none to={to}",
    "verify sample=10 others=skip": "verify pool={pool} level=replay sample=10 others=skip",
}
ROWS = 100
"""Number of rows that are read one by one."""


def measured(command: list[str]) -> tuple[float, float]:
    """Processor time [s] and largest memory [MB] of a command and its workers."""
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    told = child.stderr.read() if child.stderr else ""
    _, status, usage = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 1):  # 1: repetitions were found, or what is borrowed is refuted
        sys.exit(f"{' '.join(command)} has failed: {told[-1000:]}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000


def accesses(folder: str) -> dict[str, list[float]]:
    """Times of operations in a process that has the pool open [ms]."""
    chosen, found = random.Random(0), dict[str, list[float]]()

    def timed(what: str, of: object) -> object:
        start = time.process_time()
        result = of()  # type: ignore[operator]
        found.setdefault(what, []).append(1000 * (time.process_time() - start))
        return result

    pool: Pool = timed("Pool.open", lambda: Pool.open(folder))  # type: ignore[assignment]
    timed("hashes of all shards", pool.check)
    timed("ids and indices of all rows", lambda: pool.directory)
    timed("the first row by id", lambda: pool.row(pool.directory.id(len(pool) // 2)))
    for _ in range(ROWS):
        place = chosen.randrange(len(pool))
        id_, index = pool.directory.id(place), int(pool.directory.indices[place])
        timed("a row by id", lambda id_=id_: pool.row(id_))
        timed("a row by index", lambda index=index: pool.of_index(index))
    env: PoolEnv = timed("PoolEnv", lambda: PoolEnv(pool.task, folder))  # type: ignore[assignment]
    for _ in range(10):
        timed("PoolEnv.reset", lambda: env.reset(seed=chosen.randrange(len(pool))))
    return found


def commands(folder: str) -> dict[str, str]:
    """Time, memory and output size of every command, as text."""
    found, id_ = {}, Pool.open(folder).directory.id(7)
    for what, command in COMMANDS.items():
        with tempfile.TemporaryDirectory() as scratch:
            to = f"{scratch}/out"
            seconds, megabytes = measured(
                [sys.executable, "-m", "scengen", *command.format(pool=folder, to=to, id=id_).split()]
            )
            page = Path(f"{to}.html")
            wrote = f", page {page.stat().st_size / 1e6:.1f} MB" if page.exists() else ""
        found[what] = (seconds, f"{seconds:.1f} s, {megabytes:.0f} MB{wrote}")
        print(f"{folder} {what}: {found[what][1]}", file=sys.stderr, flush=True)
    return found


def main(*folders: str) -> None:
    """Print the table."""
    sizes = [len(Pool.open(folder)) for folder in folders]
    print("| |", " | ".join(str(size) for size in sizes), "| CPU s per 1000 more |\n|---|" + "---:|" * (len(sizes) + 1))
    told = [commands(folder) for folder in folders]
    for what in COMMANDS:
        slope = (told[-1][what][0] - told[0][what][0]) / max(1, sizes[-1] - sizes[0]) * 1000
        print(f"| {what} | {' | '.join(t[what][1] for t in told)} | {slope:.3f} |", flush=True)
    # last, because a process counts the memory of the one that started it
    times = [accesses(folder) for folder in folders]
    for what in times[0]:
        cells = (f"{statistics.median(t[what]):.1f} ms (at most {max(t[what]):.1f})" for t in times)
        print(f"| {what} | {' | '.join(cells)} | |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
