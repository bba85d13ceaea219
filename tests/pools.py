"""Pools that tests make, and change as a forger would."""

from dataclasses import replace

from scengen.cli.commands.settings import read_task
from scengen.pool import Pool
from scengen.pool.writing import write_pool
from scengen.runs.generate import GenerateSettings, generate

QUICKLY = ["certify.robust.runs=1", "certify.robust.bound=0.04"]
"""Settings that keep every check, with one jittered run."""


def make(folder, *overrides, **changed):
    """Generate a small pool of `domino_single`."""
    asked = {"n": 3, **changed, "pool": folder}
    given = [f"{name}={value}" for name, value in asked.items()]
    settings, task, certify_settings = read_task(
        "generate", ["task=domino_single", *given, *QUICKLY, *overrides], GenerateSettings
    )
    return generate(task, certify_settings, settings, lambda *_: None)


def rewritten(folder, change):
    """Change the rows of a pool and write hashes to match; a row for which `change` gives None stays as it is."""
    opened = Pool.open(folder)
    rows = [change(row) or row for row in opened.rows()]
    return write_pool(folder, opened.manifest.without_files(), rows)


def certificate_of(row, **changed):
    """The row with some fields of its certificate replaced."""
    return replace(row, certificate=replace(row.certificate, **changed))
