"""Write a pool of any size without certifying: scenarios are drawn as in a run, certificates are copies.

    python tools/synthetic_pool.py generated/reference 100000 /tmp/large [scenes]

Each row has the id, the parameters and the twin that its index gives, so that a pool can be drawn again. Its witness is
that of a row of the source, every action smaller by some millionths, so that no two rows pack into each other; hashes
are those of what the row holds. Its scene is the source's too, or with `scenes` its own, which takes 2 ms more. The
manifest counts what was drawn. `scengen verify` must refute such rows: by their scenes, or, where those are built, by
witnesses that were never played in them.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scengen.certificate import STAGES, Check
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


def main(source: str, n: str, to: str, *others: str) -> None:
    """Write a pool and say how large it is."""
    pool = synthetic(Pool.open(source), int(n), Path(to), "scenes" in others)
    size = sum(entry.bytes for entry in pool.manifest.shards)
    print(f"{to}: {len(pool)} scenarios in {len(pool.manifest.shards)} shards, {size / 1e6:.0f} MB")


if __name__ == "__main__":
    main(*sys.argv[1:])
