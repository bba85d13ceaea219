"""Policies on disk: a folder with `policy.json` and `weights.npz`. As a pool, it is data only: nothing in it is run.

policy.json     kind, task, observations, rates, training, versions, and hashes of the data and of the weights
weights.npz     arrays of float32, stored without compression, whose shapes follow from `policy.json`
loss.svg        the losses of the epochs, on demonstrations that were learned from and on held-out ones
"""

import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..errors import BadConfig, PoolError, ScengenError, UnknownName, cut
from ..pool import kinds
from ..pool.files import read_json_file, sha256
from ..pool.untrusted import HASH, WORD, check_match, check_text, check_versions, check_whole, demand
from ..sim.embodiment import EMBODIMENTS, action_size
from ..work.plain import read_plain
from ..work.targets import write
from ..work.typed import typed
from .features import Features, number_names
from .goals import pose_streams
from .models import KINDS, KNN, MIP

SETTINGS = kinds.POLICY
"""File with everything about a policy except its arrays."""
WEIGHTS = "weights.npz"
"""File with the arrays of a policy."""
LOSS = "loss.svg"
"""File with a plot of the losses."""
FORMAT = 4
"""Version of the format."""
MAX_ENTRIES = 100_000
"""Largest number of entries of an observation."""
MAX_CHUNK = 1000
"""Largest number of goals in a chunk."""
MAX_STEPS = 100
"""Largest number of observations that a policy sees at once."""
MAX_LAYERS = 100
"""Largest number of hidden layers."""
MAX_MEMBERS = 1000
"""Largest number of perceptrons."""
MAX_WIDTH = 100_000
"""Largest number of units of a hidden layer."""
MAX_WEIGHTS = 2_000_000_000
"""Size of the largest file of weights that is read [bytes]."""
MAX_HEADERS = 1_000_000
"""Largest size of everything in a file of weights but the weights [bytes]."""
MAX_ROWS = 100_000_000
"""Largest number of rows of the demonstrations."""


class Broken(ValueError):
    """A file of weights is not what the settings say."""


