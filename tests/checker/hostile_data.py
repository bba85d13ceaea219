"""Hostile rows and manifests: names that lead elsewhere, numbers that never end, types and depths nobody expects.

A module that somebody imports writes the file `IMPORTED` into the working folder; the driver looks for it.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from forgery import Case, Draft
from labels import Change

MODULE = "open('IMPORTED', 'w').close()\nfrom scengen.tasks.domino_single import DominoSingle as Evil\n"
DEEP = 100_000
BASE = "single_quick"

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
            for check in row["certificate"]["checks"]:
                if "settle" in check["settings"]:
                    check["settings"]["settle"] = value

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
    "id_with_a_line": lambda d: d.row.update(id=d.row["id"] + "\n", kept=("id",)),
    "task_null": _row(task=None),
    "task_climbs": _row(task="../../evil"),
    "task_bracketed": _row(task="[domino_single]"),
    "task_long": _row(task="d" * 10_000),
    "task_override": _row(task="domino_single,packing"),
    "task_interpolated": _row(task="${oc.env:HOME}"),
    "instruction_markup": _row(instruction="[/]"),
    "instruction_terminal": _row(instruction="\x1b[31m\x1b]0;owned\x07"),
    "instruction_long": _row(instruction="x" * 50_000_000),
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


def _axes(count: int, severities: int = 0) -> Change:
    """Axes of the command line's own, each of them sound."""
    axis = {"why": "", "replace": {"gap_ratio": ["uniform", 1.3, 1.4]}, "severities": severities}
    return lambda draft: draft.task["axes"].update({f"own_{k}": axis for k in range(count)})


def _mixture(depth: int) -> Change:
    node: list[Any] = ["uniform", 0.6, 1.2]
    for _ in range(depth):
        node = ["mixture", node, ["uniform", 0.6, 1.2]]
    return _entry(node, "config", "task", "id", "gap_ratio")


def _hopeless(indices: int, draws: int | None = None) -> Change:
    """Thousands of indices, of which every one has to be drawn a hundred times in vain; the manifest may say so."""

    def change(draft: Draft) -> None:
        draft.config["split"] = "hopeless"
        draft.task["axes"]["hopeless"] = {"why": "", "replace": {"gap_ratio": ["uniform", 2.1, 2.4]}}
        draft.manifest.update(indices=indices, n=20_000, first_draws=0)
        if draws is not None:
            draft.manifest["funnel"]["proposed"] = draws
        draft.every(split="hopeless", axes=["hopeless"])

    return change


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
    "axes_many": _axes(20_000),
    "axes_some": _axes(150),
    "axes_with_severities": _axes(150, severities=100),
    "severities_endless": _axes(1, severities=10**9),
    "choice_long": _entry(["choice", *range(-180, 180)] * 300, "config", "task", "id", "heading"),
    "mixture_deep": _mixture(300),
    "manifest_extra": _manifest(signed_by="the authors"),
    "config_extra": _entry(True, "config", "reviewed"),
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
    "indices_hopeless": _hopeless(11_000),
    "indices_hopeless_and_counted": _hopeless(130, 13_000),
    "indices_hopeless_and_many": _hopeless(20_000, 2_000_000),
    "indices_true": _manifest(indices=True),
    "versions_list": _manifest(versions=[]),
    "format_text": _manifest(format="two"),
    "format_later": _manifest(format=99),
    "format_list": _manifest(format=[2]),
}

# --- all of them ------------------------------------------------------------------------------------------

QUICK = {
    "id_climbs", "task_climbs", "horizon_nan", "params_deep", "settle_endless", "instruction_markup", "family_module",
    "indices_huge",
}  # fmt: skip
WITH_A_MODULE = ("task_climbs", "family_module", "task_name_climbs")
SAYS = {
    "id": r"\bid\b",
    "task": r"task",
    "horizon": r"horizon|finite",
    "settle": r"settl|finite",
    "params": r"param|JSON|id |deep|nested|finite",
    "family": r"family",
}
"""Reasons by the first word of a name; a line is enough for the others."""


def _yaml(folder: Path) -> None:
    """A task file and a module in the pool, for who follows the row's task or the manifest's family."""
    (folder / "evil.yaml").write_text(
        "family: evilmod.Evil\ncode: T17\ncategory: P3\ninstruction: x\nhorizon: 12000.0\nid: {}\n"
    )
    (folder / "evilmod.py").write_text(MODULE)


def _case(prefix: str, name: str, change: Change) -> Case:
    """One of the above. Some axes of one's own are no fault, as long as verification comes to an end."""
    damage = _yaml if name in WITH_A_MODULE else None
    says = SAYS.get(name.partition("_")[0], r"\w")
    return Case(
        f"{prefix}__{name}",
        BASE,
        "accept" if name == "axes_some" else "refuse",
        says,
        change,
        damage,
        quick=name in QUICK,
    )


CASES = [
    *(_case("row", name, change) for name, change in ROWS.items()),
    *(_case("manifest", name, change) for name, change in MANIFESTS.items()),
]
