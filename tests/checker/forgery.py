"""Pools that are changed and written again with right hashes, so that nothing is false but the claim.

Pools are read and written with pyarrow and json alone: what is to be tested has no part in it. Only who changes the
physics asks scengen for the state in which the witness ends, as a forger would.
"""

import copy
import hashlib
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

Row = dict[str, Any]
SHARD = "scenarios-00000.parquet"
REJECTED = "rejected.parquet"
ELSEWHERE = "0123456789abcdef"
"""A fingerprint of no machine: where it stands, the final state cannot be compared."""


@dataclass
class Draft:
    """A pool that is being changed. Columns that hold JSON are values here; a text is written as it is."""

    manifest: dict[str, Any]
    rows: list[Row]
    rejected: list[Row]
    schema: pa.Schema
    family: str
    """Dotted path of the family's class, which ids depend on."""
    listed_rows: int | None = None
    """How many rows the manifest says that there are, if it lies."""

    @classmethod
    def of(cls, folder: Path) -> "Draft":
        """Read a pool."""
        rejected = folder / REJECTED
        manifest = json.loads((folder / "manifest.json").read_text())
        return cls(
            manifest,
            _read(folder / SHARD),
            _read(rejected) if rejected.exists() else [],
            pq.read_schema(folder / SHARD),
            manifest["config"]["task"]["family"],
        )

    # --- shorter names ----------------------------------------------------------------------

    @property
    def row(self) -> Row:
        """The first scenario, the usual victim."""
        return self.rows[0]

    @property
    def certificate(self) -> dict[str, Any]:
        """That of the first scenario."""
        return self.row["certificate"]

    @property
    def config(self) -> dict[str, Any]:
        return self.manifest["config"]

    @property
    def task(self) -> dict[str, Any]:
        """The task's file in the manifest."""
        return self.config["task"]

    def check(self, name: str) -> dict[str, Any]:
        """A check of the first scenario."""
        return next(check for check in self.certificate["checks"] if check["name"] == name)

    def every(self, **columns: Any) -> None:
        """Give some columns of all scenarios the same value."""
        for row in self.rows:
            row.update(copy.deepcopy(columns))

    def everywhere(self, **fields: Any) -> None:
        """Give a field of all certificates, and of the manifest, the same value."""
        self.manifest.update(copy.deepcopy(fields))
        for row in self.rows:
            row["certificate"].update(copy.deepcopy(fields))

    # --- the scene --------------------------------------------------------------------------

    def scene(self, pattern: str, new: str | Callable[[re.Match[str]], str], rows: int = 1) -> None:
        """Replace the first match of a pattern in the scene of the first so many scenarios."""
        for row in self.rows[:rows]:
            row["scene_xml"], count = re.subn(pattern, new, row["scene_xml"], count=1, flags=re.S)
            assert count, f"nothing in the scene matches {pattern}"

    def add(self, element: str, to: str = "mujoco") -> None:
        """Add an element to the first scene, at the end of its root or of the world."""
        self.scene(f"</{to}>", f"{element}</{to}>")

    # --- physics ----------------------------------------------------------------------------

    def played(self, actions: Any = None) -> None:
        """Let the first scenario's witness, or these actions, end where they do, and say so.

        Raises:
            AssertionError: they do not reach the goal: this would be no forgery, but a damage.
        """
        from scengen import load_task
        from scengen.sim.world import World
        from scengen.validate.rollout import replay

        row = self.row
        scenario = load_task(row["task"]).scenario(row["params"])
        world = World.load(row["scene_xml"], row["embodiment"])
        actions = row["witness"] if actions is None else np.asarray(actions, np.float32)
        rollout = replay(scenario, world, actions, row["horizon"], self.check("witness")["settings"]["settle"])
        assert rollout.solved, rollout.reason
        row["witness"], row["certificate"]["final_state"] = rollout.actions, rollout.digest
        self.timed(len(rollout.actions), rollout.seconds)

    def idle(self) -> None:
        """Solve the first scenario by doing nothing."""
        from scengen.sim.embodiment import action_size

        self.played(np.zeros((0, action_size(self.row["embodiment"]))))

    def timed(self, periods: int, seconds: float) -> None:
        """Let the certificate of the first scenario say how long its witness is."""
        self.check("witness")["numbers"] = {"periods": periods, "seconds": seconds}
        self.check("solved")["numbers"]["seconds"] = seconds

    # --- writing ----------------------------------------------------------------------------

    def write(self, folder: Path) -> None:
        """Write the pool with all hashes and ids to match; what is pinned by `kept` stays as it is."""
        folder.mkdir(parents=True)
        for row in [*self.rows, *self.rejected]:
            self._seal(row)
        shard = self._shard(folder, SHARD, self.rows)
        self.manifest["shards"] = [shard if self.listed_rows is None else {**shard, "rows": self.listed_rows}]
        if self.rejected:
            self.manifest["rejected"] = self._shard(folder, REJECTED, self.rejected)
        write_manifest(folder, self.manifest)

    def _seal(self, row: Row) -> None:
        pinned = row.pop("kept", ())
        scene, witness = row["scene_xml"], row["witness"]
        hashes = {"scene_sha256": sha256(scene.encode(errors="replace")) if isinstance(scene, str) else ""}
        hashes["witness_sha256"] = sha256(witness.tobytes()) if isinstance(witness, np.ndarray) else ""
        row.update({name: value for name, value in hashes.items() if name not in pinned})
        if isinstance(row["certificate"], dict):
            row["certificate"].update({name: value for name, value in hashes.items() if name not in pinned})
        if isinstance(row["params"], dict) and "id" not in pinned:
            old, row["id"] = row["id"], scenario_id(self.family, row["params"])
            if row.get("id_twin") == old:
                row["id_twin"] = row["id"]

    def _shard(self, folder: Path, name: str, rows: list[Row]) -> dict[str, Any]:
        write_table(folder / name, pa.Table.from_pylist([_plain(row) for row in rows], schema=self.schema))
        return listed(folder / name, len(rows))


