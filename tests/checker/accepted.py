"""Pools that are sound: a checker that refuses one of them is as useless as one that accepts everything."""

import json
from pathlib import Path

import pyarrow.parquet as pq
from forgery import ELSEWHERE, SHARD, Case, Draft, listed, write_manifest, write_table
from make_base import TRAINING

PLAIN = (
    "single_quick", "single_full", "single_axis", "single_severity", "single_composed", "single_composed_of_three",
    "single_sobol", "single_hypercube", "single_grid", "single_workers", *TRAINING, "select_composed",
    "galileo_severity", "cage_severity", "seesaw_axis", "tool_composed", "packing_axis", "single_kept",
)  # fmt: skip
"""Bases that are accepted as they are."""

CHANGED = {
    "single_own_axis": r"heavy",
    "single_own_range": r"gap_ratio",
    "single_own_horizon": r"horizon",
    "single_own_instruction": r"instruction",
    "single_own_settings": r"own settings",
}
"""Bases whose configuration is not the installed one: sound, but nobody may miss it."""


def _subset(draft: Draft) -> None:
    """What `scengen subset` writes: some rows of another pool, all else as it was."""
    del draft.rows[0]
    draft.manifest.update(n=1, subset={"of": "5" * 64, "chosen": "max-min coverage"})


def _elsewhere(draft: Draft) -> None:
    """A machine that rounds otherwise has ended in other bits."""
    draft.everywhere(fingerprint=ELSEWHERE)
    for row in draft.rows:
        row["certificate"]["final_state"] = "0011223344556677"


def _last_digits(draft: Draft) -> None:
    """There, sines and logarithms end in other digits."""
    _elsewhere(draft)
    for row in draft.rows:
        features = row["certificate"]["checks"][0]["numbers"]
        features.update({name: value * (1 + 3e-16) for name, value in features.items()})


def _lost(draft: Draft) -> None:
    """The last scenario is said to have been lost at a limit of the author's machine."""
    del draft.rows[0]
    draft.manifest.update(n=1, first_draws=1, reasons={"process: took longer than # s": 1})
    draft.manifest["funnel"].update({stage: 1 for stage in draft.manifest["funnel"] if stage not in BEFORE_LOSS})


def _cyrillic(draft: Draft) -> None:
    """A letter of the instruction is another one that looks the same."""
    text = draft.task["instruction"].replace("o", "\u043e", 1)
    draft.task["instruction"] = text
    draft.every(instruction=text)


BEFORE_LOSS = ("proposed", "feasible")


def _attacked(draft: Draft) -> None:
    """An attack of a thousand million rollouts without a hit."""
    rate = {"tier": "random", "raw": False, "rollouts": 10**9, "hits": 0}
    draft.manifest["attack"] = {"rates": [rate], "hits": []}


def _rounded(draft: Draft) -> None:
    """There, the numbers of scenes end in other digits, too."""
    _elsewhere(draft)
    draft.scene(r'(name="tile_5" pos=")(\S+)', lambda found: f"{found[1]}{float(found[2]) * (1 + 1e-12)!r}")


def _two_shards(folder: Path) -> None:
    """As large pools are written."""
    table = pq.read_table(folder / SHARD)
    shards = []
    for number in range(2):
        path = folder / f"scenarios-0000{number}.parquet"
        write_table(path, table.slice(number, 1))
        shards.append(listed(path, 1))
    manifest = json.loads((folder / "manifest.json").read_text())
    write_manifest(folder, {**manifest, "shards": shards})


def _beside(folder: Path) -> None:
    """Somebody has put a note and a picture beside the pool."""
    (folder / "README.md").write_text("Ten scenarios for the seminar.\n")


CASES = [
    *(Case(name, name, "accept", quick=name in ("single_quick", "single_severity", "tool_id")) for name in PLAIN),
    *(Case(name, name, "accept", says) for name, says in CHANGED.items()),
    Case("single_quick__subset", "single_quick", "accept", r"subset|chosen", _subset, quick=True),
    Case("single_quick__elsewhere", "single_quick", "accept", "", _elsewhere, quick=True),
    Case("seesaw_id__elsewhere", "seesaw_id", "accept", "", _elsewhere),
    Case("single_quick__last_digits", "single_quick", "accept", "", _last_digits),
    Case("single_quick__lost", "single_quick", "accept", r"1 indices were lost.*author's word", _lost),
    Case("single_quick__attacked", "single_quick", "accept", r"1000000000 rollouts.*author's word", _attacked),
    Case("single_quick__letters_alike", "single_quick", "accept", r"u043e", _cyrillic),
    Case("single_quick__rounded", "single_quick", "accept", "", _rounded),
    Case("single_quick__two_shards", "single_quick", "accept", "", lambda draft: None, _two_shards),
    Case("single_quick__a_note_beside", "single_quick", "accept", "", None, _beside),
    Case("single_quick__two_workers", "single_quick", "accept", "", arguments=("workers=2",)),
    Case("single_severity__certified_again", "single_severity", "accept", "", level="full"),
    Case("single_quick__rechecked", "single_quick", "accept", "", level="recheck"),
    Case("galileo_severity__rechecked", "galileo_severity", "accept", "", level="recheck"),
    Case("packing_axis__rechecked", "packing_axis", "accept", "", level="recheck"),
    Case("seesaw_axis__rechecked", "seesaw_axis", "accept", "", level="recheck"),
    Case("cage_severity__rechecked", "cage_severity", "accept", "", level="recheck"),
    Case("tool_id__certified_again", "tool_id", "accept", "", level="full"),
]
