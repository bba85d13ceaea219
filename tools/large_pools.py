"""Write large pools without certifying, and measure the cost of each command that reads pools.

    python tools/large_pools.py write generated/reference/domino_single-id 100000 /tmp/large [scenes]
    python tools/large_pools.py measure POOL [POOL ...]

`write` draws scenarios as in a run, with copies of certificates. Each row has the id, the parameters and the twin that
its index gives, so that a pool can be drawn again. Its witness is that of a row of the source, every action smaller by
some millionths, so that no two rows pack into each other; hashes are those of what the row holds. Its scene is the
source's too, or with `scenes` its own, which takes 2 ms more. The manifest counts what was drawn. `scengen verify` must
refute such rows: by their scenes, or, where those are built, by witnesses that were never played in them.

`measure` runs each command in a process of its own, on such pools of several sizes, and prints a table: processor time,
the largest memory of any process, and size of the page or the pool that was written; for the access to one row the
longest and the median of a hundred rows that are chosen at random. The last column is the processor time of a further
thousand scenarios, between the smallest and the largest pool.
"""

import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scengen.certificate import STAGES, Check
from scengen.envs.gym import PoolEnv
from scengen.errors import Infeasible
from scengen.ood.analysis.redraw import task_of
from scengen.params import values
from scengen.pool import Pool, PoolRow
from scengen.pool.files import sha256
from scengen.pool.writing import write_shards
from scengen.samplers.task import Draw
from scengen.validate.rebuilt import rebuild

LESS = 2.0**-22
"""Relative difference of the actions of successive rows; single precision resolves 2^-24."""


def synthetic(source: Pool, n: int, to: Path, scenes: bool = False) -> Pool:
    """Write the scenarios of the first n indices that have a feasible one, with the certificates of the source.

    Args:
        scenes: whether each row has the scene of its own parameters.
    """
    about: dict[str, Any] = {}
    entries = write_shards(to, _rows(source, n, scenes, about))
    replace(source.manifest.without_files(), shards=entries, **about).write(to)
    return Pool.open(to)


def _rows(source: Pool, n: int, scenes: bool, about: dict[str, Any]) -> Iterator[PoolRow]:
    """The rows one after the other; when all are made, `about` is told what its manifest counts."""
    models, infeasible, first, proposed = list(source.rows()), Counter[str](), 0, 0
    task, config = task_of(source), source.manifest.config
    design, index, made = task.design(config.sampler), -1, 0
    while made < n:
        index += 1
        try:
            draw = task.draw(config.split, config.seed, index, design)
        except Infeasible as error:
            infeasible.update(error.reasons)
            proposed += error.tries
            continue
        infeasible.update(draw.rejected)
        proposed += draw.attempt + 1
        first += draw.attempt == 0
        yield _row(models[made % len(models)], draw, 1 - LESS * made, scenes)
        made += 1
    about |= {
        "n": n,
        "indices": index + 1,
        "first_draws": first,
        "funnel": {"proposed": proposed} | dict.fromkeys(STAGES, n),
        "reasons": {f"feasible: {why}": times for why, times in infeasible.items()},
    }


def _row(model: PoolRow, draw: Draw, share: float, scenes: bool) -> PoolRow:
    """A scenario with the certificate of another one."""
    witness = (model.witness * np.float32(share)).astype(np.float32)
    scene = rebuild(draw.scenario) if scenes else model.scene_xml
    hashes = {"scene_sha256": sha256(scene), "witness_sha256": sha256(witness.tobytes())}
    features = draw.scenario.features()
    checks = tuple(_with(features, check) if check.name == "feasible" else check for check in model.certificate.checks)
    return replace(
        model,
        id=draw.scenario.id,
        index=draw.index,
        attempt=draw.attempt,
        id_twin=draw.id_twin,
        shifted=draw.shifted,
        params=values(draw.scenario),
        scene_xml=scene,
        witness=witness,
        certificate=replace(model.certificate, checks=checks, **hashes),
        **hashes,
    )


def _with(numbers: Mapping[str, Any], check: Check) -> Check:
    return replace(check, numbers=numbers)


def write(source: str, n: str, to: str, *others: str) -> None:
    """Write a pool and say how large it is."""
    pool = synthetic(Pool.open(source), int(n), Path(to), "scenes" in others)
    size = sum(entry.bytes for entry in pool.manifest.shards)
    print(f"{to}: {len(pool)} scenarios in {len(pool.manifest.shards)} shards, {size / 1e6:.0f} MB")


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


def measure(*folders: str) -> None:
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
    {"write": write, "measure": measure}[sys.argv[1]](*sys.argv[2:])
