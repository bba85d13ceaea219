"""Pools that tests make, and change as a forger would."""

from dataclasses import replace

from scengen import config
from scengen.pool import pool
from scengen.pool.pool import Pool
from scengen.runs.generate import Settings, generate

QUICKLY = ["certify.robust.runs=1", "certify.robust.bound=0.04"]
"""Settings that keep every check, with one jittered run."""


def make(folder, *overrides, **changed):
    """Generate a small pool of `domino_single`."""
    asked = {"n": 3, **changed, "pool": folder}
    given = [f"{name}={value}" for name, value in asked.items()]
    settings, task, certify_settings = config.read_task(
        "generate", ["task=domino_single", *given, *QUICKLY, *overrides], Settings
    )
    return generate(task, certify_settings, settings, lambda *_: None)


def rewritten(folder, change):
    """Change the rows of a pool and write hashes to match; a row for which `change` gives None stays as it is."""
    opened = Pool.open(folder)
    rows = [change(row) or row for row in opened.rows()]
    return pool.write(folder, opened.about, rows)


def certificate_of(row, **changed):
    """The row with some fields of its certificate replaced."""
    return replace(row, certificate=replace(row.certificate, **changed))
