"""Verdicts of one policy in two harnesses, by which a package that brings scenarios into another harness is checked."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from ..pool import Pool
from .policies import REPLAY
from .rollouts import evaluate
from .settings import EvaluateSettings


def replay_verdicts(pools: Sequence[str]) -> dict[str, bool]:
    """Whether the policy `replay` solves each scenario of some pools in `scengen evaluate`, by id.

    Of every pool as many scenarios are played as the smallest one has.
    """
    seeds = min(len(Pool.open(folder)) for folder in pools)
    with TemporaryDirectory() as folder:
        settings = EvaluateSettings(REPLAY, list(pools), seeds=seeds, rollouts=1, to=str(Path(folder, "out")))
        return {episode["scenario"]: episode["success"] for episode in evaluate(settings, lambda *_: None).episodes}


def compared(theirs: Mapping[str, bool], ours: Mapping[str, bool]) -> tuple[str, bool]:
    """A line that compares the verdicts of two harnesses, and whether all are the same."""
    differ = [id_ for id_, success in ours.items() if theirs.get(id_) != success]
    line = f"{len(ours)} scenarios: {sum(ours.values())} solved in scengen, {len(differ)} verdicts differ"
    return f"{line}: {', '.join(differ)}" if differ else line, not differ
