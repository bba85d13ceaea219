"""Thousands of small lies: `python tests/checker/mutants.py COUNT [SEED] [--level recheck]`.

One value of a sound pool is changed, in one place or wherever it stands, and all hashes are written anew. Verification
must keep the pool out, or tell of the change where it is no fault, end in order, and within its limits. What may be
changed and is not told is listed in `FREE`: that is what only the author's word proves at this level.
"""

import argparse
import copy
import random
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from forgery import Case, Draft
from judging import Outcome, attempt
from make_base import BASE, KEPT

from scengen.validate.rebuilt import MAX_ABSOLUTE_DIFFERENCE, MAX_RELATIVE_DIFFERENCE

Path_ = tuple[str | int, ...]

TEXTS = [
    "",
    "x",
    "[/]",
    "\x1b[2J",
    "../../evil",
    "${oc.env:HOME}",
    "id",
    "packing",
    "a" * 5000,
    "NaN",
    "\ud800",
    "{}",
    "7",
]
NUMBERS = [0, 1, -1, 2, 7, 0.5, -0.0, 1e-9, 1e9, 1e308, 2**62, 2**64, float("nan"), float("inf"), True]
JUST_BEYOND, LEAST = 10 * MAX_RELATIVE_DIFFERENCE, 10 * MAX_ABSOLUTE_DIFFERENCE
"""Relative and absolute; ten times what numbers may differ by where machines round otherwise."""
OTHER_TYPES = [None, [], {}, "", 0, [[]], {"a": {}}, [1, 2], True]

FREE: dict[str, dict[str, str]] = {
    "replay": {
        r"checks\.0\.numbers\.|checks\.8\.numbers\.bound": "the last digits of what is computed",
        r"checks\.5\.numbers\.(reason|seconds|outcome)": "how waiting fails",
        r"checks\.2\.numbers|checks\.3\.numbers": "how far bodies overlap and drift, within the limits",
        r"checks\.6\.numbers": "how shortcuts fail",
        r"checks\.8\.numbers\.failures": "how jittered runs fail",
        r"checks\.10\.numbers": "how the witness fails without the means",
    },
    "recheck": {
        r"checks\.8\.numbers\.bound": "the last digits of what is computed",
        r"checks\.6\.numbers": "how shortcuts fail",
        r"checks\.8\.numbers\.failures": "how jittered runs fail",
    },
    "full": {},
}
"""By level and pattern: what may be changed, as text."""


def leaves(value: Any, path: Path_ = ()) -> Iterator[tuple[Path_, Any]]:
    """Every node of plain data below the top, containers included."""
    if path:
        yield path, value
    if isinstance(value, dict):
        for key in list(value):
            yield from leaves(value[key], (*path, key))
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            yield from leaves(inner, (*path, k))


def replaced(value: Any, old: Any, new: Any) -> Any:
    """The data with every node that equals `old` replaced."""
    if type(value) is type(old) and not isinstance(value, np.ndarray) and value == old:
        return copy.deepcopy(new)
    if isinstance(value, dict):
        return {key: replaced(inner, old, new) for key, inner in value.items()}
    if isinstance(value, list):
        return [replaced(inner, old, new) for inner in value]
    return value


