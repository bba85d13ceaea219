"""train a small state-based policy on demonstrations: nearest neighbours, behaviour cloning, or MIP"""

from pathlib import Path

from rich.table import Table

from ...compose import load_task
from ...demos.curate.people import ACCEPT, DECISIONS, decisions_of_people
from ...errors import BadConfig, cut
from ...export.dataset import CURATION, Recording
from ...export.recording import RecordSettings, record
from ...learn.data import KEPT, TrainingData, kept_episodes
from ...learn.expected import expected
from ...learn.models import KNN
from ...learn.samples import parted
from ...learn.train import Trained, TrainSettings, train
from ...pool.demonstrations import Demonstrations, is_demonstrations
from ...pool.manifest import MANIFEST
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path, tasks
from . import OK, Arguments, err, out, remark, say
from .settings import read

RECORDING = "recording"
"""Folder of the recording of demonstrations, below that of the policy."""


def command(arguments: Arguments) -> int:
    settings = read("train", arguments, TrainSettings)
    settings.check()
    recording = _recording(settings, arguments)
    _check_decisions(Recording.open(recording))
    data = TrainingData.read(recording, settings.observations, settings.demonstrations, settings.task)
    if kept_episodes(Recording.open(recording)) is None and not is_demonstrations(settings.data):
        remark(f"{recording} was not curated: what it says is claimed; scengen curate data={recording} checks it")
    left_out = ", ".join(f"{count} {why}" for why, count in data.left_out.items() if count)
    if left_out:
        remark(f"episodes that are not learned from: {left_out}")
    search = search_path(arguments)
    if data.task in tasks(search):
        if status := load_task(data.task, search).other_version("recorded with", data.task_version):
            remark(f"{recording} was {status}")
    learned, held_out = parted(data.trajectories)
    rows = sum(len(each.observations) for each in learned)
    say(f"learning {data.task} from {len(learned)} demonstrations, {rows} rows; {len(held_out)} are held out")
    if data.task in tasks(search):
        say(expected(data.task, settings.policy))
    with ProgressBar(err, f"train {settings.policy}", settings.epochs) as progress_bar:
        trained = train(settings, data, lambda done, total, status: progress_bar.of(done, total, status))
    if not trained.losses:
        claimed = "" if settings.policy == KNN else "; its weights are claimed, delete it to train again"
        say(f"{settings.to} holds this policy already: same data, same settings{claimed}")
    else:
        out.print(_table(trained))
        if trained.earlier:
            say(f"{trained.earlier} of {trained.settings.epochs} epochs are from an earlier run")
        say(f"wrote {settings.to}: policy.json, weights.npz, loss.svg")
        if trained.memorised and settings.patience is None:
            remark(
                f"{trained.memorised}; more demonstrations help most; patience=10 keeps the weights of the best epoch"
            )
    say(f"next: scengen evaluate policy={settings.to} pool=...")
    return OK


def _check_decisions(recording: Recording) -> None:
    """Raise `ScengenError` if people have decided otherwise than the list of kept episodes says."""
    count, kept = len(recording.episodes), kept_episodes(recording)
    path = recording.folder / CURATION / DECISIONS
    decided = decisions_of_people(path, count)
    other = [n for n, each in decided.items() if (each.verdict == ACCEPT) != (kept is None or n in kept)]
    if other:
        told = f"{path} has a verdict about episode {other[0]} that {KEPT} does not follow"
        raise BadConfig(f"{told}; repeat scengen curate data={recording.folder}")


def _recording(settings: TrainSettings, arguments: Arguments) -> str:
    """The folder of the recording: `data` itself, or that of its demonstrations, which are recorded first.

    Raises:
        ScengenError: `data` is neither, or cannot be recorded.
    """
    demonstrated = is_demonstrations(settings.data)
    if Path(settings.data, MANIFEST).is_file():
        raise BadConfig(f"data = {cut(settings.data)} is a pool; make demonstrations with scengen demos, or record it")
    if not demonstrated:
        return settings.data
    to = Path(settings.to, RECORDING)
    if not to.exists():
        wanted = RecordSettings(pool=settings.data, to=str(to), cameras="none")
        with ProgressBar(err, f"record {settings.data}", 0) as progress_bar:
            record(wanted, progress_bar.of, search_path(arguments))
    if Recording.open(to).source.get("pools") != [Demonstrations.open(settings.data).sha256]:
        raise BadConfig(f"{to} was recorded from other demonstrations than {settings.data}; choose another to=")
    return str(to)


def _table(trained: Trained) -> Table:
    own, (learned, held_out) = trained.settings, trained.losses[-1]
    table = Table("", "", title=f"{own.kind} for {own.task}", title_justify="left", show_header=False)
    for what, value in (
        ("demonstrations", f"{own.demonstrations}, and {trained.held_out} held out"),
        ("rows", f"{own.rows}, {own.rate} per second"),
        ("inputs", f"{own.inputs} of {own.steps} observations of {', '.join(own.streams)}"),
        ("goals", f"{own.chunk} in a chunk, {own.played} played"),
        ("epochs", f"{own.epochs}, {trained.seconds:.0f} s of processor time"),
        ("error of the goals [variances]", f"{learned:.4f}, held out {held_out:.4f}"),
        ("weights", own.weights_sha256),
    ):
        table.add_row(what, value)
    return table
