"""Pools that are made to run code, to hang, to use up memory, to write elsewhere, or to end in a traceback.

Large things are made when the corpus is, small on disk. A module that somebody imports writes the file `IMPORTED` into
the working folder; the driver looks for it.
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

MARK = "IMPORTED"
MODULE = f"open({MARK!r}, 'w').close()\nfrom scengen.tasks.domino_single import DominoSingle as Evil\n"
DEEP = 100_000

# --- rows ---------------------------------------------------------------------------------------------


def _row(**columns: Any) -> Change:
    """Columns of the first scenario; an id that is given stays as it is."""

    def change(draft: Draft) -> None:
        draft.row.update(columns)
        if "id" in columns:
            draft.row["kept"] = ("id",)

    return change


def _certificate(**columns: Any) -> Change:
    return lambda draft: draft.certificate.update(columns)


def _settle(value: Any) -> Change:
    def change(draft: Draft) -> None:
        draft.config["certify"]["settle"] = value
        for row in draft.rows:
            row["certificate"]["checks"][-1]["settings"]["settle"] = value

    return change


def _horizon(value: float) -> Change:
    """Rows, checks and manifest agree on a time limit that never comes, with a witness that does nothing."""

    def change(draft: Draft) -> None:
        draft.task["horizon"] = value
        for row in draft.rows:
            row.update(horizon=value, witness=np.zeros((0, 7), np.float32))
            for check in row["certificate"]["checks"]:
                if "horizon" in check["settings"]:
                    check["settings"]["horizon"] = value

    return change


def _params(text: Any) -> Change:
    def change(draft: Draft) -> None:
        draft.row.update(params=text, kept=("id",))

    return change


def _check_text(column: str, text: Any) -> Change:
    return lambda draft: draft.certificate["checks"][3].update({column: text})


def _drop_twin(draft: Draft) -> None:
    for row in draft.rows:
        del row["id_twin"]
    draft.schema = draft.schema.remove(draft.schema.get_field_index("id_twin"))


def _extra_column(draft: Draft) -> None:
    draft.schema = draft.schema.append(pa.field("pickle", pa.binary()))
    draft.row["pickle"] = b"cos\nsystem\n(S'touch IMPORTED'\ntR."


def _ids_as_numbers(draft: Draft) -> None:
    where = draft.schema.get_field_index("seed")
    draft.schema = draft.schema.set(where, pa.field("seed", pa.string()))
    draft.every(seed="0")


def _wide_witness(draft: Draft) -> None:
    where = draft.schema.get_field_index("witness")
    draft.schema = draft.schema.set(where, pa.field("witness", pa.list_(pa.list_(pa.float32()))))
    for row in draft.rows:
        row["witness"] = [[0.0, 0.0, 0.0]] * 5


ROWS: dict[str, Change] = {
    "id_climbs": _row(id="../../../evil"),
    "id_absolute": _row(id="/tmp/evil"),
    "id_markup": _row(id="[/]<script>"),
    "id_terminal": _row(id="\x1b]0;owned\x07\x1b[2J"),
    "id_long": _row(id="a" * 10_000),
    "id_capital": _row(id="ABCDEF012345"),
    "id_empty": _row(id=""),
    "id_null": _row(id=None),
    "task_null": _row(task=None),
    "task_climbs": _row(task="../../evil"),
    "task_bracketed": _row(task="[domino_single]"),
    "task_long": _row(task="d" * 10_000),
    "task_override": _row(task="domino_single,packing"),
    "task_interpolated": _row(task="${oc.env:HOME}"),
    "instruction_markup": _row(instruction="[/]"),
    "instruction_terminal": _row(instruction="\x1b[31m\x1b]0;owned\x07"),
    "instruction_null": _row(instruction=None),
    "split_markup": _row(split="[/bold]"),
    "axes_null": _row(axes=None),
    "horizon_nan": _horizon(float("nan")),
    "horizon_infinite": _horizon(float("inf")),
    "horizon_endless": _horizon(1e300),
    "horizon_negative": _horizon(-1.0),
    "settle_infinite": _settle(float("inf")),
    "settle_endless": _settle(1e7),
    "settle_text": _settle("long"),
    "settle_null": _settle(None),
    "settle_negative": _settle(-5),
    "params_list": _params("[1, 2]"),
    "params_number": _params("7"),
    "params_nan": _params('{"x": NaN}'),
    "params_deep": _params("[" * DEEP + "]" * DEEP),
    "params_deep_mapping": _params('{"x": ' * DEEP + "1" + "}" * DEEP),
    "params_huge_number": _params('{"x": 1' + "0" * 5000 + "}"),
    "params_unknown": _params('{"evil": 1}'),
    "settings_deep": _check_text("settings", "[" * DEEP),
    "numbers_no_json": _check_text("numbers", "drift: 0"),
    "reason_markup": _check_text("reason", "[/] [link=file:///etc/passwd]x"),
    "certificate_null": _row(certificate=None),
    "checks_null": _certificate(checks=None),
    "versions_no_mapping": _certificate(versions="[]"),
    "witness_null": _row(witness=None),
    "column_missing": _drop_twin,
    "column_added": _extra_column,
    "column_of_another_type": _ids_as_numbers,
    "witness_of_three_numbers": _wide_witness,
    "embodiment_unknown": _row(embodiment="../../panda"),
    "seed_huge": _row(seed=2**62),
    "index_huge": _row(index=2**62),
    "attempt_huge": _row(attempt=2**62),
}

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


SCENES: dict[str, Change] = {
    "time_step_tiny": _option('timestep="1e-9"'),
    "time_step_zero": _option('timestep="0"'),
    "time_step_denormal": _option('timestep="1e-300"'),
    "iterations": _option('iterations="1000000000" tolerance="0"'),
    "replicated": _body('<replicate count="1000000" offset="0 0 1"><geom size="0.01"/></replicate>'),
    "replicated_twice": _body(
        '<replicate count="3000" offset="0 0 1"><replicate count="3000" offset="1 0 0"><geom size="0.01"/></replicate></replicate>'
    ),
    "heap": _body(
        '<replicate count="10000" offset="0.001 0 0"><body pos="0 0 2"><freejoint/><geom size="0.01"/></body></replicate>'
    ),
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


# --- manifests ----------------------------------------------------------------------------------------


def _manifest(**entries: Any) -> Change:
    return lambda draft: draft.manifest.update(entries)


def _without(*path: str) -> Change:
    def change(draft: Draft) -> None:
        node = draft.manifest
        for key in path[:-1]:
            node = node[key]
        del node[path[-1]]

    return change


def _entry(value: Any, *path: str) -> Change:
    def change(draft: Draft) -> None:
        node = draft.manifest
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = value

    return change


def _imports(family: str) -> Change:
    """The family of the task file, which the manifest names."""
    return lambda draft: draft.task.update(family=family)


MANIFESTS: dict[str, Change] = {
    "family_antigravity": _imports("antigravity.fly"),
    "family_module": _imports("evilmod.Evil"),
    "family_function": _imports("os.system"),
    "family_number": _imports("7"),
    "task_name_climbs": _entry("../../evil", "config", "task", "name"),
    "task_name_number": _entry(5, "config", "task", "name"),
    "task_no_mapping": _entry("domino_single", "config", "task"),
    "axis_markup": _entry({"[/]": {"replace": {}}}, "config", "task", "axes"),
    "range_no_list": _entry("uniform", "config", "task", "id", "gap_ratio"),
    "range_endless": _entry(["uniform", 0.6, float("inf")], "config", "task", "id", "gap_ratio"),
    "range_unknown": _entry(["evil", 0.6, 1.0], "config", "task", "id", "gap_ratio"),
    "config_list": _manifest(config=[]),
    "config_missing": _without("config"),
    "certify_missing": _without("config", "certify"),
    "certify_text": _entry("quick", "config", "certify"),
    "certify_deep": _entry({"seconds": {"seconds": {}}}, "config", "certify", "rest"),
    "seed_text": _entry("0", "config", "seed"),
    "seed_negative": _entry(-1, "config", "seed"),
    "split_long": _entry("+".join(["diagonal"] * 5000), "config", "split"),
    "sampler_grid_huge": _entry("grid:1000000", "config", "sampler"),
    "sampler_lhs_huge": _entry("lhs:1000000000", "config", "sampler"),
    "funnel_missing": _without("funnel"),
    "funnel_nan": _entry(float("nan"), "funnel", "certified"),
    "funnel_markup": _entry(1, "funnel", "[/]"),
    "reasons_list": _manifest(reasons=["x"]),
    "indices_huge": _manifest(indices=10**15),
    "indices_true": _manifest(indices=True),
    "versions_list": _manifest(versions=[]),
    "format_text": _manifest(format="two"),
    "format_later": _manifest(format=99),
    "format_list": _manifest(format=[2]),
}

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


def _yaml(folder: Path) -> None:
    """A task file and a module in the pool, for who follows the row's task or the manifest's family."""
    (folder / "evil.yaml").write_text(
        "family: evilmod.Evil\ncode: T17\ncategory: P3\ninstruction: x\nhorizon: 12000.0\nid: {}\n"
    )
    (folder / "evilmod.py").write_text(MODULE)


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
    "id_climbs", "task_climbs", "horizon_nan", "params_deep", "settle_endless", "instruction_markup", "time_step_tiny",
    "replicated_elsewhere", "family_module", "indices_huge", "shard_is_a_pipe", "shard_truncated", "manifest_deep",
}  # fmt: skip

BASE = "single_quick"
WITH_A_MODULE = ("task_climbs", "family_module", "task_name_climbs")
ABOUT = {
    "id": r"id",
    "task": r"task",
    "horizon": r"horizon|finite",
    "settle": r"settle|settings|finite",
    "params": r"param|JSON|id |deep",
    "family": r"family",
}
"""Reasons by the first word of a name; a line is enough for the others."""


def _says(name: str) -> str:
    return ABOUT.get(name.partition("_")[0], r"\w")


def _cases() -> list[Case]:
    found = []
    for name, change in [*ROWS.items(), *MANIFESTS.items()]:
        damage = _yaml if name in WITH_A_MODULE else None
        prefix = "manifest__" if name in MANIFESTS else "row__"
        found.append(Case(prefix + name, BASE, "refuse", _says(name), change, damage, quick=name in QUICK))
    for name, change in SCENES.items():
        for suffix, made in (("", change), ("_elsewhere", _elsewhere(change))):
            full = name + suffix
            found.append(Case(f"scene__{full}", BASE, "refuse", SCENE, made, quick=full in QUICK))
    for name, damage in FILES.items():
        found.append(Case(f"file__{name}", BASE, "refuse", r"\w", lambda draft: None, damage, quick=name in QUICK))
    found.append(Case("file__rejected_truncated", "single_kept", "refuse", r"reject", lambda draft: None, _rejected))
    return found


CASES = _cases()
