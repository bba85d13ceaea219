"""Pools on disk: a folder with a manifest and Parquet shards.

Data only: nothing in a pool is executed, imported or opened by its name, whoever made it. What is read has passed the
rules of `scengen.schema`.
"""

import bisect
import hashlib
import itertools
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..certificate import StoredCertificate, as_json, from_json
from ..errors import PoolError, UnknownName
from ..params import Value
from . import schema, shards
from .directory import Directory, joined
from .names import Name
from .shards import FORMAT

MANIFEST = "manifest.json"
SHARD_ROWS = 10_000
"""Scenarios in a file: some 150 MB, written and hashed in seconds."""
MOST_ROWS = 20_000_000
"""Scenarios that can be found by their ids: 600 MB of them."""
FOOTERS = 8
"""Files whose lists of groups are kept, some MB each."""
REJECTED = "rejected.parquet"
PROCESS = "process"
"""Stands for a check in the reasons where a scenario has ended its process, or was ended with it at a limit."""

_NUMBER = re.compile(r"\d+(\.\d+)?")

NO_WITNESS: NDArray[np.float32] = np.zeros((0, 7), np.float32)
"""The witness of a row whose witness was not asked for."""


@dataclass(frozen=True, kw_only=True)
class PoolRow:
    """One scenario of a pool: a field for every column of `shards.NAMES`."""

    id: str
    task: str
    code: str
    """Number of the task in the paper."""
    category: str
    split: str
    axes: tuple[str, ...]
    """The split's axes with their severities, such as `wide_gaps@3`; none in training."""
    shifted: Mapping[str, Value]
    """Values of the parameters that the axes name."""
    seed: int
    index: int
    attempt: int
    """Which try at the index was the first feasible one."""
    id_twin: str
    """Id of the training scenario of the same index."""
    instruction: str
    horizon: float
    """Time limit [s]."""
    params: Mapping[str, Value]
    """Values of all parameters."""
    embodiment: str
    scene_xml: str = field(repr=False)
    """The certified scene without the robot, MJCF."""
    scene_sha256: str
    witness: NDArray[np.float32] = field(repr=False, compare=False)
    """Actions of a success as the controller received them, shape (n, 7 * arms)."""
    witness_sha256: str
    certificate: StoredCertificate = field(repr=False)

    @property
    def name(self) -> Name:
        """What it is called before people."""
        return Name(self.task, self.split, self.index, self.id)

    def plain(self) -> dict[str, Any]:
        """All columns but the witness as plain data, as a shard stores them."""
        kept = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "witness"}
        text = {"shifted": as_json(self.shifted), "params": as_json(self.params)}
        return {**kept, **text, "axes": list(self.axes), "certificate": self.certificate.plain()}

    @classmethod
    def of(cls, plain: Mapping[str, Any], witness: NDArray[np.float32]) -> "PoolRow":
        """The reverse of `plain`.

        Raises:
            ValueError: a mapping is not canonical JSON, or the certificate has gaps.
        """
        return cls(**{name: _PARSE.get(name, _same)(value) for name, value in plain.items()}, witness=witness)


def _same(value: Any) -> Any:
    return value


_PARSE = {"axes": tuple, "shifted": from_json, "params": from_json, "certificate": StoredCertificate.of}
"""How stored columns become values; the others are values already."""


