"""Hostile scenes and files: what a parser chokes on, what never ends, what fills the memory, what is no file at all.

Large things are made when the corpus is, and are small on disk.
"""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from forgery import ELSEWHERE, SHARD, Case, Draft, listed, write_manifest, write_table
from labels import Change

BASE = "single_quick"

# --- scenes -------------------------------------------------------------------------------------------


def _option(text: str) -> Change:
    return lambda draft: draft.scene("<option ", f"<option {text} ")


def _body(xml: str) -> Change:
    return lambda draft: draft.add(xml, "worldbody")


def _root(xml: str) -> Change:
    return lambda draft: draft.add(xml)


def _text(text: str) -> Change:
    return lambda draft: draft.row.update(scene_xml=text)


def _blanks(draft: Draft) -> None:
    """200 MB of blanks: a few hundred bytes in the shard."""
    draft.row["scene_xml"] += " " * 200_000_000


BALL = '<geom size="0.01"/>'


def _times(count: int, xml: str) -> str:
    return f'<replicate count="{count}" offset="0.001 0 0.1">{xml}</replicate>'


SCENES: dict[str, Change] = {
    "time_step_tiny": _option('timestep="1e-9"'),
    "time_step_zero": _option('timestep="0"'),
    "time_step_denormal": _option('timestep="1e-300"'),
    "iterations": _option('iterations="1000000000" tolerance="0"'),
    "replicated": _body(_times(1_000_000, BALL)),
    "replicated_twice": _body(_times(3000, _times(3000, BALL))),
    "heap": _body(_times(10_000, f'<body pos="0 0 2"><freejoint/>{BALL}</body>')),
    "height_field": _root('<asset><hfield name="h" nrow="40000" ncol="40000" size="1 1 1 1"/></asset>'),
    "user_numbers": _root('<size nuser_geom="1000000000"/>'),
    "keys": _root('<size nkey="1000000000"/>'),
    "memory": _root('<size memory="100G"/>'),
    "include": _root('<include file="/etc/passwd"/>'),
    "mesh_file": _root('<asset><mesh name="m" file="/etc/passwd"/></asset>'),
    "texture_file": _root('<asset><texture name="m" type="2d" file="/dev/zero"/></asset>'),
    "plugin": _root('<extension><plugin plugin="mujoco.elasticity.cable"/></extension>'),
    "entities": lambda d: d.row.update(
        scene_xml='<!DOCTYPE m [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>' + d.row["scene_xml"]
    ),
    "nested": _body("<body>" * 50_000 + "</body>" * 50_000),
    "empty": _text(""),
    "no_xml": _text("MZ\x90\x03"),
    "other_root": _text("<html/>"),
    "blanks": _blanks,
}
SCENE = r"scene|rebuil|large|bytes|memory|time|died"


def _elsewhere(change: Change) -> Change:
    """The same on a machine that rounds otherwise, where a checker cannot compare bytes alone."""

    def both(draft: Draft) -> None:
        change(draft)
        draft.everywhere(fingerprint=ELSEWHERE)

    return both


# --- files --------------------------------------------------------------------------------------------


def _relist(**entries: Any) -> Callable[[Path], None]:
    """Change what the manifest says of its shard."""

    def damage(folder: Path) -> None:
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["shards"][0].update(entries)
        write_manifest(folder, manifest)

    return damage


def _replaced(make: Callable[[Path], None]) -> Callable[[Path], None]:
    """Something else than a plain file under the name of the shard."""

    def damage(folder: Path) -> None:
        (folder / SHARD).rename(folder / "aside.bin")
        make(folder / SHARD)

    return damage


def _link(path: Path) -> None:
    path.symlink_to("aside.bin")


def _rewritten(change: Callable[[bytes], bytes], seal: bool = True) -> Callable[[Path], None]:
    """Other bytes in the shard, with a hash to match."""

    def damage(folder: Path) -> None:
        path = folder / SHARD
        path.write_bytes(change(path.read_bytes()))
        if seal:
            rows = json.loads((folder / "manifest.json").read_text())["shards"][0]["rows"]
            _relist(**listed(path, rows))(folder)

    return damage


def _flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0x55]) + content[middle + 1 :]


def _table(change: Callable[[pa.Table], pa.Table], **options: Any) -> Callable[[Path], None]:
    """Another table in the shard, with a hash to match."""

    def damage(folder: Path) -> None:
        path = folder / SHARD
        table = change(pq.read_table(path))
        write_table(path, table, **options)
        _relist(**listed(path, table.num_rows))(folder)

    return damage


def _column(name: str, value: Any) -> Callable[[pa.Table], pa.Table]:
    def change(table: pa.Table) -> pa.Table:
        where = table.schema.get_field_index(name)
        return table.set_column(
            where, table.schema.field(where), pa.array([value] * len(table), table.schema.field(where).type)
        )

    return change


def _long_witness(table: pa.Table) -> pa.Table:
    """Ten million actions, all the same: 280 MB in a few hundred bytes."""
    count, where = 10_000_000, table.schema.get_field_index("witness")
    flat = pa.FixedSizeListArray.from_arrays(pa.array(np.zeros(7 * count, np.float32)), 7)
    column = pa.ListArray.from_arrays(pa.array([0, count], pa.int32()), flat).cast(table.schema.field(where).type)
    return table.slice(0, 1).set_column(where, table.schema.field(where), column)


def _many(table: pa.Table) -> pa.Table:
    """The first scenario thirty thousand times: 700 MB in one group of rows."""
    return table.slice(0, 1).take(pa.array(np.zeros(30_000, np.int64)))


