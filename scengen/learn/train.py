"""Training of a policy on demonstrations: `scengen train`."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from filelock import FileLock, Timeout
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..errors import BadConfig, UnknownName, cut
from ..installation import versions
from ..pictures.plots import svg_bytes
from ..pool import kinds
from ..pool.files import sha256
from ..work.limits import at_least
from ..work.targets import refused, try_folder, write
from .data import MIN_EPISODES, TrainingData
from .epochs import Training, best_epoch
from .features import Features
from .models import BC, KINDS, KNN
from .samples import parted, samples_of, scaling_of
from .store import FORMAT, LOSS, MAX_MEMBERS, Broken, PolicySettings, StoredPolicy, is_policy

GIVEN_BY_DATA = ("data", "to", "demonstrations", "task")
"""Settings that change no weights, or only by the data, which have a separate hash."""
ROUNDING = 1e-4
"""Largest difference of an array that follows from the data, relative beyond 1: machines round differently."""
RISE = 1.1
"""Rise of the held-out error above its lowest value from which on a policy is said to have memorised: a tenth,
more than errors vary from epoch to epoch."""
UNFINISHED = "unfinished-{identity}.npz"
"""Name of the file of weights of an unfinished training."""


@dataclass(frozen=True)
class TrainSettings:
    """Settings of `scengen train`; conf/command/train.yaml explains them."""

    policy: str = BC
    data: str = ""
    to: str = ""
    task: str | None = None
    observations: list[str] | None = None
    demonstrations: int | None = None
    steps: int = 2
    chunk: int = 8
    played: int = 3
    hidden: list[int] = field(default_factory=lambda: [256, 256])
    members: int = 5
    epochs: int = 60
    patience: int | None = None
    minutes: float | None = None
    seed: int = 0

    def check(self) -> None:
        """Raise `ScengenError` for invalid settings."""
        if self.policy not in KINDS:
            raise UnknownName("policy to train", self.policy, KINDS)
        if self.demonstrations is not None and self.demonstrations < MIN_EPISODES:
            raise BadConfig(f"demonstrations = {self.demonstrations}; it must be at least {MIN_EPISODES}")
        at_least(self, steps=1, chunk=1, played=1, epochs=1, patience=1, minutes=0.01, seed=0)
        if self.played > self.chunk:
            raise BadConfig(f"played = {self.played}; it must be at most chunk = {self.chunk}")
        if not 1 <= self.members <= MAX_MEMBERS:
            raise BadConfig(f"members = {self.members}; it must lie in [1, {MAX_MEMBERS}]")
        if not 1 <= len(self.hidden) <= 20 or any(not 0 < size <= 10_000 for size in self.hidden):
            raise BadConfig(f"hidden = {cut(str(self.hidden))}; give the units of 1 to 20 layers, each 1 to 10000")
        if self.policy != KNN and find_spec("sklearn") is None:
            raise BadConfig(
                f"no scikit-learn for policy={self.policy}; say pip install 'scengen[train]', or policy=knn"
            )
        kinds.check_target(self.to, kinds.POLICY)
        try_folder(self.to)


@dataclass(frozen=True)
class Trained:
    """Result of a training."""

    settings: PolicySettings
    losses: tuple[tuple[float, float], ...]
    """Losses after each epoch [variances]: of demonstrations that were learned from, and of held-out ones. Empty if the
    policy was there already."""
    held_out: int
    """Number of demonstrations that were held out."""
    seconds: float
    """Processor time, that of earlier runs included [s]."""
    earlier: int
    """Number of epochs of earlier runs."""

    @property
    def memorised(self) -> str:
        """A line about a policy that memorised its demonstrations: the error of those fell on, and that of the
        held-out ones rose; empty for others."""
        if not (best := best_epoch(self.losses)):
            return ""
        (learned, held_out), (then, lowest) = self.losses[-1], self.losses[best - 1]
        if held_out <= RISE * lowest or learned >= then:
            return ""
        rose = f"the held-out error rose from {lowest:.3g} after epoch {best} to {held_out:.3g}"
        return f"{rose}, while that of the demonstrations fell: the policy memorised them"


def train(settings: TrainSettings, data: TrainingData, progress: Callable[[int, int, str], None]) -> Trained:
    """Train a policy and write it to `settings.to`. An interrupted training continues after its last epoch.

    Args:
        progress: called with the number of finished epochs, the number of all, and the last losses as text.

    Raises:
        BadConfig: the folder holds another policy or another unfinished training, or cannot be written.
    """
    settings.check()
    folder, identity = Path(settings.to), _identity(settings, data)
    learned, held_out = parted(data.trajectories)
    with _alone(folder):
        scaling = scaling_of(data.entries, settings.steps, settings.chunk, learned)
        features = Features(data.entries, settings.steps, scaling["input_mean"], scaling["input_scale"])
        samples = samples_of(features, settings.chunk, scaling, learned)
        validation = samples_of(features, settings.chunk, scaling, held_out)
        hidden, members = ((), 1) if settings.policy == KNN else (tuple(settings.hidden), settings.members)
        limit = None if settings.minutes is None else 60.0 * settings.minutes
        epochs = 1 if settings.policy == KNN else settings.epochs
        own = PolicySettings(
            kind=settings.policy,
            task=data.task,
            task_version=data.task_version,
            embodiment=data.embodiment,
            rate=data.rate,
            streams=data.streams,
            entries=data.entries,
            steps=settings.steps,
            chunk=settings.chunk,
            played=settings.played,
            hidden=hidden,
            members=members,
            inputs=samples.inputs.shape[1],
            epochs=epochs,
            seed=settings.seed,
            demonstrations=len(learned),
            rows=len(samples.inputs),
            data_sha256=data.sha256,
            training_sha256=identity,
            weights_sha256="",  # that of the file that is written
            versions={**versions(), "scikit-learn": _version("scikit-learn")},
        )
        if is_policy(folder):
            copied = samples.copied if settings.policy == KNN else {}
            ends_early = limit is not None or settings.patience is not None
            return Trained(_same(folder, own, {**scaling, **copied}, ends_early), (), len(held_out), 0.0, 0)
        path = folder / UNFINISHED.format(identity=identity[:16])
        _check_unfinished(folder, path)
        try:
            wanted = (epochs, limit, settings.seed, settings.patience)
            run = Training(path, settings.policy, hidden, members, samples, validation, *wanted)
        except (Broken, ValueError, OSError) as error:
            raise BadConfig(f"{path} is damaged ({cut(str(error))}); delete it to start again") from None
        earlier = len(run.losses)
        while not run.is_over:
            run.advance()
            progress(len(run.losses), epochs, f"loss {run.losses[-1][0]:.4f}, held out {run.losses[-1][1]:.4f}")
        own = replace(own, epochs=len(run.losses) if settings.patience is None else run.best_epoch)
        write(folder / LOSS, _curve(own, run.losses))
        own = StoredPolicy(own, {**scaling, **run.kept}).write(folder)
        path.unlink(missing_ok=True)
    return Trained(own, tuple(run.losses), len(held_out), run.seconds, earlier)


# --- the folder ---------------------------------------------------------------------------------------


def _identity(settings: TrainSettings, data: TrainingData) -> str:
    """Hash of everything that decides the weights."""
    given = {name: value for name, value in asdict(settings).items() if name not in GIVEN_BY_DATA}
    chosen = {name: value for name, value in given.items() if name != "patience" or value is not None}
    versions = {"format": FORMAT, "version": _version("scengen")}
    values = {**chosen, "sha256": data.sha256, "task_version": data.task_version, "streams": data.streams, **versions}
    return sha256(json.dumps(values, sort_keys=True))


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the folder's lock.

    Raises:
        BadConfig: another training holds it, or the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with FileLock(folder / "train.lock", timeout=0):
            yield
    except Timeout:
        raise BadConfig(f"another training is writing {folder}; wait for it or choose another to=") from None
    except OSError as error:
        raise refused(folder, error) from None


def _same(
    folder: Path, own: PolicySettings, arrays: Mapping[str, NDArray[np.float32]], ends_early: bool
) -> PolicySettings:
    """The settings of a policy that is there already.

    Args:
        own: those that the training gives.
        arrays: those of its arrays that follow from the data without a training.
        ends_early: whether the training may end before its last epoch.

    Raises:
        BadConfig: it comes from another training, or has entries that this training does not give.
    """
    stored = StoredPolicy.open(folder)
    found = stored.settings
    if found.training_sha256 != own.training_sha256:
        raise BadConfig(f"{folder} holds a policy of other data or settings; choose another to=, or delete it")
    free = ("weights_sha256", "versions", *(["epochs"] if ends_early else []))
    wrong = [f.name for f in fields(own) if f.name not in free and getattr(found, f.name) != getattr(own, f.name)]
    wrong += [name for name, array in arrays.items() if not _alike(stored.arrays.get(name), array)]
    if wrong:
        raise BadConfig(f"{folder} has another {wrong[0]} than this training gives; delete it to train again")
    return found


def _alike(one: NDArray[np.float32] | None, other: NDArray[np.float32]) -> bool:
    """Whether two arrays are the same up to rounding."""
    return one is not None and one.shape == other.shape and np.allclose(one, other, ROUNDING, ROUNDING, equal_nan=True)


def _check_unfinished(folder: Path, path: Path) -> None:
    for other in sorted(folder.glob(UNFINISHED.format(identity="*"))):
        if other != path:
            raise BadConfig(
                f"{folder} holds an unfinished training with other data or settings; repeat its command, "
                f"choose another to=, or delete {other.name}"
            )


# --- the report ---------------------------------------------------------------------------------------


def _curve(own: PolicySettings, losses: Sequence[tuple[float, float]]) -> bytes:
    """The losses of the epochs as a plot."""
    figure = Figure(figsize=(6, 3.4))
    axes = figure.subplots()
    epochs = range(1, len(losses) + 1)
    marker = "o" if len(losses) == 1 else ""
    axes.plot(epochs, [loss for loss, _ in losses], marker=marker, label="learned from")
    axes.plot(epochs, [loss for _, loss in losses], marker=marker, label="held out")
    axes.set(xlabel="epoch", ylabel="error of the goals [variances]", title=f"{own.kind}, {own.task}")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    return svg_bytes(figure)


def _version(package: str) -> str:
    return version(package) if find_spec("sklearn" if package == "scikit-learn" else package) else "none"
