"""False claims about what a scenario is called and where it was drawn: task, split, seed, index, funnel, versions."""

import copy
from collections.abc import Callable
from typing import Any

from forgery import ELSEWHERE, Case, Draft, Row
from make_base import TRAINING

Change = Callable[[Draft], None]


def _row(**columns: Any) -> Change:
    """Other columns of the first scenario."""
    return lambda draft: draft.row.update(copy.deepcopy(columns))


def _rows(**columns: Any) -> Change:
    return lambda draft: draft.every(**columns)


def _certificate(**columns: Any) -> Change:
    return lambda draft: draft.certificate.update(columns)


def _manifest(**entries: Any) -> Change:
    return lambda draft: draft.manifest.update(copy.deepcopy(entries))


def _config(**entries: Any) -> Change:
    return lambda draft: draft.config.update(copy.deepcopy(entries))


def _task(**entries: Any) -> Change:
    return lambda draft: draft.task.update(copy.deepcopy(entries))


def _funnel(**counts: int) -> Change:
    return lambda draft: draft.manifest["funnel"].update(counts)


def _both(*changes: Change) -> Change:
    def change(draft: Draft) -> None:
        for one in changes:
            one(draft)

    return change


def _split(name: str, shifted: tuple[str, ...] = ()) -> Change:
    """All labels say another split, and agree with each other."""

    def change(draft: Draft) -> None:
        draft.config["split"] = name
        for row in draft.rows:
            row["split"], row["axes"] = name, [] if name == "id" else name.split("+")
            row["shifted"] = {key: row["params"][key] for key in shifted}
            if name == "id":
                row["id_twin"] = row["id"]

    return change


def _param(name: str, by: float) -> Change:
    """A parameter that was not drawn: the scene is rebuilt, id and hashes are right."""

    def change(draft: Draft) -> None:
        from scengen import load_task
        from scengen.validate.rebuilt import rebuild

        row = draft.row
        row["params"][name] *= by
        scenario = load_task(row["task"]).scenario(row["params"])
        row["scene_xml"] = rebuild(scenario)
        draft.check("feasible")["numbers"] = dict(scenario.features())
        draft.played()

    return change


def _from(draft: Draft, **columns: Any) -> Row:
    return {**copy.deepcopy(draft.row), **columns}


def _twice(draft: Draft) -> None:
    """The first scenario stands at the second index too."""
    draft.rows[1] = _from(draft, index=1)


def _same_index(draft: Draft) -> None:
    draft.rows[1] = _from(draft)


def _backwards(draft: Draft) -> None:
    draft.rows.reverse()


def _drop_first(draft: Draft) -> None:
    """A scenario left out, and every count adapted but that of the indices."""
    del draft.rows[0]
    draft.manifest.update(n=1, indices=1, first_draws=1, funnel=dict.fromkeys(draft.manifest["funnel"], 1))


def _drop_second(draft: Draft) -> None:
    del draft.rows[1]


def _promises(draft: Draft) -> None:
    """So many rows that a thousand million indices are none too many to draw again."""
    draft.manifest.update(n=10**6, indices=10**9)
    draft.manifest["funnel"] = dict.fromkeys(draft.manifest["funnel"], 10**9)
    draft.listed_rows = 10**6


def _versions(where: str, **changed: str) -> Change:
    def change(draft: Draft) -> None:
        if where in ("rows", "both"):
            for row in draft.rows:
                row["certificate"]["versions"].update(changed)
        if where in ("manifest", "both"):
            draft.manifest["versions"].update(changed)

    return change


def _narrower(draft: Draft) -> None:
    """Training ranges as the file has them, scenarios from narrower ones."""
    draft.task["id"]["gap_ratio"] = ["uniform", 0.6, 1.2]


def _family(path: str) -> Change:
    return _task(family=path)


