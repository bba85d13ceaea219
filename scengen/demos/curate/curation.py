"""The three stages of curation of a recording (paper, App. C): score, checks of every episode, decisions of people.

    curation/scores.csv            scores of people, `episode,score`; they win over the measured ones
    curation/reports.jsonl         an `EpisodeReport` for each episode
    curation/report.schema.json    its JSON schema
    curation/decisions.csv         decisions of people, `episode,verdict,who,why`
    curation/remarks.jsonl         answers of a model, if there is one
    curation/kept.json             numbers of the kept episodes, for LeRobotDataset(..., episodes=kept)
    curation/index.html            page with the flagged episodes
    meta/scengen.json              `curation`: number of episodes after each stage

Only the recording itself is read: nothing in it depends on results of policies.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ... import compose
from ...agents.models import made
from ...errors import PoolError, ScengenError
from ...export.dataset import CURATION, EpisodeData, Recording
from ...export.recording import CONTROL_ACTIONS
from ...perturb.perturbation import Perturbation
from ...pool.files import read_json_file, replace_file, sha256
from ...work.parallel import UNTRUSTED_LIMITS, Workers, each
from ...work.targets import try_folder
from .checks import Subject, check_rows, found
from .findings import REPORTS, SCHEMA, EpisodeReport, Finding, read_reports
from .labels import CLAIMED
from .people import ACCEPT, DECISIONS, REJECT, SCORES, Decision, decisions_of_people, scores_by_people
from .remarks import with_remarks
from .replays import Recorded, Replayed, comparison_of, lost, replayed
from .score import KEPT_SCORE, scores_of, terms_of
from .videos import FROZEN_CAMERA, Probe, Prober, check_video
from .whole import Whole

FOLDER = CURATION
"""Folder of the results, below that of the recording."""


@dataclass(frozen=True)
class CurateSettings:
    """Settings of `scengen curate`; conf/command/curate.yaml explains them."""

    data: str = ""
    replay: bool = True
    model: str | None = None
    workers: Workers = 1


@dataclass(frozen=True)
class Curated:
    """Result of a curation."""

    recording: Recording
    reports: tuple[EpisodeReport, ...]
    decisions: Mapping[int, Decision]
    kept: tuple[int, ...]
    """Numbers of the kept episodes."""
    funnel: Mapping[str, int]
    """Number of episodes after each stage."""
    claimed: tuple[str, ...] = ()
    """What the recording says and nothing can be compared with."""
    unread: int = 0
    """Number of answers of the model that have no meaning."""

    @property
    def uncompared(self) -> bool:
        """Whether a camera has pictures and none of a replay to compare: OpenGL is missing, or every replay failed."""
        made = {check for report in self.reports for check in report.checks}
        return "replay" in made and any(comparison_of(camera) not in made for camera in self.recording.cameras)

    @property
    def undecided(self) -> list[EpisodeReport]:
        """Flagged episodes with a sufficient score and no decision; they stay out."""
        scored = (report for report in self.reports if report.score >= KEPT_SCORE)
        return [report for report in scored if report.flagged and report.episode not in self.decisions]


def curate(settings: CurateSettings, progress: Callable[[int, int], None], search: Sequence[str] = ()) -> Curated:
    """Curate a recording, and write the results below it, except for the page.

    Args:
        progress: called with the number of finished steps and of all.
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: the recording, or a table of a person, cannot be read.
    """
    recording = Recording.open(settings.data)
    folder = recording.folder / FOLDER
    for place in (folder, recording.folder / "meta"):
        try_folder(place)
    count = len(recording.episodes)
    people, decisions = scores_by_people(folder / SCORES, count), decisions_of_people(folder / DECISIONS, count)
    reports, jobs, whole = _examined(recording, settings, search, lambda done: progress(done, 2 * count))
    claimed = dict.fromkeys([*(f"scengen/{name}" for name in CLAIMED), *whole.claimed])
    for done, (number, played) in enumerate(_replays(jobs, settings.workers), 1):
        progress(count + done, 2 * count)
        report = reports[number]
        claimed |= dict.fromkeys(played.unknown)
        findings, checks = (*report.findings, *played.findings), (*report.checks, *played.checks)
        reports[number] = replace(report, findings=findings, checks=checks)
    reports, unread = [_with_score(report, people.get(report.episode)) for report in reports], 0
    if settings.model is not None:
        lengths = [int(episode["length"]) for episode in recording.episodes]
        reports, unread = with_remarks(reports, lengths, made(settings.model), settings.model, folder)
    curated = replace(_decided(recording, tuple(reports), decisions), unread=unread, claimed=tuple(claimed))
    _write(curated, folder)
    return curated


def _examined(
    recording: Recording, settings: CurateSettings, search: Sequence[str], progress: Callable[[int], None]
) -> tuple[list[EpisodeReport], list[Recorded], Whole]:
    """Reports with the scores of the measured terms, what is to be replayed, and the findings about the other files."""
    whole = Whole(recording)
    reports, jobs, terms, tasks, solved = [], list[Recorded](), list[dict[str, float]](), list[str](), list[bool]()
    twins: dict[str, int] = {}
    size = recording.picture_size
    for episode in recording.read():
        made, findings = check_rows(episode, recording)
        readable = not any(one.check in ("MISSING_FIELD", "NAN") for one in findings)
        terms.append(terms_of(episode, recording.fps) if readable else {})
        tasks.append(episode.task)
        reached = episode.about["scengen/success"], episode.columns["next.success"][-1]
        solved.append(readable and all(map(bool, reached)))
        if readable:
            findings += whole.of_episode(episode)
            films, told = _videos(episode, recording)
            frozen = {camera: one for camera, one in told if settings.replay and one.check == FROZEN_CAMERA}
            findings += [one for camera, one in told if frozen.get(camera) is not one]
            made = (*made, *(f"video {camera}" for camera in recording.cameras), "duplicate")
            actions = np.ascontiguousarray(episode.columns[CONTROL_ACTIONS]).tobytes()
            content = sha256(actions + "|".join(_perceived_of(episode.about)).encode())
            if (twin := twins.setdefault(content, episode.number)) != episode.number:
                findings.append(found("DUPLICATE", f"it repeats episode {twin}", (), "error", episode=twin))
            if settings.replay:
                task = compose.load_task(episode.task, search)
                if (robot := recording.info["robot_type"]) != task.embodiment:
                    findings.append(found("INFO", f"robot_type is {robot}, that of the task is {task.embodiment}"))
                jobs.append(
                    Recorded.of(
                        episode.number,
                        task,
                        episode.about,
                        episode.columns,
                        recording.entries,
                        size,
                        films,
                        recording.calibrations,
                        frozen,
                        recording.look,
                        search,
                    )
                )
        else:
            whole.skip(episode)
        about = episode.about
        style = str(about.get("scengen/style", ""))
        reports.append(
            EpisodeReport(
                episode.number, about["scengen/id"], episode.task, style, 1, "terms", terms[-1], made, tuple(findings)
            )
        )
        progress(episode.number + 1)
    shared = tuple(whole.of_all())
    reports = [replace(report, findings=(*report.findings, *shared)) for report in reports]
    scores = _scores_of_readable(terms, tasks, solved)
    return [replace(report, score=score) for report, score in zip(reports, scores, strict=True)], jobs, whole


def _perceived_of(about: Mapping[str, Any]) -> list[str]:
    """Distinction of episodes of the same actions: the scenario, and its look or its instruction."""
    told = {name: str(about.get(f"scengen/{name}", "")) for name in ("id", "perturb", "perturb_seed")}
    with suppress(ScengenError):
        if Perturbation.parse(told["perturb"]).is_of_words:
            return [told["id"], *map(str, about.get("tasks") or ())]
    return [*told.values()]


def _scores_of_readable(
    terms: Sequence[Mapping[str, float]], tasks: Sequence[str], solved: Sequence[bool]
) -> list[int]:
    """Scores of all episodes; 1 for one that has no terms."""
    readable = [k for k, own in enumerate(terms) if own]
    found = [1] * len(terms)
    scores = scores_of([terms[k] for k in readable], [tasks[k] for k in readable], [solved[k] for k in readable])
    for k, score in zip(readable, scores, strict=True):
        found[k] = score
    return found


def _videos(
    episode: EpisodeData, recording: Recording
) -> tuple[dict[str, tuple[Probe, ...]], list[tuple[str, Finding]]]:
    """Parts of the films that are to be compared with a replay, and what each film alone shows."""
    moving = Subject(episode, recording).moves.any(axis=1)
    films, findings = {}, list[tuple[str, Finding]]()
    for camera in recording.cameras:
        prober = Prober(len(episode))
        pictures = prober.watched(recording.frames(episode, camera))
        findings += [(camera, one) for one in check_video(camera, pictures, len(episode), moving)]
        films[camera] = prober.probes
    return films, findings


def _replays(jobs: Sequence[Recorded], workers: Workers) -> Any:
    """Number of each replayed episode and what its replay has found."""
    pictures = any(job.films for job in jobs)  # OpenGL has threads, which a copy of a process that has used it lacks
    return each(_numbered_replay, jobs, workers, UNTRUSTED_LIMITS, _numbered_loss, fork=not pictures)


def _numbered_loss(job: Recorded, reason: str) -> tuple[int, Replayed]:
    return job.number, lost(job, reason)


def _numbered_replay(job: Recorded) -> tuple[int, Replayed]:
    return job.number, replayed(job)


def _with_score(report: EpisodeReport, score: int | None) -> EpisodeReport:
    return report if score is None else replace(report, score=score, scored_by="person")


def _decided(recording: Recording, reports: tuple[EpisodeReport, ...], decisions: Mapping[int, Decision]) -> Curated:
    """Stage 3: a person's verdict decides; without one, episodes with a sufficient score and no flag are kept."""
    scored = [report for report in reports if report.score >= KEPT_SCORE]
    clean = [report.episode for report in scored if not report.flagged]
    accepted = {k for k, decision in decisions.items() if decision.verdict == ACCEPT}
    rejected = {k for k, decision in decisions.items() if decision.verdict == REJECT}
    kept = sorted({*clean, *accepted} - rejected)
    funnel = {"recorded": len(reports), "scored": len(scored), "without errors": len(clean), "kept": len(kept)}
    return Curated(recording, reports, decisions, tuple(kept), funnel)


