"""Pools as a data set for the Hugging Face Hub: a folder whose README.md tells the viewer and `datasets` what is in it.

README.md                            YAML head (configurations, columns, sizes, licence), then the card for people
<task>-<split>/manifest.json ...     a pool, byte by byte: one configuration each, still verified by `scengen verify`
"""

import shutil
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import metadata
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from jinja2 import Template

from ..attack.evidence import Rate, rates, spelled
from ..certificate import CHECKS, Check, StoredCertificate
from ..errors import BadConfig
from ..pool.pool import MANIFEST, Pool
from ..samplers.split import ID
from ..work.printed import printable
from ..work.targets import refused, try_folder

CARD = "README.md"
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
"""The Hub's words for the number of rows, by what they stay below."""
BIGGEST = "n>1M"
HOLDS = {
    "feasible": "no analytic refutation: out of reach, gap too wide",
    "compiles": "the scene on disk loads in plain MuJoCo without a warning",
    "overlap": "bodies do not overlap at the start",
    "rest": "everything stays where it is if nobody acts",
    "unsolved": "the goal does not hold at the start",
    "idle": "doing nothing does not reach the goal",
    "shortcuts": "every tempting plan fails",
    "solved": "the oracle reaches the goal, which lasts",
    "robust": "the oracle does under jitter in poses, masses, friction, actions and latency",
    "numerics": "finer time steps and more solver iterations do not change the verdict",
    "ablations": "without the intended means the witness fails",
    "witness": "the recorded actions alone end in the same bits",
    "attack": "the adversary finds no way around",
}
"""What each check of a certificate says."""


@dataclass(frozen=True)
class Part:
    """A pool in the data set."""

    pool: Pool
    settings: str
    """Whose settings its certificates have: `quick`, `full`, or in what they differ."""
    verified: str
    """How its certificates were verified, in words."""

    @property
    def name(self) -> str:
        """Of the configuration, and of its folder: `domino_single-wide_gaps@3`."""
        return f"{self.pool.task}-{self.pool.split}"

    @property
    def split(self) -> str:
        """What the Hub calls it: training scenarios, or such for testing."""
        return "train" if self.pool.split == ID else "test"

    @property
    def files(self) -> list[str]:
        """Names of its files of scenarios."""
        return [shard["file"] for shard in self.pool.manifest["shards"]]

    @property
    def others(self) -> list[str]:
        """Names of what else belongs to it: rejects that were kept, hits of an attack."""
        manifest = self.pool.manifest
        rejected = [manifest["rejected"]["file"]] if "rejected" in manifest else []
        return [MANIFEST, *rejected, *(hit["file"] for hit in manifest.get("attack", {}).get("hits", []))]


@dataclass
class Tally:
    """What the certificates of a pool say together."""

    times: Counter[str] = field(default_factory=Counter)
    """How often each check has passed."""
    made: set[str] = field(default_factory=set)
    """Checks that had something to check."""
    worst: Mapping[str, Any] = field(default_factory=dict)
    """Numbers of the check `robust` where the oracle had the lowest bound."""
    rates: list[Rate] = field(default_factory=list)
    """How often the adversaries of the check `attack` reached the goal."""

    @classmethod
    def of(cls, certificates: Iterable[StoredCertificate]) -> "Tally":
        """That of some certificates, which are looked at one after the other."""
        found = cls()
        for check in (check for one in certificates for check in one.checks):
            found.add(check)
        return found

    def add(self, check: Check) -> None:
        """Count one check."""
        if not check.waived:
            self.made.add(check.name)
        if not check.passed:
            return
        self.times[check.name] += 1
        if check.name == "robust" and (not self.worst or check.numbers["bound"] < self.worst["bound"]):
            self.worst = check.numbers
        if check.name == "attack":
            parted = ((*key.rpartition("_"), numbers) for key, numbers in check.numbers.items())
            more = [Rate(tier, how == spelled(True), n["rollouts"], n["hits"]) for tier, _, how, n in parted]
            self.rates = rates([*self.rates, *more])

    def passed(self, name: str) -> str:
        """How often a check has passed, in words."""
        return str(self.times[name]) if name in self.made else "not checked"

    @property
    def robust(self) -> str:
        """The fewest successes of the oracle under jitter in any scenario, and their bound."""
        return f"{self.worst['solved']} of {self.worst['runs']} (> {self.worst['bound']:.0%})"


