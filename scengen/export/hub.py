"""Pools as a data set for the Hugging Face Hub: a folder whose README.md describes it to the viewer and to `datasets`.

README.md                            the dataset card: a YAML head (configurations, columns, sizes, licence) and a text
<task>-<split>/manifest.json ...     a byte-by-byte copy of a pool, one configuration each; `scengen verify` accepts it
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

from ..attack.evidence import TierRate, rates, spelled
from ..certificate import CHECKS, Check, StoredCertificate
from ..errors import BadConfig
from ..pool import Pool
from ..pool.manifest import MANIFEST
from ..samplers.split import ID
from ..work.printed import printable
from ..work.targets import appearing, check_same, clear_unfinished, try_folder

CARD_FILE = "README.md"
"""Name of the file that the Hub reads as the dataset card."""
SIZE_CATEGORIES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))
"""Upper bounds of the number of rows, and the Hub's category below each."""
LARGEST_SIZE_CATEGORY = "n>1M"
"""The Hub's category above all bounds."""
CHECK_MEANINGS = {
    "feasible": "no analytic refutation: out of reach, gap too wide",
    "compiles": "the scene on disk loads in plain MuJoCo without a warning",
    "overlap": "bodies do not overlap at the start",
    "rest": "everything stays where it is while the robot is idle",
    "unsolved": "the goal does not hold at the start",
    "idle": "an idle robot does not reach the goal",
    "shortcuts": "every shortcut fails",
    "solved": "the oracle reaches the goal, which lasts",
    "robust": "the oracle succeeds under jitter in poses, masses, friction, actions and latency",
    "numerics": "finer time steps and more solver iterations do not change the verdict",
    "ablations": "without the intended means the witness fails",
    "witness": "the recorded actions alone end in the same bits",
    "attack": "the adversary finds no other way to the goal",
}
"""Meaning of each check of a certificate, by name."""


@dataclass(frozen=True)
class PublishedPool:
    """A pool in the data set: one configuration."""

    pool: Pool
    settings: str
    """Settings of its certificates: `quick`, `full`, or the difference from one of them."""
    verified: str
    """Description of how its certificates were verified."""

    @property
    def name(self) -> str:
        """Name of the configuration and of its folder."""
        return configuration(self.pool)

    @property
    def split(self) -> str:
        """The Hub's name of the split: `train` for training scenarios, else `test`."""
        return "train" if self.pool.split == ID else "test"

    @property
    def scenario_files(self) -> list[str]:
        """Names of its files of scenarios."""
        return [entry.file for entry in self.pool.manifest.shards]


@dataclass(frozen=True)
class DatasetCard:
    """The card of a data set: a head for the Hub and a text for people."""

    pools: Sequence[PublishedPool]
    title: str
    license: str
    """Licence of the data, as the Hub spells it."""

    def readme(self) -> str:
        """Content of the card's file."""
        head = yaml.safe_dump(self._head(), sort_keys=False, allow_unicode=True, width=1000)
        return f"---\n{head}---\n\n{self._text()}"

    def _head(self) -> dict[str, Any]:
        """Metadata for the Hub."""
        count = sum(len(published.pool) for published in self.pools)
        default = next((published for published in self.pools if published.split == "train"), self.pools[0])
        return {
            "pretty_name": self.title,
            "license": self.license,
            "language": ["en"],
            "task_categories": ["robotics"],
            "tags": ["robotics", "manipulation", "mujoco", "out-of-distribution", "scengen"],
            "size_categories": [
                next((name for bound, name in SIZE_CATEGORIES if count < bound), LARGEST_SIZE_CATEGORY)
            ],
            "configs": [
                {
                    "config_name": published.name,
                    **({"default": True} if published is default else {}),
                    "data_files": [
                        {
                            "split": published.split,
                            "path": [f"{published.name}/{file}" for file in published.scenario_files],
                        }
                    ],
                }
                for published in self.pools
            ],
            "dataset_info": [_dataset_info(published) for published in self.pools],
        }

    def _text(self) -> str:
        """Text for people."""
        pools = self.pools
        tallies = [Tally.of(one for (one,) in published.pool.columns("certificate")) for published in pools]
        overview = [
            [
                _code(p.name),
                p.split,
                len(p.pool),
                p.pool.manifest.funnel["proposed"],
                p.settings,
                tally.robust,
                p.verified,
            ]
            for p, tally in zip(pools, tallies, strict=True)
        ]
        checks = [
            [name, CHECK_MEANINGS[name], CHECKS[name], *(tally.passed(name) for tally in tallies)] for name in CHECKS
        ]
        nodes = {published.pool.task: published.pool.manifest.task_node for published in pools}
        moved = [(published.pool.task, axis) for published in pools for axis in _axes(published)]
        axes = [
            [_code(task), _code(axis), nodes[task]["axes"][axis].get("why", "")] for task, axis in dict.fromkeys(moved)
        ]
        hits = _accessibility(pools, tallies)
        template = Template((Path(__file__).parent / "dataset_card.md").read_text(), keep_trailing_newline=True)
        return template.render(
            title=_escaped(self.title),
            pools=pools,
            first=pools[0],
            versions=pools[0].pool.manifest.versions,
            tasks=[
                {"name": name, **{k: _escaped(node[k]) for k in ("code", "instruction")}}
                for name, node in nodes.items()
            ],
            overview=_table(
                ["configuration", "split", "scenarios", "drawn", "settings", "robust", "verified"], overview
            ),
            axes=_table(["task", "axis", "why"], axes) if axes else "",
            checks=_table(["check", "what holds", "if not", *(_code(published.name) for published in pools)], checks),
            accessibility=_table(["configuration", "kind of plan", "actions", "hits", "bound"], hits) if hits else "",
        )


