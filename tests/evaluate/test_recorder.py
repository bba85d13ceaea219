"""Episodes that another program plays have the lines of `scengen evaluate`, and verify."""

import json
import os
import shutil

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.evaluate.lines import read_lines, renewed
from scengen.evaluate.recorder import LEFT, Player, Recorder
from scengen.tasks.domino_single import DominoSingle

WHO = Player("a harness", "mine", "1")


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 0.2 else None)


def env(**changed):
    return PoolEnv("domino_single", str(REFERENCE), action_repeat=4, settle=True, **changed)


def played(recorder, own, number):
    seen, _ = own.reset(options={"scenario": own.scenarios[number]})
    recorder.begin(own, seen)
    rng, over = np.random.default_rng(number), False
    while not over:
        _, _, terminated, truncated, info = own.step(rng.uniform(-1, 1, 7))
        over = terminated or truncated
    recorder.end(own, info)


@pytest.fixture
def results(tmp_path):
    own = env()
    recorder = Recorder(tmp_path / "out", WHO, own)
    for number in (2, 0, 0):
        played(recorder, own, number)
    recorder.close()
    return tmp_path / "out"


def test_lines_are_sorted_numbered_and_verify(results, capsys):
    lines = read_lines(results / "episodes.jsonl")
    assert [line["rollout"] for line in lines] == [0, 1, 0] and {line["policy"] for line in lines} == {"mine"}
    assert all(line["reason"] == "too late" and not line["success"] for line in lines)
    assert cli.run(["verify", f"results={results}", "level=full"]) == 0
    out = capsys.readouterr().out
    assert "3 of 3 lines rebuilt" in out and "that a harness played no other episodes" in out
    assert ", n 3 of 2\n" in (results / "table.md").read_text()


def test_they_are_the_lines_of_an_evaluation_but_for_the_policy(results, tmp_path):
    words = ["evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", "action_repeat=4"]
    assert cli.run([*words, f"to={tmp_path / 'usual'}"]) == 0
    (usual,) = read_lines(tmp_path / "usual" / "episodes.jsonl")
    there = next(line for line in read_lines(results / "episodes.jsonl") if line["scenario"] == usual["scenario"])
    differing = {name for name in usual if usual[name] != there[name]}
    assert usual.keys() == there.keys()
    assert differing <= {"policy", "pool", "actions_sha256", "final_state", "phase", "episode", "sha256"}


def test_an_episode_that_was_left_is_told_and_counts_for_nothing(tmp_path):
    own = env()
    recorder = Recorder(tmp_path / "out", WHO, own)
    seen, _ = own.reset(options={"scenario": own.scenarios[1]})
    recorder.begin(own, seen)
    played(recorder, own, 0)
    seen, _ = own.reset(options={"scenario": own.scenarios[2]})
    recorder.begin(own, seen)
    recorder.close()
    lines = read_lines(tmp_path / "out" / "episodes.jsonl")
    assert sorted(line["crashed"] for line in lines) == ["", LEFT, LEFT]
    assert json.loads((tmp_path / "out" / "table.json").read_text())["table"][0]["id"]["rollouts"] == 1
    assert cli.run(["verify", f"results={tmp_path / 'out'}"]) == 0


def test_a_perturbed_run_without_a_clean_one_has_its_row(tmp_path):
    own = env(perturb="proprioception_noise@2", perturb_seed=3)
    recorder = Recorder(tmp_path / "out", WHO, own)
    played(recorder, own, 0)
    recorder.close()
    assert "| id | proprioception_noise@2 | 0.0 [" in (tmp_path / "out" / "table.md").read_text()
    assert cli.run(["verify", f"results={tmp_path / 'out'}"]) == 0


def test_a_run_continues_and_refuses_another_one(results):
    own = env()
    again = Recorder(results, WHO, own)
    played(again, own, 2)
    again.close()
    assert [line["rollout"] for line in read_lines(results / "episodes.jsonl")] == [0, 1, 0, 1]
    for other in (Player("a harness", "mine", "2"), Player("a harness", "yours", "1")):
        with pytest.raises(BadConfig, match="holds results of other pools or settings"):
            Recorder(results, other, own)
    with pytest.raises(BadConfig, match="action_repeat"):
        Recorder(results, WHO, PoolEnv("domino_single", str(REFERENCE), settle=True))
    second = Recorder(results, WHO, own)
    with pytest.raises(BadConfig, match="another run is writing"):
        Recorder(results, WHO, own)
    second.close()


@pytest.mark.parametrize("forge", ["success", "scenario", "harness"])
def test_forged_lines_of_a_harness_are_found(results, tmp_path, forge):
    shutil.copytree(results, tmp_path / "forged")
    folder = tmp_path / "forged"
    lines, identity = read_lines(folder / "episodes.jsonl"), json.loads((folder / "run.json").read_text())
    if forge == "success":
        lines[0] |= {"success": True, "reason": ""}
    elif forge == "scenario":
        lines[0] |= {"scenario": lines[2]["scenario"]}
    else:
        del identity["harness"]
        (folder / "run.json").write_text(json.dumps(identity))
    text = "".join(json.dumps(line) + "\n" for line in renewed(identity, lines))
    (folder / "episodes.jsonl").write_text(text)
    assert cli.run(["verify", f"results={folder}", "level=full"]) == 1


@pytest.mark.parametrize(
    "who",
    [
        Player("", "mine"),
        Player("h", ""),
        Player("h", "p" * 201),
        Player("h\n", "p"),
        Player("h", "\udc80"),
        Player(5, "p"),
    ],
)
def test_names_that_no_line_could_hold_are_refused(tmp_path, who):
    with pytest.raises(BadConfig, match="give one line of 1 to 200 characters"):
        Recorder(tmp_path / "out", who, env())
    assert not list(tmp_path.iterdir())


def test_a_run_that_goes_on_is_not_replaced(tmp_path):
    own = env()
    recorder = Recorder(tmp_path / "out", WHO, own)
    played(recorder, own, 0)
    with pytest.raises(BadConfig, match="another run is writing"):
        Recorder(tmp_path / "out", WHO, env(), replaces=True)
    recorder.close()
    assert len(read_lines(tmp_path / "out" / "episodes.jsonl")) == 1
    with pytest.raises(BadConfig, match="is closed; make another one"):
        played(recorder, own, 0)
    Recorder(tmp_path / "out", WHO, env(), replaces=True).close()
    assert not (tmp_path / "out" / "episodes.jsonl").read_bytes()


@pytest.mark.parametrize("strange", ["link", "pipe"])
def test_the_settings_of_a_run_are_written_to_its_folder_alone(tmp_path, strange):
    (tmp_path / "out").mkdir()
    path = tmp_path / "out" / "run.json"
    path.symlink_to(tmp_path / "elsewhere") if strange == "link" else os.mkfifo(path)
    Recorder(tmp_path / "out", WHO, env()).close()
    assert path.is_file() and not path.is_symlink() and not (tmp_path / "elsewhere").exists()


def test_a_reason_without_end_is_cut_and_info_without_one_is_refused(tmp_path, capsys):
    own = env()
    recorder = Recorder(tmp_path / "out", WHO, own)
    recorder.begin(own, own.reset(options={"scenario": own.scenarios[0]})[0])
    with pytest.raises(BadConfig, match="info has no reason; give the last one"):
        recorder.end(own, {"success": False})
    recorder.end(own, {"success": False, "reason": "late " * 100_000})
    recorder.close()
    assert len(read_lines(tmp_path / "out" / "episodes.jsonl")[0]["reason"]) < 1010