@dataclass(frozen=True)
class PolicySettings:
    """Description of a policy in its folder."""

    kind: str
    """Name of the policy, one of `models.KINDS`."""
    task: str
    task_version: int | None
    """Version of the task; None if the recording did not state it."""
    embodiment: str
    rate: int
    """Actions per second, a divisor of 100."""
    streams: tuple[str, ...]
    """Names of the streams that are its inputs."""
    entries: tuple[str, ...]
    """Names of the entries of these streams, one after the other."""
    steps: int
    """Number of observations that the policy sees at once, the present one included."""
    chunk: int
    """Number of predicted goals."""
    played: int
    """Number of goals that are played before the next prediction."""
    hidden: tuple[int, ...]
    """Units of each hidden layer; empty for `knn`."""
    members: int
    """Number of perceptrons whose outputs are averaged; 1 for `knn`."""
    inputs: int
    """Number of inputs."""
    epochs: int
    """Number of passes over the data."""
    seed: int
    demonstrations: int
    """Number of demonstrations that were learned from."""
    rows: int
    """Number of their rows."""
    data_sha256: str
    """Hash of the demonstrations, held-out ones included."""
    training_sha256: str
    """Hash of the data and all settings of the training."""
    weights_sha256: str
    """Hash of the file of weights."""
    versions: Mapping[str, str]
    """Versions of scengen, of the packages that the physics depends on, and of scikit-learn."""

    @property
    def action_repeat(self) -> int:
        """Number of control periods for which an action is held."""
        return round(1 / Loop.PERIOD) // self.rate

    @property
    def pose_streams(self) -> tuple[str, ...]:
        """Names of the streams with the poses of the hands, from which goals are seen."""
        return pose_streams(self.embodiment)

    @property
    def observed(self) -> tuple[str, ...]:
        """Names of all streams that the policy reads."""
        return tuple(dict.fromkeys((*self.streams, *self.pose_streams)))

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Shapes of all arrays, by name."""
        numbers, outputs = len(number_names(self.entries)), self.chunk * action_size(self.embodiment)
        found: dict[str, tuple[int, ...]] = dict.fromkeys(("input_mean", "input_scale"), (numbers,))
        found |= dict.fromkeys(("output_mean", "output_scale"), (outputs,))
        if self.kind == KNN:
            return {**found, "inputs": (self.rows, self.inputs), "chunks": (self.rows, outputs)}
        return found | network_shapes(self.kind, self.inputs, self.hidden, outputs, self.members)

    def check(self) -> None:
        """Raise an error unless every value is possible."""
        if self.kind not in KINDS:
            raise UnknownName("policy", self.kind, KINDS)
        check_match("task", self.task, WORD)
        demand(self.task_version is None or self.task_version >= 1, f"task_version is {self.task_version}")
        if self.embodiment not in EMBODIMENTS:
            raise UnknownName("embodiment", self.embodiment, EMBODIMENTS)
        full = round(1 / Loop.PERIOD)
        demand(self.rate in range(1, full + 1) and full % self.rate == 0, f"rate = {self.rate} does not divide {full}")
        demand(0 < len(self.entries) <= MAX_ENTRIES, f"{len(self.entries)} entries of an observation")
        demand(0 < len(self.streams) <= len(self.entries), f"{len(self.streams)} streams")
        for name in (*self.streams, *self.entries):
            check_text("a name of an observation", name, 200)
        for name, most in (("steps", MAX_STEPS), ("chunk", MAX_CHUNK), ("rows", MAX_ROWS), ("members", MAX_MEMBERS)):
            check_whole(name, getattr(self, name), most)
            demand(getattr(self, name) > 0, f"{name} is 0")
        demand(self.played in range(1, self.chunk + 1), f"played = {self.played}; it must lie in [1, chunk]")
        demand(
            len(self.hidden) <= MAX_LAYERS and all(0 < n <= MAX_WIDTH for n in self.hidden), "hidden layers too large"
        )
        check_whole("inputs", self.inputs, self.steps * len(number_names(self.entries)))
        for name in ("data_sha256", "training_sha256", "weights_sha256"):
            check_match(name, getattr(self, name), HASH)
        check_versions(self.versions)
        size = 4 * sum(map(prod, self.shapes.values()))
        demand(size <= MAX_WEIGHTS, f"{size} bytes of weights; at most {MAX_WEIGHTS} are read")


@dataclass(frozen=True, eq=False)
class StoredPolicy:
    """A trained policy: its settings and its arrays."""

    settings: PolicySettings
    arrays: Mapping[str, NDArray[np.float32]]

    @classmethod
    def open(cls, folder: str | Path) -> "StoredPolicy":
        """Read a policy.

        Raises:
            PoolError: it does not exist, it is damaged, or of another format.
        """
        settings = read_settings(folder)
        path = Path(folder, WEIGHTS)
        try:
            content = read_plain(path, MAX_WEIGHTS + MAX_HEADERS)
            if sha256(content) != settings.weights_sha256:
                raise Broken(f"its sha256 is not that in {SETTINGS}")
            arrays = read_arrays(io.BytesIO(content), settings.shapes)
        except (OSError, ValueError) as error:
            raise PoolError(f"{path} is damaged ({_cause(error)}); restore it, or train the policy again") from None
        return cls(settings, arrays)

    @cached_property
    def features(self) -> Features:
        """The inputs of the policy."""
        own = self.settings
        return Features(own.entries, own.steps, self.arrays["input_mean"], self.arrays["input_scale"])

    def write(self, folder: Path) -> PolicySettings:
        """Write the policy, the settings last, and return them with the hash of the file of weights."""
        content = arrays_as_bytes(self.arrays)
        settings = replace(self.settings, weights_sha256=sha256(content))
        write(folder / WEIGHTS, content)
        values = {name: value for name, value in asdict(settings).items() if value is not None}
        write(folder / SETTINGS, json.dumps({"format": FORMAT, **values}, indent=1, sort_keys=True) + "\n")
        return settings


def is_policy(folder: str | Path) -> bool:
    """Whether a folder holds a trained policy."""
    return Path(folder, SETTINGS).is_file()


def read_settings(folder: str | Path) -> PolicySettings:
    """The settings of the policy in a folder.

    Raises:
        PoolError: it does not exist, it is damaged, or of another format.
    """
    path = Path(folder, SETTINGS)
    if not path.is_file():
        raise PoolError(f"no policy at {folder}: {SETTINGS} is missing; see scengen train")
    try:
        plain = read_json_file(path)
        demand(isinstance(plain, dict), "not a mapping")
        version = plain.pop("format", None)
        if version == FORMAT:
            settings = typed("", PolicySettings, plain, exact=True)
            settings.check()
            return settings
    except (ScengenError, ValueError, OSError) as error:
        raise PoolError(f"{path} is damaged ({_cause(error)}); restore it, or train the policy again") from None
    raise BadConfig(f"{path} has format {cut(repr(version), 20)}, this scengen reads {FORMAT}; train the policy again")


def arrays_as_bytes(arrays: Mapping[str, NDArray[np.float32]]) -> bytes:
    """Content of a file of arrays: the same arrays give the same bytes."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, array in sorted(arrays.items()):
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            with archive.open(entry, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(array, np.float32), allow_pickle=False)
    return file.getvalue()