def decided_again(recording: Recording) -> Curated:
    """The last curation of a recording with what people have said since; its results are written.

    Raises:
        ScengenError: it was not curated yet, or a table of people cannot be read.
    """
    folder, count = recording.folder / FOLDER, len(recording.episodes)
    people, decisions = scores_by_people(folder / SCORES, count), decisions_of_people(folder / DECISIONS, count)
    reports = tuple(_with_score(report, people.get(report.episode)) for report in read_reports(folder / REPORTS))
    if [report.episode for report in reports] != list(range(count)):
        raise PoolError(f"{folder / REPORTS} is of another recording; run scengen curate data={recording.folder}")
    curated = _decided(recording, reports, decisions)
    _write(curated, folder)
    return curated


def _write(curated: Curated, folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    lines = "".join(json.dumps(report.plain(), sort_keys=True) + "\n" for report in curated.reports)
    replace_file(folder / REPORTS, lines.encode())
    replace_file(folder / "report.schema.json", _json(SCHEMA))
    replace_file(folder / "kept.json", _json(list(curated.kept)))
    about = curated.recording.folder / "meta" / "scengen.json"
    source = read_json_file(about) if about.is_file() else {}
    funnel = {**curated.funnel, "undecided": len(curated.undecided)}
    replace_file(about, _json({**source, "curation": {"funnel": funnel, "kept_score": KEPT_SCORE}}))


def _json(content: Any) -> bytes:
    return (json.dumps(content, indent=1) + "\n").encode()
