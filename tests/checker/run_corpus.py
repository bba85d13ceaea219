"""Put checkers to the corpus: `python tests/checker/run_corpus.py [--quick] [--checker scengen ...] [--only REGEX]`.

The exit status is 0 if every pool gets the verdict that it deserves for the reason that it deserves, and no control
does well.
"""

import argparse
import json
import os
import re
import shutil
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from checkers import CHECKERS, COMMANDS, CONTROLS, EASY
from forgery import Case
from judging import Outcome, attempt
from make_corpus import cases, write

FOLDER = Path(__file__).parents[2] / "generated" / "checker"


@dataclass(frozen=True)
class Score:
    """How well a checker did."""

    checker: str
    accepts: int
    accepted: int
    rejects: int
    noticed: int
    crashes: int
    wrong: int
    """Neither a crash nor a wrong acceptance, but another verdict or reason than expected."""
    wall: float
    cpu: float
    memory: float

    @classmethod
    def of(cls, checker: str, outcomes: Sequence[Outcome]) -> "Score":
        sound = [o for o in outcomes if o.expect == "accept"]
        false = [o for o in outcomes if o.expect in ("reject", "refuse")]
        return cls(
            checker,
            len(sound),
            sum(o.verdict == "accept" for o in sound),
            len(false),
            sum(o.noticed for o in false),
            sum(o.verdict == "crash" for o in outcomes),
            sum(
                bool(o.why) and o.verdict != "crash" and (o.noticed if o.expect != "accept" else o.right)
                for o in outcomes
            ),
            sum(o.wall for o in outcomes),
            sum(o.cpu for o in outcomes),
            max((o.memory for o in outcomes), default=0.0),
        )

    @property
    def soundness(self) -> float:
        """Share of the pools that are not sound, and were refuted or declined."""
        return self.noticed / max(1, self.rejects)

    @property
    def completeness(self) -> float:
        """Share of the sound pools that were accepted."""
        return self.accepted / max(1, self.accepts)

    def __str__(self) -> str:
        return (
            f"{self.checker:<10}accepts {self.accepted} of {self.accepts}, refuses {self.noticed} of {self.rejects} "
            f"({self.soundness:.0%}), crashes {self.crashes}, other reasons {self.wrong}, "
            f"{self.cpu:.0f} s of processor time, at most {self.memory:.0f} MB"
        )


def put(checker: str, chosen: Iterable[Case], pools: Path, progress: Callable[[Outcome], None]) -> list[Outcome]:
    """Let one checker judge some pools of the corpus, one after the other."""
    outcomes = []
    for case in chosen:
        outcomes.append(attempt(case, pools / case.name, checker))
        progress(outcomes[-1])
    return outcomes


def _apart(work: Callable[[], None]) -> None:
    """Do something in a separate process: what it has used of the memory does not come back."""
    child = os.fork()
    if child == 0:
        try:
            work()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
        sys.exit("the corpus could not be made")


def warm() -> None:
    """Import and compute once, here, what every child would need anew: the machine's fingerprint, and the tasks."""
    from scengen import cli, compose, list_tasks, load_task  # noqa: F401
    from scengen.cli.commands import verify  # noqa: F401
    from scengen.work.fingerprint import fingerprint

    fingerprint()
    for name in list_tasks():
        load_task(name)


def _tables(scores: Sequence[Score], outcomes: Sequence[Outcome]) -> Iterable[str]:
    for kind in sorted({o.kind for o in outcomes}):
        those = [o for o in outcomes if o.kind == kind]
        good = sum(not o.why for o in those)
        yield f"  {kind:<14}{good} of {len(those)} as expected"
    for outcome in outcomes:
        if outcome.why:
            told = " ".join(outcome.text.split())[:160]
            yield f"{outcome.verdict.upper():<8}{outcome.name}: {outcome.why}; it said: {told}"
    yield from map(str, scores)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--checker", nargs="*", default=["scengen", *CONTROLS], choices=CHECKERS)
    parser.add_argument("--quick", action="store_true", help="the small corpus, made from pools in the repository")
    parser.add_argument("--verbose", action="store_true", help="tell of every pool as soon as it is judged")
    parser.add_argument("--again", action="store_true", help="take the pools as the last run has written them")
    parser.add_argument("--only", default="", help="regular expression of names")
    parser.add_argument("--json", type=Path, help="write every outcome to this file")
    parser.add_argument("--pools", type=Path, default=FOLDER / "pools", help="where the corpus is written")
    asked = parser.parse_args()
    chosen = [c for c in cases() if (c.quick or not asked.quick) and re.search(asked.only, c.name)]
    if "robosuite" in asked.checker and asked.checker != ["robosuite"]:
        parser.error("robosuite judges accepted pools only; run it alone")
    if asked.checker == ["robosuite"]:
        chosen = [replace(c, says="") for c in chosen if c.expect == "accept"]  # it tells of no configuration
    if set(asked.checker) <= COMMANDS.keys():
        chosen = [replace(c, expect="end", says="") for c in chosen if c.kind.startswith("hostile")]
    if not asked.again:
        shutil.rmtree(asked.pools, ignore_errors=True)
        make = partial(write, chosen, asked.pools, FOLDER / "base")
        make() if asked.quick else _apart(make)
    warm()
    scores, results, judged = [], {}, []
    for checker in asked.checker:
        outcomes = put(checker, chosen, asked.pools, lambda o: print(o) if asked.verbose else None)
        results[checker] = [asdict(o) for o in outcomes]
        scores.append(Score.of(checker, outcomes))
        judged = judged or outcomes
    for line in _tables(scores, judged):
        print(line)
    if asked.json:
        plain = [{**asdict(s), "soundness": s.soundness, "completeness": s.completeness} for s in scores]
        asked.json.parent.mkdir(parents=True, exist_ok=True)
        asked.json.write_text(json.dumps({"scores": plain, "outcomes": results}, indent=1) + "\n")
    easy = [s.checker for s in scores if s.checker in CONTROLS and s.soundness >= EASY]
    if easy:
        print(f"the corpus is too easy: {', '.join(easy)} refuse {EASY:.0%} and more")
    return int(bool(easy) or any(o.why for o in judged))


if __name__ == "__main__":
    sys.exit(main())