SINGLE: dict[str, tuple[str, str, Change]] = {
    # name: base, reason, change
    "task_of_another": ("single_quick", r"task", _row(task="domino_select")),
    "task_of_another_everywhere": (
        "single_quick",
        r"task|family|parameter",
        _both(
            _rows(task="domino_select"),
            _task(name="domino_select"),
            _family("scengen.tasks.domino_select.DominoSelect"),
        ),
    ),
    "family_of_another": ("single_quick", r"family", _family("scengen.tasks.packing.Packing")),
    "code": ("single_quick", r"code", _row(code="T18")),
    "code_everywhere": ("single_quick", r"code", _both(_rows(code="T18"), _task(code="T18"))),
    "category": ("single_quick", r"category", _row(category="P1")),
    "category_everywhere": ("single_quick", r"category", _both(_rows(category="P1"), _task(category="P1"))),
    "instruction": ("single_quick", r"instruction", _row(instruction="Push the slab.")),
    "instruction_of_all_rows": ("single_quick", r"instruction", _rows(instruction="Push the slab.")),
    "horizon": ("single_quick", r"horizon", _row(horizon=60.0)),
    "horizon_shorter": ("single_quick", r"horizon", _row(horizon=6.0)),
    "horizon_of_all_rows": ("single_quick", r"horizon", _rows(horizon=60.0)),
    "embodiment": ("single_quick", r"embodiment", _row(embodiment="panda_suction")),
    "split_of_a_row": ("single_quick", r"split", _row(split="diagonal")),
    "split_of_the_manifest": ("single_quick", r"split", _config(split="diagonal")),
    "training_called_shifted": ("single_quick", r"parameters|redraw|drawn|id ", _split("wide_gaps", ("gap_ratio",))),
    "shifted_called_training": ("single_axis", r"parameters|redraw|drawn|id ", _split("id")),
    "severity_raised": ("single_severity", r"parameters|redraw|drawn|id ", _split("wide_gaps@4", ("gap_ratio",))),
    "severity_dropped": ("single_severity", r"parameters|redraw|drawn|id ", _split("wide_gaps", ("gap_ratio",))),
    "one_axis_of_two": ("single_composed", r"parameters|redraw|drawn|id ", _split("diagonal", ("heading",))),
    "axis_added": (
        "single_axis",
        r"parameters|redraw|drawn|id ",
        _split("diagonal+light_tiles", ("heading", "tile.mass")),
    ),
    "conditions_that_no_scene_has": ("single_quick", r"parameters|redraw|drawn|id ", _split("payload@2")),
    "conditions_of_no_level": ("single_quick", r"level", _split("payload@9")),
    "unknown_axis": ("single_axis", r"split|axis", _split("sideways", ("heading",))),
    "axes_column": ("single_axis", r"axes", _row(axes=["diagonal", "wide_gaps"])),
    "shifted_value": ("single_axis", r"shifted", _row(shifted={"heading": 30.0})),
    "shifted_nothing": ("single_axis", r"shifted", _row(shifted={})),
    "twin_of_another": ("single_severity", r"twin", _row(id_twin="0123456789ab")),
    "twin_is_itself": ("single_axis", r"twin", lambda d: d.row.update(id_twin=d.row["id"])),
    "twin_of_a_training_scenario": ("single_quick", r"twin", _row(id_twin="0123456789ab")),
    "seed_of_a_row": ("single_quick", r"seed", _row(seed=1)),
    "seed_everywhere": ("single_quick", r"parameters|redraw|drawn|id ", _both(_rows(seed=1), _config(seed=1))),
    "index_of_a_row": ("single_quick", r"index|indices|drawn|parameters", lambda d: d.rows[1].update(index=5)),
    "indices_exchanged": (
        "single_quick",
        r"index|order|drawn|parameters",
        lambda d: (d.rows[0].update(index=1), d.rows[1].update(index=0)),
    ),
    "index_negative": ("single_quick", r"index", _row(index=-1)),
    "attempt": ("single_quick", r"attempt", _row(attempt=3)),
    "attempt_negative": ("single_quick", r"attempt", _row(attempt=-1)),
    "sampler": ("single_quick", r"parameters|redraw|drawn|id ", _config(sampler="sobol")),
    "sampler_unknown": ("single_sobol", r"sampler", _config(sampler="best")),
    "range_of_the_file": ("single_own_range", r"parameters|redraw|drawn|id ", _narrower),
    "hand_picked": ("single_quick", r"parameters|redraw|drawn|id ", _param("x", 0.9)),
    "hand_picked_by_little": ("single_quick", r"parameters|redraw|drawn|id ", _param("slab_yaw", 1.0 + 1e-12)),
    "constant_changed": ("single_quick", r"parameters|redraw|drawn|id ", _param("slab.mass", 0.8)),
    "twice": ("single_quick", r"twice|parameters|drawn", _twice),
    "same_index_twice": ("single_quick", r"twice", _same_index),
    "backwards": ("single_quick", r"order|index", _backwards),
    "first_left_out": ("single_quick", r"index|indices|funnel", _drop_first),
    "second_left_out": ("single_quick", r"funnel|promises|certified| n ", _drop_second),
    "n": ("single_quick", r"\bn\b|scenarios|asked", _manifest(n=1)),
    "indices_fewer": ("single_quick", r"indices|index", _manifest(indices=1)),
    "indices_more": ("single_quick", r"indices|funnel", _manifest(indices=9)),
    "first_draws": ("single_quick", r"first.draws", _manifest(first_draws=1)),
    "funnel_certified": ("single_quick", r"funnel|certified", _funnel(certified=40)),
    "funnel_proposed_fewer": ("single_kept", r"funnel", _funnel(proposed=1)),
    "funnel_proposed_more": ("single_quick", r"funnel", _funnel(proposed=200)),
    "funnel_solved": ("single_quick", r"funnel", _funnel(solved=1)),
    "funnel_without_a_stage": (
        "single_quick",
        r"funnel|damaged|schema|robust",
        lambda d: d.manifest["funnel"].pop("robust"),
    ),
    "funnel_with_a_stage": ("single_quick", r"funnel|damaged|schema|perfect", _funnel(perfect=2)),
    "reasons_invented": ("single_quick", r"reasons|funnel", _manifest(reasons={"robust: bad luck": 3})),
    "reasons_dropped": ("single_kept", r"reasons|funnel", _manifest(reasons={})),
    "versions_of_a_row": ("single_quick", r"version", lambda d: d.certificate["versions"].update(mujoco="3.4.9")),
    "versions_of_the_manifest": ("single_quick", r"version", _versions("manifest", numpy="2.0.0")),
    "versions_lack_mujoco": ("single_quick", r"version", lambda d: d.certificate["versions"].pop("mujoco")),
    "source_of_a_row": ("single_quick", r"source", _certificate(source_sha256="0" * 64)),
    "source_of_the_manifest": ("single_quick", r"source", _manifest(source_sha256="0" * 64)),
    "fingerprint_of_a_row": ("single_quick", r"fingerprint", _certificate(fingerprint=ELSEWHERE)),
    "fingerprint_of_the_manifest": ("single_quick", r"fingerprint", _manifest(fingerprint=ELSEWHERE)),
    "final_state": ("single_quick", r"another state|final", _certificate(final_state="0" * 16)),
    "versions_many": (
        "single_quick",
        r"versions|damaged",
        _versions("both", **{f"package_{k}": "1" for k in range(5000)}),
    ),
    "promises_a_million_rows": ("single_quick", r"promises|scenarios", _promises),
    "subset_of_nothing": ("single_quick", r"subset", _manifest(subset={"of": "no hash", "chosen": "max-min coverage"})),
}

