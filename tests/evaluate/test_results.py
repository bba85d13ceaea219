"""Results that prove what was run: a forged line is found, or what cannot be known of it is said."""

import contextlib
import json
import os
import random
import shutil
from dataclasses import replace

import helpers
import pytest

from scengen import cli
from scengen.errors import BadConfig, PoolError, ScengenError
from scengen.evaluate.audit import _Audit, audit
from scengen.evaluate.audit_report import Options
from scengen.evaluate.comparison import TABLE, Comparison
from scengen.evaluate.lines import COLUMNS, RUN, EpisodeLine, picture_digest, read_lines, renewed, schema
from scengen.evaluate.rollouts import order
from scengen.evaluate.stored import stored_results
from scengen.look.looks import LOOKS
from scengen.pool.demonstrations import DEMONSTRATIONS
from scengen.tasks.domino_single import DominoSingle

REFERENCE = str(helpers.REFERENCE)
EVERY = Options(sample=None)
ONE = Options(sample=1)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Twelve short episodes of random actions, clean and perturbed, with their actions and without."""
    patch = pytest.MonkeyPatch()
    patch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 0.3 else None)
    folder = tmp_path_factory.mktemp("results")
    words = ("evaluate", "policy=random", f"pool={REFERENCE}", "seeds=3", "rollouts=2", "action_repeat=10")
    for name, more in (("kept", ["keep=[episodes]"]), ("bare", [])):
        assert cli.run([*words, *more, "perturb=proprioception_noise@2", f"to={folder / name}"]) == 0
    yield folder
    patch.undo()


def lines_of(folder):
    return read_lines(folder / "episodes.jsonl")


def write_lines(folder, lines):
    (folder / "episodes.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))


def cover_up(folder, lines):
    """Write lines with right numbers and hashes, and the tables that they give, as a careful forger does."""
    write_lines(folder, renewed(json.loads((folder / RUN).read_text()), lines))
    one = _Audit(folder, stored_results(folder)[1][0], ONE)
    for path, text in Comparison([one.result]).files(folder).items():
        path.write_text(text)


def forged(results, tmp_path, name, lines, careful):
    folder = tmp_path / "forged"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(results / name, folder)
    (cover_up if careful else write_lines)(folder, lines)
    return folder


def verdict(folder, options=EVERY):
    (report,) = audit(folder, options, lambda *_: None)
    return report


def changed(name, value):
    def forge(lines, number, rng):
        lines[number] = {**lines[number], name: value(lines[number][name])}

    return forge


def outcome(lines, number, rng):
    success = not lines[number]["success"]
    lines[number] |= {"success": success, "reason": "" if success else "the goal was not reached"}


def other_id(lines, number, rng):
    other = rng.choice([line for line in lines if line["scenario"] != lines[number]["scenario"]])
    about = ("scenario", "id_twin", "index", "scene_sha256", "shifted", "perturb", "policy_seed")
    lines[number] |= {name: other[name] for name in about}


def copied_digest(lines, number, rng):
    other = rng.choice([line for line in lines if line["first_state"] != lines[number]["first_state"]])
    lines[number]["first_state"] = other["first_state"]


def swapped(lines, number, rng):
    other = (number + rng.randrange(1, len(lines))) % len(lines)
    lines[number], lines[other] = lines[other], lines[number]


def doubled(lines, number, rng):
    lines.insert(rng.randrange(len(lines)), dict(lines[number]))


def dropped(lines, number, rng):
    del lines[number]


FORGERIES = {
    "outcome": outcome,
    "id": other_id,
    "unknown id": changed("scenario", lambda id_: f"{int(id_, 16) ^ 1:012x}"),
    "digest": copied_digest,
    "digest of the scene": changed("scene_sha256", lambda text: text[::-1]),
    "drawn value": changed("perturb", lambda drawn: {"proprioception_noise": {"sigma": 0.5}}),
    "perturbation": changed("perturbation", lambda name: "proprioception_noise@1"),
    "arm": changed("arm", lambda arm: "wrong"),
    "policy seed": changed("policy_seed", lambda seed: seed + 1),
    "instruction": changed("instruction", lambda text: text.replace("red", "blue")),
    "split": changed("split", lambda split: "diagonal"),
    "version": changed("task_version", lambda version: version + 1),
    "pool": changed("pool", lambda folder: f"{folder}/other"),
    "seconds": changed("seconds", lambda seconds: seconds + 0.5),
    "type": changed("index", str),
    "crash": changed("crashed", lambda text: "RuntimeError: no GPU"),
    "actions": changed("actions_sha256", lambda text: text[::-1]),
    "order": swapped,
    "doubled": doubled,
    "dropped": dropped,
}
REBUILT = {"outcome", "digest", "instruction", "seconds", "actions"}
"""Forgeries of a careful forger that show only when the line is rebuilt."""
CLAIMED = {"outcome", "seconds", "actions"}
"""Forgeries that nobody can find without the actions."""


def test_results_are_sound_and_say_what_is_claimed(results):
    kept, bare = (verdict(results / name) for name in ("kept", "bare"))
    assert not kept.faults and not kept.declined
    assert (kept.verdict, kept.lines, kept.rebuilt, kept.replayed) == ("sound", 12, 12, 12)
    assert (bare.verdict, bare.rebuilt, bare.replayed) == ("sound", 12, 0)
    assert any(text.startswith("outcomes of 12 lines") for text in bare.claimed)
    assert not any(text.startswith("outcomes") for text in kept.claimed)


def test_pictures_of_another_version_of_the_look_are_declined(results, monkeypatch):
    monkeypatch.setattr("scengen.evaluate.audit.look_named", lambda name: replace(LOOKS[name], version=2))
    assert verdict(results / "bare").declined == ["pictures were taken in look room 1, this is room 2"]


@pytest.mark.parametrize("kind", FORGERIES)
def test_a_forged_line_is_found(results, tmp_path, kind):
    """By someone who edits the file, and by someone who makes its hashes and the tables fit."""
    rng = random.Random(kind)
    for careful in (False, True):
        if careful and kind in ("type", "pool"):
            continue  # no table can be made of such lines
        lines = lines_of(results / "kept")
        FORGERIES[kind](lines, rng.randrange(len(lines)), rng)
        every = careful and kind in REBUILT
        report = verdict(forged(results, tmp_path, "kept", lines, careful), EVERY if every else ONE)
        assert report.verdict == "refuted" and report.faults, (kind, careful)


@pytest.mark.parametrize("kind", [*sorted(CLAIMED), "crash"])
def test_what_nobody_can_find_is_declared(results, tmp_path, kind):
    rng, lines = random.Random(kind), lines_of(results / "bare")
    FORGERIES[kind](lines, rng.randrange(len(lines)), rng)
    report = verdict(forged(results, tmp_path, "bare", lines, True), ONE)
    told = "that the policy crashed in 1 episodes" if kind == "crash" else "outcomes of 12 lines"
    assert report.verdict == "sound" and any(text.startswith(told) for text in report.claimed)


@pytest.mark.parametrize("name", [TABLE, "table.md", "episodes.csv", RUN])
def test_another_figure_in_a_file_is_found(results, tmp_path, name):
    folder = forged(results, tmp_path, "bare", lines_of(results / "bare"), False)
    text = (folder / name).read_text()
    (folder / name).write_text(text.replace('"low": 0.0', '"low": 0.1') if name == TABLE else text.replace("0", "7", 1))
    assert verdict(folder, ONE).verdict == "refuted"


def edit(results_folder, name, **entries):
    """Change entries of a file, and let hashes and tables follow."""
    path = results_folder / name
    path.write_text(json.dumps({**json.loads(path.read_text()), **entries}))


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ({"width": 64}, "says width = 64, run.json has 256"),
        ({"action_repeat": 1}, "says action_repeat = 1, run.json has 10"),
        ({"observations": ["force_torque"]}, "says observations"),
        ({"settle": False}, "says settle = False"),
        ({"keep": ["episodes"]}, "says keep"),
        ({"arms": ["blind"]}, "has the arms [], its settings give ['blind']"),
        ({"edition": "v1"}, "names edition v1: "),
        ({"tasks": "packing"}, "and no edition"),
        ({"rollouts": 10**6}, "says rollouts = 1000000, and there are 12 lines"),
        ({"seeds": 4}, "has no line: the table says seeds = 4, the lines have 3"),
    ],
)
def test_settings_of_the_table_that_contradict_the_run_are_found(results, tmp_path, entries, says):
    folder = forged(results, tmp_path, "bare", lines_of(results / "bare"), False)
    told = json.loads((folder / TABLE).read_text())["settings"]
    edit(folder, TABLE, settings={**told, **entries})
    assert any(says in fault for fault in verdict(folder, ONE).faults)


def test_a_table_about_other_episodes_than_those_beside_it_is_refused(results, tmp_path):
    """Else false lines would be sound because honest ones are somewhere else."""
    folder = forged(results, tmp_path, "bare", lines_of(results / "bare"), False)
    for elsewhere in (str(results / "bare"), "../other", "there/../..", "nowhere"):
        edit(folder, TABLE, folder=elsewhere)
        with pytest.raises(BadConfig, match="next to it, and it is missing"):
            verdict(folder, ONE)


STRANGE = (
    None,
    5,
    -1.5,
    True,
    "x",
    [],
    [[]],
    [{}],
    [None],
    {"x": 5},
    {"x": None},
    {"domino_single": {}},
    {REFERENCE: 1},
)


@pytest.mark.parametrize("name", [RUN, TABLE])
def test_entries_of_any_type_are_refused_in_order(results, tmp_path, name):
    folder = forged(results, tmp_path, "bare", lines_of(results / "bare"), False)
    honest = json.loads((folder / name).read_text())
    for key in (
        honest if name == RUN else ("folder", "settings", "episodes_sha256", "lost", "arms", "benign", "policies")
    ):
        for value in STRANGE:
            if value != honest.get(key):
                (folder / name).write_text(json.dumps({**honest, key: value}))
                with contextlib.suppress(ScengenError):
                    assert verdict(folder, ONE).verdict != "sound" or value == [], (key, value)
        (folder / name).write_text(json.dumps({k: v for k, v in honest.items() if k != key}))
        with contextlib.suppress(ScengenError):
            assert verdict(folder, ONE).verdict != "sound" or honest.get(key) in (None, []), key


@pytest.mark.parametrize("content", [b"\xff\xfe", b"\xe9", None])
def test_tables_for_people_in_another_encoding_are_not_those_of_the_lines(results, tmp_path, content):
    folder = forged(results, tmp_path, "bare", lines_of(results / "bare"), False)
    (folder / "table.md").unlink()
    os.mkfifo(folder / "table.md") if content is None else (folder / "table.md").write_bytes(content)
    assert verdict(folder, ONE).faults == [f"{folder / 'table.md'} is not the one that its lines give"]


def test_kept_actions_say_what_the_policy_perceived(results, tmp_path, capsys):
    folder = forged(results, tmp_path, "kept", lines_of(results / "kept"), False)
    changed = folder / "rollouts-proprioception_noise@2" / helpers.REFERENCE.name
    assert cli.run(["verify", f"pool={changed}"]) == 0
    assert "'random' drove the robot under 'proprioception_noise@2', seed 0" in capsys.readouterr().out
    told = json.loads((changed / DEMONSTRATIONS).read_text())
    assert "condition" not in json.loads((folder / "rollouts" / helpers.REFERENCE.name / DEMONSTRATIONS).read_text())
    for entries, says in (
        ({"condition": "proprioception_noise@1"}, "says condition = 'proprioception_noise@1'"),
        ({"perturb_seed": 3}, "says perturb_seed = 3"),
        ({"policy": "ours"}, "says policy = 'ours'"),
    ):
        (changed / DEMONSTRATIONS).write_text(json.dumps({**told, **entries}))
        for options in (EVERY, ONE):
            assert any(says in fault for fault in verdict(folder, options).faults)
    (changed / DEMONSTRATIONS).write_text(json.dumps({k: v for k, v in told.items() if k != "perturb_seed"}))
    with pytest.raises(PoolError, match="a condition"):
        verdict(folder)


def test_lines_have_the_schema(results):
    from jsonschema import Draft202012Validator

    check = Draft202012Validator(schema())
    for line in lines_of(results / "kept"):
        check.validate(line)
        assert tuple(line) == COLUMNS and EpisodeLine.of(line).sha256 == line["sha256"]
    assert not check.is_valid({**line, "success": "true"}) and not check.is_valid({**line, "more": 1})


def test_lines_are_the_same_for_any_workers_and_interruption(results, tmp_path, monkeypatch):
    words = ("evaluate", "policy=random", f"pool={REFERENCE}", "action_repeat=10", f"to={tmp_path}", "rollouts=2")
    assert cli.run([*words, "seeds=2"]) == 0
    assert cli.run([*words, "seeds=3", "slots=4", "perturb=proprioception_noise@2"]) == 0
    assert (tmp_path / "episodes.jsonl").read_bytes() == (results / "bare" / "episodes.jsonl").read_bytes()
    assert cli.run([*words, "seeds=2", "perturb=proprioception_noise@2"]) == 0
    report = verdict(tmp_path, ONE)
    assert report.verdict == "sound" and "4 lines are of a longer run, and not in the table" in report.remarks


def test_the_command_tells_faults_and_other_places(results, tmp_path, capsys):
    lines = lines_of(results / "kept")
    dropped(lines, 4, random)
    folder = forged(results, tmp_path, "kept", lines, False)
    assert cli.run(["verify", f"results={folder}", "seed=1", f"json={tmp_path / 'told.json'}"]) == 1
    told = capsys.readouterr()
    assert "REFUTED line 4 has the number 5" in told.err and "refuted: 11 of 11 lines rebuilt" in told.out
    (plain,) = json.loads((tmp_path / "told.json").read_text())
    assert plain["verdict"] == "refuted" and plain["lines"] == 11
    run = json.loads((folder / RUN).read_text())
    (folder / RUN).write_text(json.dumps({**run, "pools": {"nowhere": "0" * 64}}))
    assert cli.run(["verify", f"results={folder}"]) == 2
    assert (
        "the pool nowhere of these results (sha256 000000000000) is not here; pass pool=FOLDER"
        in capsys.readouterr().err
    )


def test_digests_differ_where_anything_differs(results):
    lines = lines_of(results / "kept")
    assert len({line["first_state"] for line in lines}) == 3 and len({line["final_state"] for line in lines}) > 3
    assert [*map(order, lines)] == sorted(map(order, lines))
    import numpy as np

    black = np.zeros((4, 4, 3), np.uint8)
    grey = black.copy()
    grey[0, 0, 0] = 1
    assert picture_digest(black) != picture_digest(grey) and picture_digest(black[:, ::-1]) == picture_digest(black)
