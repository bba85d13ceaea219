"""Frozen evaluation scenarios: the file, its check against what is drawn, and pools that must equal it."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from helpers import REFERENCE

from scengen import cli, load_task
from scengen.errors import BadConfig, PoolError, UnknownName
from scengen.evaluate import edition as editions
from scengen.evaluate.edition import Edition, Frozen, check_pool, chosen_sets, differences, frozen, wanted_sets
from scengen.pool import Pool
from scengen.samplers.task_files import conf_dir
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rebuilt import portable_sha256, rebuild

KEY = "domino_single/id"
POOL = Pool.open(REFERENCE)
SHIPPED = sorted(path.stem for path in (conf_dir() / "editions").glob("*.yaml"))


@pytest.fixture
def edition(tmp_path):
    """An edition with the reference pool as its only set, in a file."""
    made = replace(Edition.new(tmp_path / "mine.yaml"), seed=0, n=len(POOL)).with_set(KEY, POOL)
    made.save()
    return made


@pytest.mark.parametrize("scene", ["<mujoco", "<!DOCTYPE a><mujoco/>", "<robot/>"])
def test_a_scene_of_a_stranger_that_is_no_scene_is_one_line(scene):
    pool = SimpleNamespace(columns=lambda *names: [(0, "0" * 12, scene)])
    with pytest.raises(BadConfig, match="scene"):
        list(frozen(pool))


def test_a_complete_edition_has_every_task_and_the_eight_conditions_of_the_paper():
    paper = [key for key in wanted_sets() if not key.endswith("/id")]
    assert len(paper) == 8 and "domino_single/diagonal" in paper and KEY in wanted_sets()
    assert chosen_sets("domino_single") == [KEY, "domino_single/diagonal"]
    with pytest.raises(UnknownName, match="did you mean 'domino_single'"):
        chosen_sets(["domino_singel"])


def test_a_file_gives_the_same_edition_with_the_same_hash(edition):
    again = Edition.read(str(edition.path))
    assert again == edition and again.sha256 == edition.sha256
    assert len(again.sets[KEY]) == 6 and again.sets[KEY] == tuple(frozen(POOL))
    assert replace(edition, n=7).sha256 != edition.sha256


def test_an_edition_of_an_unknown_level_is_refused(edition):
    edition.path.write_text(edition.text.replace(f"level: {edition.level}", "level: qick"))
    with pytest.raises(UnknownName, match=r"no level of .*mine.yaml named 'qick' \(did you mean 'quick'\?\)"):
        Edition.read(str(edition.path))


def test_rounding_of_another_machine_does_not_change_the_hash_of_a_scene_and_a_millimetre_does():
    text = '<mujoco><worldbody><body pos="0.1 -3e-18 2" name="b_1"/></worldbody></mujoco>'
    rounded = text.replace("0.1 -3e-18 2", "0.10000000000000002 0 2.0")
    assert portable_sha256(rounded) == portable_sha256(text)
    for other in (text.replace("0.1 ", "0.101 "), text.replace("b_1", "b_2"), text.replace("pos", "quat")):
        assert portable_sha256(other) != portable_sha256(text)


def test_what_is_drawn_or_built_otherwise_is_told(edition):
    assert list(differences(edition, KEY)) == []
    first, second, *others = edition.sets[KEY]
    changed = (replace(first, id="0" * 12), replace(second, scene_sha256="0" * 64), *others)
    told = list(differences(replace(edition, sets={KEY: changed}), KEY))
    assert [line.split(", ")[1].split(":")[0] for line in told] == [f"index {first.index}", f"index {second.index}"]
    assert f"{first.id} is drawn here" in told[0] and "built otherwise" in told[1]


def test_the_hash_is_that_of_the_scene_that_the_family_builds(edition):
    index, scene = edition.sets[KEY][3].index, edition.sets[KEY][3].scene_sha256
    assert portable_sha256(rebuild(load_task("domino_single").draw("id", 0, index).scenario)) == scene


def test_a_pool_with_other_scenarios_is_refused(edition):
    assert check_pool(edition, POOL) == KEY
    shorter = replace(edition, n=5, sets={KEY: edition.sets[KEY][:5]})
    with pytest.raises(PoolError, match="it has 6 scenarios, the edition 5"):
        check_pool(shorter, POOL)
    first, *others = edition.sets[KEY]
    for changed, says in (
        (replace(first, id="0" * 12), f"index {first.index} is {first.id}, the edition has index"),
        (replace(first, scene_sha256="0" * 64), f"the scene of index {first.index}, {first.id}, is another one"),
    ):
        with pytest.raises(PoolError, match=says):
            check_pool(replace(edition, sets={KEY: (changed, *others)}), POOL)
    with pytest.raises(UnknownName, match="no set of edition mine named 'domino_single/id'"):
        check_pool(replace(edition, sets={}), POOL)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("format: 2", "format: 1", "has format 1; this version reads format 2"),
        ("  domino_single: 2\n", "  packing: 2\n", "task_versions must have the tasks of the sets"),
        ("n: 6", "n: 7", "must have 7 scenarios"),
        ("seed: 0", "seed: zero", "seed = 'zero'; it must be a whole number"),
        ("  - 0 ", "  - x", "is not a scenario"),
        ("  - 0 ", "  - 9 ", "rising indices"),
        ("\nsets:", "\nset:", "no key of"),
        ("format", "\tformat", "not YAML"),
    ],
)
def test_a_damaged_file_is_refused_in_one_line(edition, old, new, says):
    edition.path.write_text(edition.text.replace(old, new, 1))
    with pytest.raises((BadConfig, UnknownName), match=says) as raised:
        Edition.read(str(edition.path))
    assert "\n" not in str(raised.value)


def test_the_command_checks_and_writes_what_is_missing(edition, monkeypatch, capsys):
    argv = ["edition", f"edition={edition.path}", "tasks=domino_single"]
    assert cli.run(argv) == 0
    assert "1 of 2 sets" in (told := capsys.readouterr().out) and "missing: domino_single/diagonal" in told
    monkeypatch.setattr("scengen.cli.commands.edition.make_pool", lambda made, key, *_: POOL)
    assert cli.run([*argv, "write=true"]) == 0
    assert list(Edition.read(str(edition.path)).sets) == [KEY, "domino_single/diagonal"], "in the order of the tasks"
    assert cli.run(argv) == 1, "the scenarios of another split are not those of diagonal"
    assert "are others here" in capsys.readouterr().out


@pytest.mark.slow
def test_results_name_their_edition(edition, tmp_path):
    common = ["evaluate", "policy=idle", f"edition={edition.path}", "seeds=1", "rollouts=1", f"to={tmp_path / 'out'}"]
    assert cli.run([*common, f"pool={REFERENCE}"]) == 0
    assert f"edition mine (sha256 {edition.sha256[:12]})" in (tmp_path / "out" / "table.md").read_text()
    assert f'"sha256": "{edition.sha256}"' in (tmp_path / "out" / "table.json").read_text()


def test_evaluate_refuses_pools_and_tasks_that_an_edition_does_not_have(edition, capsys):
    common = ["evaluate", "policy=idle", f"edition={edition.path}"]
    replace(edition, sets={KEY: (replace(edition.sets[KEY][0], id="0" * 12), *edition.sets[KEY][1:])}).save()
    assert cli.run([*common, f"pool={REFERENCE}"]) == 2
    assert "is not set domino_single/id of edition mine" in capsys.readouterr().err
    assert cli.run([*common, "tasks=packing"]) == 2
    assert "no set of edition mine named 'packing/id'" in capsys.readouterr().err


def test_missing_pools_are_made_and_finished_ones_are_not_made_again(edition, monkeypatch, tmp_path):
    monkeypatch.setattr(editions, "FOLDER", tmp_path)
    calls = []

    class Made:
        certified, pool, reasons = 6, POOL, {}

    def generate(task, settings, wanted, progress):
        calls.append((task.name, wanted.split, wanted.seed, wanted.n, wanted.pool, settings.name))
        return Made

    monkeypatch.setattr(editions, "generate", generate)
    assert editions.evaluation_pools(edition, [KEY], 1, lambda *_: None) == [str(POOL.folder)]
    assert calls == [("domino_single", "id", 0, 6, str(tmp_path / "mine" / "domino_single-id"), "quick")]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "domino_single-id").symlink_to(POOL.folder.resolve())
    assert editions.evaluation_pools(edition, [KEY], 1, lambda *_: None) and len(calls) == 1
    Made.certified, Made.reasons = 5, {"robust: it fell": 3}
    (tmp_path / "mine" / "domino_single-id").unlink()
    with pytest.raises(PoolError, match=r"only 5 of 6 scenarios could be certified \(3x robust: it fell\)"):
        editions.evaluation_pools(edition, [KEY], 1, lambda *_: None)


def test_an_edition_names_the_versions_of_its_tasks_and_tells_of_another_one(edition, monkeypatch, capsys):
    assert Edition.read(str(edition.path)).task_versions == {"domino_single": 2}
    assert list(edition.other_versions([KEY])) == []
    monkeypatch.setattr(DominoSingle, "VERSION", 3)
    (line,) = edition.other_versions([KEY, "packing/id"])
    assert line == "edition mine is frozen at version 2 of domino_single; installed: 3"
    assert cli.run(["edition", f"edition={edition.path}", "tasks=domino_single"]) == 0, "the same scenes are drawn"
    assert line in capsys.readouterr().err
    with pytest.raises(BadConfig, match="installed: 3; a task has one version in an edition"):
        edition.with_set("domino_single/diagonal", POOL)
    assert replace(edition, task_versions={}, sets={}).with_set(KEY, POOL).task_versions == {"domino_single": 3}


def test_a_line_of_the_file_is_a_scenario():
    line = f"17 {'0a' * 6} {'f' * 64}"
    assert str(Frozen.parse(line, "here")) == line


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_edition_is_what_this_version_draws(name):
    """The first scenario of every set; `scengen edition` checks all of them."""
    edition = Edition.read(name)
    assert edition.text == edition.path.read_text(), "written by scengen edition"
    short = replace(edition, sets={key: scenarios[:1] for key, scenarios in edition.sets.items()})
    assert [line for key in short.sets for line in differences(short, key)] == []