def _miscounted(folder: Path) -> None:
    """Two shards, whose counts are false although their sum is right."""
    table, shards = pq.read_table(folder / SHARD), []
    for number, told in enumerate((2, 0)):
        path = folder / f"scenarios-0000{number}.parquet"
        write_table(path, table.slice(number, 1))
        shards.append(listed(path, told))
    manifest = json.loads((folder / "manifest.json").read_text())
    write_manifest(folder, {**manifest, "shards": shards})


def _rows_elsewhere(content: bytes) -> bytes:
    """A shard whose footer says that its columns lie in another file."""
    metadata, written = pq.read_metadata(pa.BufferReader(content)), pa.BufferOutputStream()
    metadata.set_file_path("aside.bin")
    metadata.write_metadata_file(written)
    footer = written.getvalue().to_pybytes()[4:]
    return content[: -8 - int.from_bytes(content[-8:-4], "little")] + footer


def _listed_often(folder: Path) -> None:
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest["shards"] *= 20_000
    write_manifest(folder, manifest)


def _manifest_text(change: Callable[[str], str]) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        path.write_text(change(path.read_text()), errors="surrogatepass")

    return damage


def _manifest_is(make: Callable[[Path], None]) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        path = folder / "manifest.json"
        path.rename(folder / "aside.json")
        make(path)

    return damage


def _rejected(folder: Path) -> None:
    """The kept ones are not those that the manifest names."""
    path = folder / "rejected.parquet"
    path.write_bytes(path.read_bytes()[:-7])


def _big_manifest(folder: Path) -> None:
    with open(folder / "manifest.json", "a") as file:
        file.write(" " * 30_000_000)


FILES: dict[str, Callable[[Path], None]] = {
    "shard_truncated": _rewritten(lambda c: c[:-200]),
    "shard_truncated_unsealed": _rewritten(lambda c: c[:-200], seal=False),
    "shard_flipped": _rewritten(_flip),
    "shard_flipped_unsealed": _rewritten(_flip, seal=False),
    "shard_empty": _rewritten(lambda c: b""),
    "shard_noise": _rewritten(lambda c: bytes(range(256)) * 40),
    "shard_with_a_footer_of_noise": _rewritten(lambda c: c[:-300] + b"\xff" * 292 + c[-8:]),
    "shard_with_a_long_footer": _rewritten(lambda c: c[:-8] + b"\xff\xff\xff\x7f" + c[-4:]),
    "shard_missing": lambda folder: (folder / SHARD).unlink(),
    "shard_is_a_pipe": _replaced(os.mkfifo),
    "shard_is_a_link": _replaced(_link),
    "shard_is_a_device": _replaced(lambda path: path.symlink_to("/dev/zero")),
    "shard_is_a_folder": _replaced(lambda path: path.mkdir()),
    "shard_absolute": _relist(file="/etc/passwd"),
    "shard_climbs": _relist(file=f"../single_quick/{SHARD}"),
    "shard_number": _relist(file=7),
    "shard_bytes_text": _relist(bytes="many"),
    "shard_rows_negative": _relist(rows=-2),
    "shard_rows_wrong": _relist(rows=40),
    "shard_listed_often": _listed_often,
    "shards_miscounted": _miscounted,
    "shard_with_rows_elsewhere": _rewritten(_rows_elsewhere),
    "scene_column_null": _table(_column("scene_xml", None)),
    "witness_long": _table(_long_witness),
    "rows_many": _table(_many, row_group_size=30_000),
    "manifest_empty": _manifest_text(lambda t: ""),
    "manifest_zero": _manifest_text(lambda t: "\0" * 100),
    "manifest_deep": _manifest_text(lambda t: "[" * 200_000),
    "manifest_nested": _manifest_text(lambda t: t.replace('"keep": []', '"keep": ' + "[" * 5000 + "]" * 5000)),
    "manifest_huge_number": _manifest_text(lambda t: t.replace('"n": 2', '"n": 1' + "0" * 6000)),
    "manifest_twice_the_key": _manifest_text(lambda t: t.replace('"n": 2', '"n": 9, "n": 2')),
    "manifest_surrogate": _manifest_text(lambda t: t.replace("Topple", "\\ud800opple")),
    "manifest_long": _big_manifest,
    "manifest_is_a_pipe": _manifest_is(os.mkfifo),
    "manifest_is_a_folder": _manifest_is(lambda path: path.mkdir()),
    "manifest_is_a_device": _manifest_is(lambda path: path.symlink_to("/dev/zero")),
}
"""What is done to the folder of a sound pool; any reason will do, as long as it is one line."""

QUICK = {
    "time_step_tiny",
    "shards_miscounted",
    "shard_with_rows_elsewhere",
    "replicated_elsewhere",
    "shard_is_a_pipe",
    "shard_truncated",
    "manifest_deep",
}


def _scenes() -> list[Case]:
    found = []
    for name, change in SCENES.items():
        for told, made in ((name, change), (f"{name}_elsewhere", _elsewhere(change))):
            found.append(Case(f"scene__{told}", BASE, "refuse", SCENE, made, quick=told in QUICK))
    return found


def _untouched(draft: Draft) -> None:
    """Leave the pool as it is, but write it anew."""


CASES = [
    *_scenes(),
    *(Case(f"file__{n}", BASE, "refuse", r"\w", _untouched, damage, quick=n in QUICK) for n, damage in FILES.items()),
    Case("file__rejected_truncated", "single_kept", "refuse", r"reject", _untouched, _rejected),
]