def network_shapes(
    kind: str, inputs: int, hidden: Sequence[int], outputs: int, members: int
) -> dict[str, tuple[int, ...]]:
    """Shapes of the weights of some perceptrons, by name; none for `knn`."""
    if kind == KNN:
        return {}
    found: dict[str, tuple[int, ...]] = {}
    sizes = (inputs + (outputs + 1 if kind == MIP else 0), *hidden, outputs)
    for i, (before, after) in enumerate(pairwise(sizes)):
        found |= {f"weights{i}": (members, before, after), f"biases{i}": (members, after)}
    return found


def read_arrays(path: Path | io.BytesIO, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, NDArray[np.float32]]:
    """Arrays of known shapes. The shape in a header is compared before memory is taken for it.

    Raises:
        Broken: an array is missing or differs from the expected one, or the file is not an archive.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            found = _members(archive, shapes)
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise Broken(_cause(error)) from None
    for name, array in found.items():
        if not (np.isfinite(array).all() or (name == "input_scale" and (array > 0).all())):
            raise Broken(f"{name} has numbers that are not finite")
    return found


def _members(archive: zipfile.ZipFile, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, NDArray[np.float32]]:
    found = {}
    if sorted(archive.namelist()) != sorted(f"{name}.npy" for name in shapes):
        raise Broken("it holds other arrays than the settings say")
    for name, shape in shapes.items():
        entry = archive.getinfo(f"{name}.npy")
        if entry.compress_type != zipfile.ZIP_STORED:
            raise Broken(f"{name} is compressed")
        with archive.open(entry) as member:
            if np.lib.format.read_magic(member) != (1, 0):
                raise Broken(f"{name} has another version of the header")
            header = np.lib.format.read_array_header_1_0(member)
            if header != (shape, False, np.dtype(np.float32)):
                raise Broken(
                    f"{name} has the shape {cut(str(header[0]))} and the type {header[2]}, not {shape}, float32"
                )
            content = member.read(4 * prod(shape))
            if len(content) < 4 * prod(shape):
                raise Broken(f"{name} ends early")
            found[name] = np.frombuffer(content, np.float32).reshape(shape)
    return found


def _cause(error: Exception) -> str:
    return cut(" ".join(str(error).split()), 160)