@dataclass(frozen=True)
class Pool:
    """A finished pool, opened for reading."""

    folder: Path
    manifest: Mapping[str, Any]

    @classmethod
    def open(cls, folder: str | Path) -> "Pool":
        """Open a pool by its folder.

        Raises:
            PoolError: there is no finished pool of a known format.
        """
        folder = Path(folder)
        path = folder / MANIFEST
        if not path.is_file():
            begun = f"{folder}.run"
            hint = (
                "a run was begun there; repeat its command to finish it"
                if Path(begun).is_dir()
                else "see scengen generate"
            )
            raise PoolError(f"no pool at {folder}: {MANIFEST} is missing; {hint}")
        try:
            manifest = schema.read_file(path)
            version = manifest["format"]
            if version == FORMAT:
                schema.check_manifest(manifest)
        except (ValueError, KeyError, TypeError, OSError) as error:
            why = " ".join(str(error).split())[:160]
            raise PoolError(f"{path} is damaged; restore it or generate the pool again ({why})") from None
        if version != FORMAT:
            raise PoolError(
                f"{folder} has pool format {str(version)[:20]}, this scengen reads {FORMAT}; generate the pool "
                "again, or use the scengen that wrote it"
            )
        return cls(folder, manifest)

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which holds the hash of every shard: equal hashes mean equal pools."""
        return shards.sha_of(self.folder / MANIFEST)

    def __len__(self) -> int:
        return sum(shard["rows"] for shard in self.manifest["shards"])

    # --- the manifest -----------------------------------------------------------------------

    @property
    def task(self) -> str:
        """Name of the task."""
        return self.manifest["config"]["task"]["name"]

    @property
    def task_node(self) -> dict[str, Any]:
        """The file of the task as it was, with measured limits and what the command line changed."""
        return {key: node for key, node in self.manifest["config"]["task"].items() if key != "name"}

    @property
    def split(self) -> str:
        return self.manifest["config"]["split"]

    @property
    def sampler(self) -> str:
        """Where the numbers came from, such as `iid`; see `scengen.samplers.designs`."""
        return self.manifest["config"]["sampler"]

    @property
    def seed(self) -> int:
        return self.manifest["config"]["seed"]

    @property
    def settings(self) -> str:
        """Name of the settings of the certificates, `quick` or `full`."""
        return self.manifest["config"]["certify"]["name"]

    @property
    def versions(self) -> Mapping[str, str]:
        """Versions that the pool was certified with."""
        return self.manifest["versions"]

    @property
    def indices(self) -> int:
        """How many indices were tried."""
        return self.manifest["indices"]

    @property
    def funnel(self) -> Mapping[str, int]:
        """How many draws got through each step."""
        return self.manifest["funnel"]

    @property
    def reasons(self) -> Mapping[str, int]:
        """Rejections by "check: reason"."""
        return self.manifest["reasons"]

    @property
    def chosen(self) -> bool:
        """Whether its scenarios were chosen from another pool, and not drawn."""
        return "subset" in self.manifest

    @property
    def about(self) -> dict[str, Any]:
        """The manifest without what `write` adds to it, and without an attack, whose hits are files beside it."""
        return {k: v for k, v in self.manifest.items() if k not in ("format", "shards", "rejected", "attack")}

    # --- the shards -------------------------------------------------------------------------

    def damaged(self) -> dict[str, str]:
        """What is wrong with the files, by shard; empty for a sound pool."""
        wrong = {}
        rejected = [self.manifest["rejected"]] if "rejected" in self.manifest else []
        for shard in [*self.manifest["shards"], *rejected]:
            path = self.folder / shard["file"]
            if why := schema.why_no_plain_file(path):
                wrong[shard["file"]] = why
            elif path.stat().st_size != shard["bytes"]:
                wrong[shard["file"]] = f"has {path.stat().st_size} bytes instead of {shard['bytes']}: truncated"
            elif shards.sha_of(path) != shard["sha256"]:
                wrong[shard["file"]] = "has another sha256 than the manifest says"
        return wrong

    def check(self) -> "Pool":
        """Raise `PoolError` unless every shard is what the manifest says."""
        for name, what in self.damaged().items():
            raise PoolError(f"{self.folder / name} {what}; restore it or generate the pool again")
        return self

    def rows(self, witness: bool = True) -> Iterator[PoolRow]:
        """All scenarios in index order.

        Args:
            witness: whether to read the witnesses, most of a pool's bytes; without them each is `NO_WITNESS`.

        Raises:
            PoolError: a shard cannot be read.
        """
        for path, _ in self._files:
            yield from _rows(path, witness)

    def columns(self, *names: str, places: Iterable[int] | None = None) -> Iterator[tuple[Any, ...]]:
        """A few columns of all scenarios in index order, with the values of `PoolRow`'s fields; quicker than `rows`.

        Args:
            places: of some scenarios only, see `some`.

        Raises:
            UnknownName: there is no such column, or it is the witness.
            PoolError: a shard cannot be read.
        """
        for name in names:
            if name not in shards.LIGHT:
                raise UnknownName("light column of a pool", name, shards.LIGHT)
        paths = (path for path, _ in self._files)
        every = (values for path in paths for values in shards.read(path, names))
        for values in every if places is None else self._some(places, names):
            yield tuple(values[name] for name in names)

    def names(self) -> Iterator[Name]:
        """Names of all scenarios in index order.

        Raises:
            PoolError: a shard cannot be read.
        """
        return (Name(*told) for told in self.columns("task", "split", "index", "id"))

    # --- some of the scenarios --------------------------------------------------------------

    @cached_property
    def directory(self) -> Directory:
        """Ids and indices of all scenarios, read once.

        Raises:
            PoolError: a shard cannot be read, or holds another number of scenarios than the manifest says.
        """
        if len(self) > MOST_ROWS:
            raise PoolError(f"{self.folder} promises {len(self)} scenarios; at most {MOST_ROWS} are found by their ids")
        return joined([Directory(*shards.keys(path, rows)) for path, rows in self._files])

    def kinds(self, name: str) -> tuple[list[str], NDArray[np.int32]]:
        """The different texts in a column such as `split`, and which of them each scenario has, shape (n,).

        Raises:
            PoolError: as `directory`, or there are too many.
        """
        found: dict[str, int] = {}
        codes = [np.zeros(0, np.int32)]
        for path, rows in self._files:
            texts, here = shards.kinds(path, name, rows)
            codes.append(np.array([found.setdefault(text, len(found)) for text in texts] or [0], np.int32)[here])
        return list(found), np.concatenate(codes)

    def some(self, places: Iterable[int], witness: bool = True) -> Iterator[PoolRow]:
        """The scenarios at some places, counted from 0 in index order; no others are unpacked.

        Args:
            places: increasing within a hundred neighbours, so that these are read once.

        Raises:
            PoolError: a shard cannot be read.
        """
        names = shards.NAMES if witness else shards.LIGHT
        return (PoolRow(**{"witness": NO_WITNESS, **values}) for values in self._some(places, names))

    def at(self, place: int, witness: bool = True) -> PoolRow:
        """The scenario at a place, counted from 0 in index order.

        Raises:
            IndexError: there is none.
            PoolError: its shard cannot be read.
        """
        if not 0 <= place < len(self):
            raise IndexError(f"{self.folder} holds {len(self)} scenarios, numbered from 0; there is none at {place}")
        return next(self.some([place], witness))

    def name_at(self, place: int) -> Name:
        """What the scenario at a place is called."""
        return Name(*next(self.columns("task", "split", "index", "id", places=[place])))

    def row(self, name: str) -> PoolRow:
        """The scenario of that name, such as `domino_single/wide_gaps@3/8ed4a4577fe0`, or whose id begins so.

        The id counts; a warning tells of a name that is wrong about it (`names.Misnamed`).

        Raises:
            UnknownName: there is none.
            BadConfig: there is more than one.
        """
        return self.at(self.directory.find(name, self.name_at, str(self.folder)))

    def of_index(self, index: int) -> PoolRow:
        """The scenario that was drawn at an index.

        Raises:
            PoolError: there is none; the others were not certified.
        """
        place = self.directory.of_index(index)
        if place is None:
            raise PoolError(f"{self.folder} holds no scenario of index {index}; {self.indices} indices were tried")
        return self.at(place)

    def _some(self, places: Iterable[int], names: Sequence[str]) -> Iterator[dict[str, Any]]:
        for (number, group), found in itertools.groupby(map(self._where, places), key=lambda where: where[:2]):
            path, metadata = self._files[number][0], self._footer(number)[0]
            yield from shards.read_some(path, metadata, group, [inside for *_, inside in found], names)

    def _where(self, place: int) -> tuple[int, int, int]:
        """Shard, group of rows, and row in it of a place."""
        number = bisect.bisect_right(self._ends, place)
        inside = place - (self._ends[number - 1] if number else 0)
        ends = self._footer(number)[1]
        group = bisect.bisect_right(ends, inside)
        return number, group, inside - (ends[group - 1] if group else 0)

    @cached_property
    def _ends(self) -> list[int]:
        """Place behind the last scenario of every shard."""
        return list(itertools.accumulate(rows for _, rows in self._files))

    @cached_property
    def _footer(self) -> Callable[[int], tuple[pq.FileMetaData, list[int]]]:
        """What a shard says of its groups of rows, and the place in it behind the last row of each."""

        @lru_cache(FOOTERS)
        def footer(number: int) -> tuple[pq.FileMetaData, list[int]]:
            path, rows = self._files[number]
            metadata, ends = shards.footer(path)
            if not ends or ends[-1] != rows:
                raise PoolError(f"{path} holds {ends[-1] if ends else 0} rows, and the manifest promises {rows}")
            return metadata, ends

        return footer

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: where the pool is, and not what was read of it."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def _files(self) -> list[tuple[Path, int]]:
        """Every shard with the number of its scenarios."""
        return [(self.folder / shard["file"], shard["rows"]) for shard in self.manifest["shards"]]

    @property
    def promised_rejects(self) -> int:
        """How many scenarios were kept although they were not certified, by the manifest."""
        return self.manifest["rejected"]["rows"] if "rejected" in self.manifest else 0

    def rejects(self) -> Iterator[PoolRow]:
        """Scenarios that were kept although they were not certified (`keep=`), in index order.

        Raises:
            PoolError: their file cannot be read.
        """
        if "rejected" in self.manifest:
            yield from _rows(self.folder / REJECTED, witness=True)


def write(
    folder: Path,
    about: Mapping[str, Any],
    rows: Iterable[PoolRow],
    kept: Iterable[PoolRow] = (),
    ready: Sequence[Mapping[str, Any]] = (),
) -> Pool:
    """Write a pool: shards first, the manifest last, each under its final name only when complete.

    Args:
        about: the manifest but for the files.
        rows: the certified scenarios in index order, as far as they are not in shards that are ready.
        kept: scenarios that were not certified.
        ready: what the manifest says of full shards that lie in the folder already, see `write_shard`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found, left = [*ready], iter(rows)
    while (first := next(left, None)) or not found:
        some = itertools.chain([first] if first else [], itertools.islice(left, SHARD_ROWS - 1))
        found.append(write_shard(folder, len(found), some))
    rejects = iter(kept)
    first = next(rejects, None)
    extra = {"rejected": _written(folder / REJECTED, itertools.chain([first], rejects))} if first else {}
    text = json.dumps({"format": FORMAT, **about, "shards": found, **extra}, indent=1, sort_keys=True) + "\n"
    shards.replace(folder / MANIFEST, text.encode())
    return Pool.open(folder)


def write_shard(folder: Path, number: int, rows: Iterable[PoolRow]) -> dict[str, Any]:
    """Write one shard of a pool, and say what its manifest says of it.

    Args:
        number: of the shard, from 0.
        rows: `SHARD_ROWS` of them, or less in the last one.
    """
    return _written(folder / f"scenarios-{number:05d}.parquet", rows)


def _written(path: Path, rows: Iterable[PoolRow]) -> dict[str, Any]:
    return shards.write(path, ((row.plain(), row.witness) for row in rows))


def _rows(path: Path, witness: bool) -> Iterator[PoolRow]:
    for values in shards.read(path, shards.NAMES if witness else shards.LIGHT):
        yield PoolRow(**{"witness": NO_WITNESS, **values})


def uncounted(reason: str) -> str:
    """A reason without its numbers: rejections of the same kind have the same reason then, and can be counted."""
    return _NUMBER.sub("#", reason)


def sha256(content: str | bytes) -> str:
    """Hash of a text or of bytes, in hex."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()
