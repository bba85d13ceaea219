"""Recordings of every embodiment, opened by the readers of others, and docs/readers.md.

    python tools/check_readers.py

Readers run in separate environments below build/readers, which are made if they are missing. Every error, and every
warning without a reason in tools/readers/reasons.toml, ends with status 1.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from stacks import environment_of, found_python

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "readers"
PAGE = ROOT / "docs" / "readers.md"
TASKS = {
    "domino_single": "one jaw",
    "packing": "suction",
    "plate_shelf_hobi": "two arms",
    "keyboard_typing": "a scripted partner",
}
"""Tasks of which recordings are made: one for each kind of embodiment."""
EPISODES = 3
"""Number of episodes of a recording."""
FILMED = "domino_single"
"""The task that is recorded with pictures: its episodes are the shortest."""
CAMERAS = ("cameras=[rgb_exo_right_cam]", "width=96", "height=72", "environment_state=true")


@dataclass(frozen=True)
class Environment:
    """An environment with readers."""

    name: str
    python: str
    """Version of Python; empty for that of this process."""
    requirements: tuple[str, ...]
    alone: tuple[str, ...] = ()
    """Requirements that are installed without theirs."""


TRAINERS = Environment(
    "trainers",
    "3.12",
    (
        "lerobot[dataset]==0.6.1",
        "lerobot-lint==0.1.1",
        "h5py",
        "six",
        "psutil",
        "tensorboardX",
        "imageio",
        "matplotlib",
    ),
    ("robomimic==0.3.0",),  # its requirement egl_probe builds OpenGL programs, and no reader needs it
)
DOCTOR = Environment("doctor", "", ("lerobot-doctor==0.2.0",))


@dataclass(frozen=True)
class Found:
    """What a reader says of a recording."""

    recording: str
    reader: str
    check: str
    severity: str
    message: str


REASONS = tomllib.loads((ROOT / "tools" / "readers" / "reasons.toml").read_text())["reason"]
"""Reasons of findings: reader, pattern, and text."""
SHOWN = ("error", "warning")
"""Severities that the page lists."""


def main() -> None:
    """Make the recordings, read them, and write the page."""
    pythons = {environment.name: made(environment) for environment in (TRAINERS, DOCTOR)}
    recordings, files = recorded()
    trainers = pythons["trainers"]
    found = [*by_trainer(trainers, "lerobot", recordings), *by_trainer(trainers, "robomimic", files)]
    found += [*by_doctor(pythons["doctor"], recordings), *by_lint(trainers, recordings)]
    unexplained = [one for one in found if one.severity in SHOWN and not reason_of(one)]
    for one in unexplained:
        print(f"{one.severity}: {one.recording}: {one.reader}: {one.check}: {one.message}")
    PAGE.write_text(page(found, pythons))
    print(f"{len(found)} findings, {len(unexplained)} without a reason; wrote {PAGE.relative_to(ROOT)}")
    sys.exit(bool(unexplained))


def made(environment: Environment) -> Path:
    """The interpreter of an environment, which is made if it is missing."""
    interpreter = found_python(environment.python)
    if not interpreter:
        sys.exit(f"no python{environment.python} for the readers {', '.join(environment.requirements)}")
    return environment_of(FOLDER / environment.name, interpreter, environment.requirements, environment.alone)


def recorded() -> tuple[list[Path], list[Path]]:
    """Recordings of every embodiment in both formats."""
    below = FOLDER / "recordings"
    shutil.rmtree(below, ignore_errors=True)
    recordings, files = [], []
    for task in TASKS:
        demos, recording, file = below / f"{task}-demos", below / task, below / f"{task}.hdf5"
        scengen("demos", f"task={task}", f"n={EPISODES}", f"to={demos}")
        cameras = CAMERAS if task == FILMED else ("cameras=none",)
        scengen("record", f"pool={demos}", f"to={recording}", "rates=native", *cameras)
        scengen("record", f"pool={demos}", f"to={file}", "cameras=none", "format=robomimic")
        recordings.append(recording)
        files.append(file)
    return recordings, files


def scengen(*words: str) -> None:
    """Run a command of scengen."""
    print("scengen", *words, flush=True)
    subprocess.run([sys.executable, "-m", "scengen", *words], cwd=ROOT, check=True)


def output(words: Sequence[str | Path]) -> str:
    """Standard output of a reader, whatever its exit status. It reaches no hub."""
    offline = {**os.environ, "HF_HUB_OFFLINE": "1", "HF_LEROBOT_HOME": str(FOLDER / "home"), "COLUMNS": "400"}
    offline.pop("PYTHONPATH", None)
    print(*words[:4], "...", flush=True)
    return subprocess.run(words, stdout=subprocess.PIPE, text=True, env=offline).stdout


def by_trainer(python: Path, reader: str, paths: Sequence[Path]) -> Iterator[Found]:
    """Faults that LeRobot's or robomimic's own reader finds."""
    for path in paths:
        words = [python, ROOT / "tools" / "readers" / "read.py", reader, path]
        ended = subprocess.run(words, capture_output=True, text=True)
        for line in ended.stdout.splitlines():
            if line.startswith("{"):
                yield Found(**{"reader": reader, **json.loads(line)})
        if ended.returncode:
            yield Found(path.name, reader, "crash", "error", (ended.stderr.strip().splitlines() or ["?"])[-1])


def by_doctor(python: Path, recordings: Sequence[Path]) -> Iterator[Found]:
    """What lerobot-doctor says."""
    for path in recordings:
        text = output([python, "-m", "lerobot_doctor.cli", "check", path, "--json"])
        if "{" not in text:
            yield Found(path.name, "lerobot-doctor", "crash", "error", "it crashes")
            continue
        for check in json.loads(text[text.index("{") :])["checks"]:
            for told in check["messages"]:
                severity = {"FAIL": "error", "WARN": "warning"}.get(told["severity"], "info")
                yield Found(path.name, "lerobot-doctor", check["name"], severity, told["message"])


def by_lint(python: Path, recordings: Sequence[Path]) -> Iterator[Found]:
    """What lerobot-lint says. Entries of the state are named."""
    for path in recordings:
        report = FOLDER / "lint.json"
        report.unlink(missing_ok=True)
        output([python, "-m", "lerobot_lint.cli", "check", path.resolve(), "--json", report])
        if not report.is_file():
            yield Found(path.name, "lerobot-lint", "crash", "error", "it crashes")
            continue
        names = json.loads((path / "meta" / "info.json").read_text())["features"]["observation.state"]["names"]
        for told in json.loads(report.read_text())["findings"]:
            joint = told["joint"]
            entry = "" if joint is None else f" (entry {names[int(joint)]}"
            kind = f"{entry}, a velocity)" if "joint_vel" in entry else f"{entry})" if entry else ""
            yield Found(path.name, "lerobot-lint", told["check"], told["severity"], told["message"] + kind)


def reason_of(one: Found) -> str:
    """Reason of a finding; empty if there is none."""
    text = f"{one.check} {one.message}" if one.reader == "lerobot-lint" else one.message
    reasons = (each for each in REASONS if each["reader"] == one.reader and re.search(each["words"], text))
    return next((each["why"] for each in reasons), "")


def page(found: Sequence[Found], pythons: Mapping[str, Path]) -> str:
    """The page, Markdown."""
    listed = "import importlib.metadata as m; print(*(f'{n} {m.version(n)}' for n in %r), sep=', ')"
    versions = [
        subprocess.run([pythons[name], "-c", listed % (packages,)], capture_output=True, text=True).stdout.strip()
        for name, packages in (
            ("trainers", ("lerobot", "torch", "robomimic", "lerobot-lint")),
            ("doctor", ("lerobot-doctor",)),
        )
    ]
    counts: dict[tuple[str, str, str], dict[str, int]] = defaultdict(lambda: defaultdict(int))
    for one in found:
        if one.severity in SHOWN:
            why = reason_of(one) or "**no reason known**"
            counts[one.reader, f"{one.check} ({one.severity})", why][one.recording] += 1
    lines = [
        "# Recordings in the readers of others",
        "",
        "<!-- Written by `make readers` -->",
        "",
        f"`make readers` makes demonstrations of {len(TASKS)} tasks, {EPISODES} each, and records them with "
        "`rates=native`, the first with a camera, and for robomimic. It opens them in separate environments: "
        f"{'; '.join(versions)}.",
        "",
        "| recording | robot |",
        "|---|---|",
        *(f"| `{task}` | {kind} |" for task, kind in TASKS.items()),
        "",
        "`LeRobotDataset` reads actions of 8 rows ahead, the states of two rows, pictures and statistics, gives one "
        "output of a policy, `action`, and fills a batch. robomimic's `SequenceDataset` reads sequences of 10 rows "
        "with two stacked frames, normalised single rows, and every filter key. Both must give the numbers of the "
        "files.",
        "",
        "lerobot-lint is made for arms whose actions are the joint angles of the next moment, entry by entry those of "
        "`observation.state`. Here, as in LIBERO's recordings, an action is a motion of the hand, and the state has "
        "more entries than the action: two of its checks crash, and others take velocities "
        "and quaternions for angles.",
        "",
    ]
    silent = [name for name in ("lerobot", "robomimic") if not any(one.reader == name for one in found)]
    lines += [f"No faults: {' and '.join(silent)}.", ""] if silent else []
    lines += ["| reader | check | recordings (findings) | reason |", "|---|---|---|---|"]
    for (reader, check, why), where in sorted(counts.items()):
        told = ", ".join(f"{recording} ({count})" for recording, count in sorted(where.items()))
        lines.append(f"| {reader} | {check} | {told} | {why} |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