@dataclass
class Tally:
    """Totals over the certificates of a pool."""

    times: Counter[str] = field(default_factory=Counter)
    """Number of certificates in which each check has passed."""
    made: set[str] = field(default_factory=set)
    """Names of the checks that were made in at least one certificate, not waived."""
    worst: Mapping[str, Any] = field(default_factory=dict)
    """Numbers of the check `robust` in the scenario with the lowest bound."""
    rates: list[TierRate] = field(default_factory=list)
    """Hit rates of the adversaries of the check `attack`."""

    @classmethod
    def of(cls, certificates: Iterable[StoredCertificate]) -> "Tally":
        """The totals of some certificates, which are read one after the other."""
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
            more = [TierRate(tier, how == spelled(True), n["rollouts"], n["hits"]) for tier, _, how, n in parted]
            self.rates = rates([*self.rates, *more])

    def passed(self, name: str) -> str:
        """Number of certificates in which a check has passed, or `not checked`."""
        return str(self.times[name]) if name in self.made else "not checked"

    @property
    def robust(self) -> str:
        """Successes of the oracle under jitter in the worst scenario, and their bound."""
        return Markdown(f"{self.worst['solved']} of {self.worst['runs']} (> {self.worst['bound']:.0%})")


def check_target(to: Path, pools: Sequence[Pool]) -> None:
    """Raise `BadConfig` unless a folder can be written, and is new, empty, or a data set of some pools already."""
    if not to.name:
        raise BadConfig(f"to = {to}; name a new folder for the data set")
    clear_unfinished(to)
    try_folder(to)
    check_same(to, {**_copies(pools), CARD_FILE: to / CARD_FILE} if (to / CARD_FILE).is_file() else {})


def _copies(pools: Sequence[Pool]) -> dict[str, Path]:
    """The files of some pools by their paths in the data set: scenarios, the manifest, rejected draws that were kept,
    hits of an attack."""
    found = {}
    for pool in pools:
        manifest = pool.manifest
        rejected = [manifest.rejected.file] if manifest.rejected else []
        shards, hits = [entry.file for entry in manifest.shards], [hit["file"] for hit in manifest.hits]
        found |= {f"{configuration(pool)}/{file}": pool.folder / file for file in (*shards, MANIFEST, *rejected, *hits)}
    return found


def configuration(pool: Pool) -> str:
    """Name of the configuration of a pool and of its folder: `domino_single-wide_gaps@3`."""
    return f"{pool.task}-{pool.split}"


def check_pools(pools: Sequence[Pool]) -> None:
    """Raise `BadConfig` unless every pool is the only one of its task and split, and has scenarios."""
    found: dict[str, Path] = {}
    for pool in pools:
        name = configuration(pool)
        if name in found:
            raise BadConfig(f"{found[name]} and {pool.folder} are both {name}; give one pool of each task and split")
        if not len(pool):
            raise BadConfig(f"{pool.folder} holds no scenario; see scengen generate")
        found[name] = pool.folder