def check_target(to: str) -> None:
    """Raise `BadConfig` unless a folder is new or empty, and can be written."""
    path = Path(to)
    if path.is_dir() and any(path.iterdir()):
        raise BadConfig(f"{to} is not empty; delete it, or name another folder")
    if not path.name:
        raise BadConfig(f"to = {to}; name a folder of its own for the data set")
    if (unfinished := Path(f"{path}.unfinished")).exists():
        raise BadConfig(f"{unfinished} is left from a card that was killed, or one is under way; delete it")
    try_folder(to)


def check_parts(pools: Sequence[Pool]) -> None:
    """Raise `BadConfig` unless every pool is the only one of its task and split, and has scenarios."""
    found: dict[str, Path] = {}
    for pool in pools:
        name = f"{pool.task}-{pool.split}"
        if name in found:
            raise BadConfig(f"{found[name]} and {pool.folder} are both {name}; give one pool of each task and split")
        if not len(pool):
            raise BadConfig(f"{pool.folder} holds no scenario; see scengen generate")
        found[name] = pool.folder


def publish(parts: Sequence[Part], to: Path, title: str, license: str) -> None:
    """Write the data set; the folder appears when it is complete.

    Args:
        to: a folder that is new or empty.
        license: of the data, as the Hub spells it.

    Raises:
        BadConfig: the folder cannot be written.
    """
    unfinished = Path(f"{to}.unfinished")
    try:
        unfinished.mkdir(parents=True)
    except OSError as error:
        raise refused(unfinished, error) from None
    try:
        for part in parts:
            for name in (*part.files, *part.others):
                (unfinished / part.name / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(part.pool.folder / name, unfinished / part.name / name)
        head = yaml.safe_dump(_head(parts, title, license), sort_keys=False, allow_unicode=True, width=1000)
        (unfinished / CARD).write_text(f"---\n{head}---\n\n{_text(parts, title)}")
        unfinished.replace(to)
    except OSError as error:
        shutil.rmtree(unfinished)
        raise refused(to, error) from None
    except BaseException:
        shutil.rmtree(unfinished)
        raise


def own_license() -> str:
    """The licence of scengen, whose scenes and task files pools are made of, as the Hub spells it."""
    return metadata("scengen")["License-Expression"].lower()


def _head(parts: Sequence[Part], title: str, license: str) -> dict[str, Any]:
    """What the Hub reads."""
    count = sum(len(part.pool) for part in parts)
    first = next((part for part in parts if part.split == "train"), parts[0])
    return {
        "pretty_name": title,
        "license": license,
        "language": ["en"],
        "task_categories": ["robotics"],
        "tags": ["robotics", "manipulation", "mujoco", "out-of-distribution", "scengen"],
        "size_categories": [next((told for most, told in SIZES if count < most), BIGGEST)],
        "configs": [
            {
                "config_name": part.name,
                **({"default": True} if part is first else {}),
                "data_files": [{"split": part.split, "path": [f"{part.name}/{file}" for file in part.files]}],
            }
            for part in parts
        ],
        "dataset_info": [_info(part) for part in parts],
    }


def _info(part: Part) -> dict[str, Any]:
    paths = [part.pool.folder / file for file in part.files]
    schema, unpacked = pq.read_schema(paths[0]), 0
    for path in paths:
        metadata = pq.read_metadata(path)
        unpacked += sum(metadata.row_group(i).total_byte_size for i in range(metadata.num_row_groups))
    return {
        "config_name": part.name,
        "features": _entries(schema),
        "splits": [{"name": part.split, "num_bytes": unpacked, "num_examples": len(part.pool)}],
        "download_size": sum(path.stat().st_size for path in paths),
        "dataset_size": unpacked,
    }


def _entries(fields: pa.Schema | pa.StructType) -> list[dict[str, Any]]:
    """Columns in the words of `datasets`."""
    return [{"name": field.name, **_feature(field.type)} for field in fields]


def _feature(kind: pa.DataType) -> dict[str, Any]:
    if pa.types.is_struct(kind):
        return {"struct": _entries(kind)}
    if not isinstance(kind, (pa.ListType, pa.FixedSizeListType)):
        return {"dtype": {"double": "float64", "float": "float32"}.get(str(kind), str(kind))}
    length = {"length": kind.list_size} if isinstance(kind, pa.FixedSizeListType) else {}
    if pa.types.is_struct(kind.value_type):
        return {"list": _entries(kind.value_type), **length}
    inner = _feature(kind.value_type)
    return {"list": inner["dtype"] if inner.keys() == {"dtype"} else inner, **length}


def _text(parts: Sequence[Part], title: str) -> str:
    """What people read."""
    told = [Tally.of(one for (one,) in part.pool.columns("certificate")) for part in parts]
    overview = [
        [f"`{p.name}`", p.split, len(p.pool), p.pool.funnel["proposed"], p.settings, found.robust, p.verified]
        for p, found in zip(parts, told, strict=True)
    ]
    checks = [[name, HOLDS[name], CHECKS[name], *(found.passed(name) for found in told)] for name in CHECKS]
    nodes = {part.pool.task: part.pool.task_node for part in parts}
    moved = [(part.pool.task, axis) for part in parts for axis in _axes(part)]
    axes = [[f"`{task}`", axis, _said(nodes[task]["axes"][axis].get("why", ""))] for task, axis in dict.fromkeys(moved)]
    counts = _accessibility(parts, told)
    return Template((Path(__file__).parent / "card.md").read_text(), keep_trailing_newline=True).render(
        title=_said(title),
        parts=parts,
        first=parts[0],
        versions=parts[0].pool.versions,
        tasks=[{"name": name, **{k: _said(node[k]) for k in ("code", "instruction")}} for name, node in nodes.items()],
        overview=_table(["configuration", "split", "scenarios", "drawn", "settings", "robust", "verified"], overview),
        axes=_table(["task", "axis", "why"], axes) if axes else "",
        checks=_table(["check", "what holds", "if not", *(f"`{part.name}`" for part in parts)], checks),
        accessibility=_table(["configuration", "kind of plan", "actions", "hits", "bound"], counts) if counts else "",
    )


def _axes(part: Part) -> list[str]:
    """Names of the axes of its split."""
    known = part.pool.task_node.get("axes") or {}
    return [axis for text in part.pool.split.split("+") if (axis := text.partition("@")[0]) in known]


def _accessibility(parts: Sequence[Part], told: Sequence[Tally]) -> list[list[Any]]:
    """How often adversaries reached the goals: those of the checks, and those of the pools as a whole."""
    lines = []
    for part, found in zip(parts, told, strict=True):
        counted = [Rate(r["tier"], r["raw"], r["rollouts"], r["hits"]) for r in _attacks(part.pool)]
        for rate in rates([*counted, *found.rates]):
            hits = f"{rate.hits} of {rate.rollouts}"
            lines.append([f"`{part.name}`", rate.tier, spelled(rate.raw), hits, f"< {rate.bound:.1%}"])
    return lines


def _attacks(pool: Pool) -> list[Mapping[str, Any]]:
    return pool.manifest.get("attack", {}).get("rates", [])


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(str(cell) for cell in line)} |\n" for line in lines)


def _said(text: Any) -> str:
    """Text of a pool, as one line without markup."""
    plain = " ".join(printable(str(text)).split())
    return "".join(f"\\{letter}" if letter in r"\`*_[]<>|#" else letter for letter in plain)