class Mutator:
    """Makes lies about one pool from a seed."""

    def __init__(self, draft: Draft, seed: int):
        self.draft, self.random = draft, random.Random(seed)

    def lie(self) -> tuple[str, Draft]:
        """What was changed, as text, and the pool."""
        pick, draft = self.random, copy.deepcopy(self.draft)
        tops: dict[str, Any] = {"manifest": draft.manifest, **{f"row{k}": row for k, row in enumerate(draft.rows)}}
        top = pick.choice(list(tops) * 2 + ["manifest"])
        path, old = pick.choice([(p, v) for p, v in leaves(tops[top]) if p[0] not in ("shards", "rejected")])
        new = self._other(old)
        while not isinstance(old, np.ndarray) and not isinstance(new, np.ndarray) and new == old:
            new = self._other(old)
        told = f"{top}.{'.'.join(map(str, path))}: {_short(old)} -> {_short(new)}"
        if pick.random() < 0.3 and not isinstance(old, (np.ndarray, bool)) and old not in ("", 0, 1, [], {}, None):
            draft.manifest = replaced(draft.manifest, old, new)
            draft.rows = [replaced(row, old, new) for row in draft.rows]
            return f"{told} everywhere", draft
        inner = tops[top]
        for key in path[:-1]:
            inner = inner[key]
        if pick.random() < 0.08 and isinstance(inner, dict):
            del inner[path[-1]]
            return f"{top}.{'.'.join(map(str, path))}: {_short(old)} is gone", draft
        inner[path[-1]] = new
        return told, draft

    def _other(self, old: Any) -> Any:
        pick = self.random
        if pick.random() < 0.12:
            return copy.deepcopy(pick.choice(OTHER_TYPES))
        if isinstance(old, np.ndarray):
            return self._witness(old)
        if isinstance(old, bool):
            return not old
        if isinstance(old, (int, float)):
            near = [old + 1, old - 1, old * 1.01, old + max(JUST_BEYOND * abs(old), LEAST), -old, old / 2]
            return pick.choice([*near, *near, *NUMBERS])
        if isinstance(old, str):
            return self._text(old)
        if isinstance(old, list):
            return self._list(old)
        if isinstance(old, dict):
            return {**old, pick.choice(["more", "", "x.y", "[/]"]): pick.choice([0, "x", {}, None])}
        return pick.choice(OTHER_TYPES)

    def _text(self, old: str) -> str:
        pick = self.random
        numbers = list(re.finditer(r"\d", old))
        kind = pick.random()
        if kind < 0.5 and numbers:  # another digit, in a scene or in a hash
            at = pick.choice(numbers).start()
            return old[:at] + str((int(old[at]) + pick.randint(1, 9)) % 10) + old[at + 1 :]
        if kind < 0.7 and old:
            at = pick.randrange(len(old))
            return old[:at] + old[at + 1 :]
        return pick.choice([old + "x", old + " ", old.upper(), old[::-1], *TEXTS])

    def _list(self, old: list[Any]) -> list[Any]:
        pick, new = self.random, copy.deepcopy(old)
        if new and pick.random() < 0.4:
            del new[pick.randrange(len(new))]
        elif new and pick.random() < 0.6:
            new.insert(pick.randrange(len(new)), copy.deepcopy(pick.choice(new)))
        elif len(new) > 1:
            pick.shuffle(new)
        else:
            new.append(pick.choice([0, "x", {}, None]))
        return new

    def _witness(self, old: np.ndarray) -> np.ndarray:
        pick, new = self.random, old.copy()
        at, channel = pick.randrange(len(new)), pick.randrange(7)
        kind = pick.randrange(5)
        if kind == 0:
            new[at, channel] += np.float32(pick.choice([1e-7, 1e-4, 0.01, 0.5, 3.0]))
        elif kind == 1:
            new = np.delete(new, at, 0)
        elif kind == 2:
            new = np.insert(new, at, new[at], 0)
        elif kind == 3:
            new = new[: pick.randrange(len(new))]
        else:
            new = np.vstack([new, new[-1:]])
        return new.astype(np.float32)


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"{len(value)} actions"
    text = ascii(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _lines(outcome: Outcome) -> set[str]:
    """What verification has said, but for its progress."""
    return {line for line in outcome.text.splitlines() if not re.match("verify .* of", line)}


def judge(draft: Draft, level: str, as_it_was: bytes = b"") -> Outcome:
    """What verification says of a lie; one that cannot be written in the format is kept out by that.

    Args:
        as_it_was: the manifest of the sound pool; if nothing was changed in the files, nothing is to be said.
    """
    with tempfile.TemporaryDirectory() as folder:
        pool = Path(folder, "pool")
        try:
            draft.write(pool)
        except Exception as error:  # whatever pyarrow and json have to say about values of another type
            return Outcome("", "", "end", "reject", "", f"not written: {error!r}", 0.0, 0.0, 0.0)
        if (pool / "manifest.json").read_bytes() == as_it_was:
            return Outcome("", "", "end", "reject", "", "not written: the format has no place for it", 0.0, 0.0, 0.0)
        case = Case("mutant", "", "end", level=level)
        return attempt(case, pool, "scengen")


def run(count: int, seed: int, level: str, names: list[str]) -> int:
    """Judge as many lies about pools of all tasks; tell of those that were accepted or ended badly."""
    pick, verdicts, bad, free_here = random.Random(seed), Counter[str](), 0, FREE[level]
    with tempfile.TemporaryDirectory() as scratch:
        mutators = []
        for name in names:
            draft = Draft.of(BASE / name)
            sound = judge(copy.deepcopy(draft), level)
            if sound.verdict != "accept":
                sys.exit(f"{name} is not sound: {sound.text}")
            copy.deepcopy(draft).write(Path(scratch, f"{name}_again"))
            text = Path(scratch, f"{name}_again", "manifest.json").read_bytes()
            mutators.append((name, _lines(sound), text, Mutator(draft, pick.randrange(2**32))))
        for k in range(count):
            name, usual, text, mutator = mutators[k % len(mutators)]
            lie, draft = mutator.lie()
            outcome = judge(draft, level, text)
            free = next((why for pattern, why in free_here.items() if re.search(pattern, lie)), "")
            kind = "unwritten" if outcome.text.startswith("not written") else outcome.verdict
            if kind == "accept":
                kind = "accepted, and told" if _lines(outcome) != usual else f"free: {free}" if free else kind
            verdicts[kind] += 1
            if kind in ("crash", "accept"):
                bad += 1
                print(f"{kind.upper()} {name} {lie} {outcome.why}", flush=True)
                print(f"    {outcome.text[-300:]!r}" if kind == "crash" else "", end="", flush=True)
    for kind, times in verdicts.most_common():
        print(f"{times:6} {kind}")
    return bad


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--level", default="recheck")
    parser.add_argument("--pools", nargs="*", default=list(KEPT), choices=KEPT)
    asked = parser.parse_args()
    from run_corpus import warm

    warm()
    return int(bool(run(asked.count, asked.seed, asked.level, asked.pools)))


if __name__ == "__main__":
    sys.exit(main())