@cache
def _read(path: Path) -> Any:
    from scengen.sim.embodiment import action_size

    rows = pq.read_table(path).to_pylist()
    for row in rows:
        row["witness"] = np.array(row["witness"], np.float32).reshape(-1, action_size(row["embodiment"]))
        row["params"], row["shifted"] = json.loads(row["params"]), json.loads(row["shifted"])
        certificate = row["certificate"]
        certificate["versions"] = json.loads(certificate["versions"])
        for check in certificate["checks"]:
            check["settings"], check["numbers"] = json.loads(check["settings"]), json.loads(check["numbers"])
    return rows


def _plain(row: Row) -> Row:
    """A row as Parquet stores it."""
    plain = dict(row)
    for name in ("params", "shifted"):
        plain[name] = _text(plain[name])
    if isinstance(plain["witness"], np.ndarray):
        plain["witness"] = plain["witness"].tolist()
    if isinstance(certificate := plain["certificate"], dict):
        checks = certificate["checks"] and [
            {**check, "settings": _text(check["settings"]), "numbers": _text(check["numbers"])}
            for check in certificate["checks"]
        ]
        plain["certificate"] = {**certificate, "checks": checks, "versions": _text(certificate["versions"])}
    return plain


def _text(value: Any) -> Any:
    return value if value is None or isinstance(value, str) else json.dumps(value, sort_keys=True)


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def scenario_id(family: str, params: dict[str, Any]) -> str:
    """The id that belongs to some parameter values."""
    return sha256(f"{family} {json.dumps(params, sort_keys=True)}".encode())[:12]


def write_table(path: Path, table: pa.Table, **options: Any) -> None:
    """Write a shard as scengen does, unless other options are requested."""
    usual = {"compression": "zstd", "compression_level": 3, "row_group_size": 1000, "write_page_checksum": True}
    pq.write_table(table, path, **{**usual, **options})


def listed(path: Path, rows: int) -> dict[str, Any]:
    """What a manifest says of a shard."""
    content = path.read_bytes()
    return {"file": path.name, "rows": rows, "bytes": len(content), "sha256": sha256(content)}


def write_manifest(folder: Path, manifest: Any) -> None:
    text = manifest if isinstance(manifest, str) else json.dumps(manifest, indent=1, sort_keys=True) + "\n"
    (folder / "manifest.json").write_text(text, errors="surrogatepass")


@dataclass(frozen=True)
class Case:
    """One pool of the corpus, and what a checker must say of it."""

    name: str
    base: str
    """The pool that it is made from."""
    expect: str
    """`accept`, `reject`, `decline`, `refuse` where either of the last two will do, or `end` where any will."""
    says: str = ""
    """Regular expression of the reason, or of the remark about a pool that is accepted."""
    forge: Callable[[Draft], None] | None = None
    """What is changed before the pool is written; without it the base is copied."""
    damage: Callable[[Path], None] | None = None
    """What is changed afterwards, in the pool's folder."""
    level: str = "replay"
    """The lowest level of verification that must tell."""
    arguments: tuple[str, ...] = ()
    """Further arguments of the command."""
    quick: bool = False
    """Whether it belongs to the small corpus of `make test`."""
    kind: str = field(default="", compare=False)

    def make(self, base: Path, folder: Path) -> None:
        """Write the pool."""
        if self.forge is None:
            shutil.copytree(base / self.base, folder)
        else:
            draft = copy.deepcopy(Draft.of(base / self.base))
            self.forge(draft)
            draft.write(folder)
        if self.damage:
            self.damage(folder)