def publish(card: DatasetCard, to: Path) -> bool:
    """Write the data set: the card and copies of its pools. The folder appears when it is complete.

    Returns whether it was written; it is not if it is there already.

    Args:
        to: a folder that is new or empty, or holds this data set, as after a command that was killed at its end.

    Raises:
        BadConfig: the folder holds another data set, or cannot be written.
    """
    copies, text = _copies([published.pool for published in card.pools]), card.readme()
    check_same(to, {**copies, CARD_FILE: text.encode()})
    if (to / CARD_FILE).exists():
        return False
    with appearing(to, folder=True) as path:
        for name, source in copies.items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, path / name)
        (path / CARD_FILE).write_text(text)
    return True


def own_license() -> str:
    """Licence of scengen, as the Hub spells it: pools consist of its scenes and task files."""
    return metadata("scengen")["License-Expression"].lower()


def _dataset_info(published: PublishedPool) -> dict[str, Any]:
    paths = [published.pool.folder / file for file in published.scenario_files]
    schema, unpacked = pq.read_schema(paths[0]), 0
    for path in paths:
        metadata = pq.read_metadata(path)
        unpacked += sum(metadata.row_group(i).total_byte_size for i in range(metadata.num_row_groups))
    return {
        "config_name": published.name,
        "features": _columns(schema),
        "splits": [{"name": published.split, "num_bytes": unpacked, "num_examples": len(published.pool)}],
        "download_size": sum(path.stat().st_size for path in paths),
        "dataset_size": unpacked,
    }


def _columns(fields: pa.Schema | pa.StructType) -> list[dict[str, Any]]:
    """Columns in the format of `datasets`."""
    return [{"name": field.name, **_column_type(field.type)} for field in fields]


def _column_type(kind: pa.DataType) -> dict[str, Any]:
    if pa.types.is_struct(kind):
        return {"struct": _columns(kind)}
    if not isinstance(kind, (pa.ListType, pa.FixedSizeListType)):
        return {"dtype": {"double": "float64", "float": "float32"}.get(str(kind), str(kind))}
    length = {"length": kind.list_size} if isinstance(kind, pa.FixedSizeListType) else {}
    if pa.types.is_struct(kind.value_type):
        return {"list": _columns(kind.value_type), **length}
    inner = _column_type(kind.value_type)
    return {"list": inner["dtype"] if inner.keys() == {"dtype"} else inner, **length}


def _axes(published: PublishedPool) -> list[str]:
    """Names of the axes of its split."""
    known = published.pool.manifest.task_node.get("axes") or {}
    return [axis for text in published.pool.split.split("+") if (axis := text.partition("@")[0]) in known]


def _accessibility(pools: Sequence[PublishedPool], tallies: Sequence[Tally]) -> list[list[Any]]:
    """Hit rates of the adversaries: those of the checks and those of attacks on whole pools."""
    lines = []
    for published, tally in zip(pools, tallies, strict=True):
        counted = [TierRate(r["tier"], r["raw"], r["rollouts"], r["hits"]) for r in published.pool.manifest.rates]
        for rate in rates([*counted, *tally.rates]):
            hits = f"{rate.hits} of {rate.rollouts}"
            bound = Markdown(f"< {rate.bound:.1%}")
            lines.append([_code(published.name), _code(rate.tier), spelled(rate.raw), hits, bound])
    return lines


class Markdown(str):
    """Text that is Markdown already. Everything else in a table is escaped, because it may come from a pool."""


def _code(name: str) -> Markdown:
    """A name in the type of code."""
    return Markdown(f"`{_one_line(name).translate(str.maketrans('`|', '__'))}`")


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    lines = [head, [Markdown("---")] * len(head), *rows]
    return "".join(f"| {' | '.join(map(_cell, line))} |\n" for line in lines)


def _cell(content: Any) -> str:
    return content if isinstance(content, Markdown) else _escaped(content)


def _escaped(text: Any) -> str:
    """Text of a pool, as one line without markup."""
    return "".join(f"\\{letter}" if letter in r"\`*_[]<>|#" else letter for letter in _one_line(text))


def _one_line(text: Any) -> str:
    return " ".join(printable(str(text)).split())
