"""Make the corpus of pools that a checker must accept or refuse: `python tests/checker/make_corpus.py FOLDER`.

A pool is made from a sound one by changing what it claims and writing every hash anew, so that nothing is false but the
claim. What is expected of each stands beside it, in `corpus.json`.
"""

import json
import shutil
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import accepted
import ages
import certificates
import hostile_data
import hostile_files
import labels
import losses
import make_base
import others
import scenes
import witnesses
from forgery import Case


def cases() -> list[Case]:
    """The whole corpus."""
    found = []
    for module in (
        accepted,
        scenes,
        labels,
        ages,
        losses,
        certificates,
        witnesses,
        hostile_data,
        hostile_files,
        others,
    ):
        found += [replace(case, kind=module.__name__) for case in module.CASES]
    names = [case.name for case in found]
    twice = {name for name in names if names.count(name) > 1}
    assert not twice, f"two pools are called {twice}"
    return found


def write(chosen: Sequence[Case], folder: Path, others: Path) -> None:
    """Write some pools of the corpus.

    Args:
        others: where those base pools are kept that do not lie in the repository; what is missing there is made.
    """
    folder.mkdir(parents=True)
    with tempfile.TemporaryDirectory() as scratch:
        bases = Path(scratch)
        for name in sorted({case.base for case in chosen}):
            _base(name, others, bases / name)
        for case in chosen:
            case.make(bases, folder / case.name)
    (folder / "corpus.json").write_text(json.dumps(list(map(_told, chosen)), indent=1) + "\n")


def _base(name: str, others: Path, target: Path) -> None:
    """Put a base pool in its place."""
    source = make_base.found(name, others)
    if name not in make_base.KEPT and make_base.outdated(source):
        make_base.make(name, source)
    shutil.copytree(source, target)


def _told(case: Case) -> dict[str, object]:
    return {name: getattr(case, name) for name in ("name", "kind", "base", "expect", "says", "level", "arguments")}


def counts(chosen: Iterable[Case]) -> str:
    """How many pools of each expectation there are."""
    expected = [case.expect for case in chosen]
    return ", ".join(f"{expected.count(what)} to {what}" for what in ("accept", "reject", "refuse"))


if __name__ == "__main__":
    target = Path(sys.argv[1])
    write(cases(), target, target.parent / "base")
    print(f"{target}: {counts(cases())}")