QUICK = {
    "task_of_another", "instruction_of_all_rows", "horizon", "training_called_shifted",
    "severity_raised", "seed_everywhere", "sampler", "twin_of_another", "attempt", "hand_picked_by_little",
    "first_left_out", "final_state", "versions_of_a_row",
}  # fmt: skip

OTHERS = tuple(TRAINING)
EVERY: dict[str, tuple[str, Change]] = {
    "seed_everywhere": (r"parameters|redraw|drawn|id ", _both(_rows(seed=1), _config(seed=1))),
    "horizon": (r"horizon", _row(horizon=100.0)),
    "instruction": (r"instruction", _row(instruction="Do nothing.")),
    "code": (r"code", _row(code="T99")),
}
"""What is claimed for each of the other tasks too."""


def _older_mujoco(draft: Draft) -> None:
    _versions("both", mujoco="3.3.0")(draft)


REFUSED = ("versions_many", "sampler_unknown", "subset_of_nothing", "source_of_the_manifest")
"""Those that a checker may decline: they do not follow the format, or may come from another version."""


def _single(name: str, base: str, says: str, change: Change) -> Case:
    expect = "refuse" if name in REFUSED else "reject"
    return Case(f"{base}__{name}", base, expect, says, change, quick=name in QUICK)


CASES = [
    *(_single(name, *told) for name, told in SINGLE.items()),
    *(
        Case(f"{base}__{name}", base, "reject", says, change)
        for base in OTHERS
        for name, (says, change) in EVERY.items()
    ),
    Case("seesaw_axis__called_training", "seesaw_axis", "reject", r"parameters|redraw|drawn|id ", _split("id")),
    Case(
        "cage_severity__raised",
        "cage_severity",
        "reject",
        r"parameters|redraw|drawn|id ",
        _split("low_stool@4", ("stool.height",)),
    ),
    Case(
        "tool_composed__one_of_two",
        "tool_composed",
        "reject",
        r"parameters|redraw|drawn|id ",
        _split("long_handle@1", ("hook.length",)),
    ),
    Case(
        "galileo_severity__as_axis",
        "galileo_severity",
        "reject",
        r"parameters|redraw|drawn|id ",
        _split("high_patch", ("ramp.level",)),
    ),
    Case("packing_axis__called_training", "packing_axis", "reject", r"parameters|redraw|drawn|id ", _split("id")),
    Case("single_quick__older_mujoco", "single_quick", "refuse", r"mujoco", _older_mujoco, quick=True),
]
