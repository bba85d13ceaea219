"""Runs: stand-ins get what they must, nothing is asked twice, budgets stop, and a run is graded again for nothing."""

import hashlib
import json

import helpers
import pytest
from endpoint import serving

from scengen import cli
from scengen.agents import runner
from scengen.agents.replies import FormatError, read_json
from scengen.agents.runner import AgentSettings, run
from scengen.agents.scene import MOUNTED
from scengen.agents.tables import by_question, lost_in_twins
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import cameras_of
from scengen.errors import ScengenError
from scengen.perturb.language import Words
from scengen.pictures.render import encode
from scengen.tasks.domino_single import DominoSingle

REFERENCE = str(helpers.REFERENCE)


def settings(folder, model, **changes):
    given = {"pool": REFERENCE, "seeds": 3, "pictures": False, "stage": 2, "to": str(folder), **changes}
    return AgentSettings(model=model, **given)


def played(folder, model, **changes):
    return run(settings(folder, model, **changes), lambda *_: None)


def calls(folder):
    return [json.loads(line) for line in (folder / "calls.jsonl").read_text().splitlines()[1:]]


@pytest.mark.parametrize(
    ("model", "right", "forms"), [("facts", True, 0), ("wrong", False, 0), ("garbage", False, 6), ("silent", False, 6)]
)
def test_stand_ins_get_what_they_must(tmp_path, model, right, forms):
    found = played(tmp_path, model)
    outcomes = [outcome for plain in found.results for outcome in runner_outcomes(plain)]
    assert set(outcomes) == {right} and len(found.results) == 6 and not found.stopped
    assert sum(bool(plain["format_error"]) for plain in found.results) == forms
    grades = {grade for line in by_question(found.results, found.priors) for grade in line.counts}
    assert grades <= {"facts": {"right"}, "wrong": {"wrong", "forbidden"}}.get(model, {"format"})


def test_results_name_the_version_of_their_task(tmp_path, monkeypatch):
    monkeypatch.setattr(DominoSingle, "VERSION", 2)
    argv = ["agent", "model=silent", f"pool={REFERENCE}", "seeds=1", "pictures=false", f"to={tmp_path}"]
    assert cli.run(argv) == 0
    (line,) = (tmp_path / "results-1.jsonl").read_text().splitlines()
    assert json.loads(line)["task_version"] == 2
    assert json.loads((tmp_path / "table-1.json").read_text())["task_versions"] == {"domino_single": 2}


def runner_outcomes(plain):
    grades = plain["grades"]
    return [grade == "right" for grade in grades.values()] if plain["stage"] == 1 else [grades["right"]]


def test_a_blind_model_admits_what_is_hidden_and_learns_from_training_alone(tmp_path):
    found = played(tmp_path, "blind", stage=1)
    counts = {line.question: line.counts for line in by_question(found.results, found.priors)}
    assert counts["mass"] == {"right": 3} and counts["simplest_plan"] == {"right": 3}
    assert counts["dominoes"].get("right", 0) < 3, "the number of dominoes differs between the three"


def test_nothing_is_asked_twice_wherever_a_run_is_killed(tmp_path):
    class Killed(Exception):
        pass

    class Dying:
        """A model that answers one call and then ends the process; the next run makes a new one."""

        asked: list[int] = []  # noqa: RUF012

        def __init__(self):
            self.left = 1

        def reply(self, turns, tools, schema, temperature, seed):
            if not self.left:
                raise Killed
            self.left -= 1
            assert seed not in self.asked, "the seed follows from all that is asked"
            self.asked.append(seed)
            return runner.STAND_INS["silent"](None).reply(turns, tools, schema, temperature, seed)

    runs = 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "made", lambda name: Dying())
        while True:
            try:
                found = played(tmp_path, "my:model", seeds=2, stage=1)
                break
            except Killed:
                runs += 1
    assert runs == 6 - 1 and found.calls == 1 and len(calls(tmp_path)) == 6, "two scenarios, three attempts each"


def test_a_budget_stops_before_the_first_call_beyond_it_and_a_larger_one_continues(tmp_path):
    first = played(tmp_path, "facts", budget=runner.Budget(calls=4))
    assert first.calls == 4 and "budget.calls = 4 is used up" in first.stopped
    again = played(tmp_path, "facts")
    assert again.calls == 9 - 4 and not again.stopped


def test_a_run_through_an_endpoint_counts_tokens_and_is_graded_again_for_nothing(tmp_path, capsys):
    def answer(body):
        known = json.loads(json.dumps(body))["response_format"]["json_schema"]["schema"]
        ids = known["properties"]["unknown"]["items"]["properties"]["fact"]["enum"]
        told = {"episodic": [], "semantic": [], "unknown": [{"fact": id_, "sense": "touch"} for id_ in ids]}
        return f"```json\n{json.dumps(told)}\n```"

    with serving([answer]) as (url, requests):
        found = played(tmp_path, "m", url=url, stage=1)
        assert len(requests) == 3 and found.tokens == 3 * 110
    assert {line.question: line.counts for line in by_question(found.results, found.priors)}["mass"] == {"right": 3}
    capsys.readouterr()
    assert cli.run(["agent", "report", f"to={tmp_path}"]) == 0
    assert "0 new calls" in capsys.readouterr().out
    assert "touch" in (tmp_path / "report.html").read_text()
    again = played(tmp_path / "again", f"transcript:{tmp_path / 'calls.jsonl'}", stage=1)
    assert [plain["grades"] for plain in again.results] == [plain["grades"] for plain in found.results]


def test_a_prompt_with_faults_is_another_call_and_tells_them(tmp_path):
    played(tmp_path, "garbage", seeds=1, stage=1)
    first, second, _ = calls(tmp_path)
    assert "was refused" not in first["turns"][1]["text"] and "was refused" in second["turns"][1]["text"]


@pytest.mark.skipif(not helpers.pictures_are_possible(), reason="no OpenGL")
@pytest.mark.slow
def test_pictures_of_all_cameras_and_moments_are_sent_and_kept(tmp_path):
    played(tmp_path, "facts", seeds=1, stage=1, pictures=True, moments=2, width=64)
    (call,) = calls(tmp_path)
    names = call["turns"][1]["pictures"]
    assert len(names) == 6 and "rgb_exo_right_cam at 0.5 s" in call["turns"][1]["text"]
    assert all((tmp_path / "pictures" / f"{name}.jpg").read_bytes()[:2] == b"\xff\xd8" for name in names)


@pytest.mark.skipif(not helpers.pictures_are_possible(), reason="no OpenGL")
def test_a_perturbed_model_gets_the_pictures_and_the_instruction_of_the_environment(tmp_path, capsys):
    perturb, size = "light_colour@5+patch@3+foreign@2", {"width": 48, "moments": 1, "pictures": True}
    (result,) = played(tmp_path, "facts", seeds=1, stage=1, perturb=perturb, perturb_seed=4, **size).results
    (call,) = calls(tmp_path)
    cameras = [name for name in cameras_of("panda_jaw") if name in MOUNTED]
    env = PoolEnv("domino_single", REFERENCE, cameras, width=48, height=48, perturb=perturb, perturb_seed=4)
    observation, _ = env.reset(options={"scenario": result["scenario"]})
    seen = {hashlib.sha256(encode(observation[name], "jpeg")).hexdigest()[:16] for name in cameras}
    assert {*call["turns"][1]["pictures"]} == seen and env.instruction in call["turns"][1]["text"]
    assert "light_colour" not in call["turns"][1]["text"]
    assert call["about"]["perturb"] == result["about"]["perturb"] == env.drawn.plain()
    assert result["perturbation"] == perturb and result["about"]["perturb_seed"] == 4
    env.close()
    assert cli.run(["agent", "report", f"to={tmp_path}"]) == 0, "graded again under the same perturbation"
    told = "facts under light_colour@5+patch@3+foreign@2"
    assert told in capsys.readouterr().out and told in (tmp_path / "report.html").read_text()
    assert json.loads((tmp_path / "table-1.json").read_text())["perturbation"] == perturb
    played(tmp_path, "facts", seeds=1, stage=1, **size)
    assert len(calls(tmp_path)) == 2, "the clean scene is another call"


def test_a_task_without_other_wordings_is_refused_before_anything_is_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(Words, "of", lambda task, instruction, search: Words(task, instruction))
    with pytest.raises(ScengenError, match="domino_single has no other wordings"):
        runner.works(settings(tmp_path, "facts", perturb="vague@1"))


def test_a_dry_run_writes_prompts_and_asks_nothing(tmp_path, capsys):
    said = [f"pool={REFERENCE}", "seeds=2", "pictures=false", "model=facts", f"to={tmp_path}", "dry=true"]
    assert cli.run(["agent", *said]) == 0
    assert "2 prompts" in capsys.readouterr().out and not (tmp_path / "calls.jsonl").exists()
    assert len(list((tmp_path / "prompts").glob("*.txt"))) == 2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"model": "gpt"}, "needs url=http"),
        ({"stage": 4}, "stage = 4"),
        ({"temperatures": [3.0]}, "temperatures"),
        ({"mode": "look"}, "did you mean|known: poses"),
        ({"seeds": 0}, "seeds = 0"),
        ({"perturb": "noise"}, "give noise a level from 1 to 5"),
        ({"perturb": "noise@1"}, "affects all cameras, and none is observed"),
        ({"perturb": "object_noise@1", "mode": "poses", "stage": 3}, "affects streams of object-state"),
        ({"perturb": "payload@1"}, "only stage=3 acts"),
        ({"perturb": "terse@1", "perturb_seed": -1}, "perturb_seed = -1"),
    ],
)
def test_bad_input_is_one_line(tmp_path, changes, says):
    with pytest.raises(ScengenError, match=says):
        played(tmp_path, **{"model": "facts", **changes})


def test_answers_of_another_model_are_not_mixed(tmp_path):
    played(tmp_path, "facts", stage=1)
    with pytest.raises(runner.BadConfig, match="another to="):
        played(tmp_path, "wrong", stage=1)


def test_twins_count_what_training_knows_and_the_axis_loses():
    def result(split, index, grade):
        about = {"temperature": 0.0}
        return {
            "task": "t",
            "seed": 0,
            "index": index,
            "split": split,
            "stage": 1,
            "about": about,
            "grades": {"q": grade},
        }

    results = [result("id", 0, "right"), result("id", 1, "right"), result("id", 2, "wrong")]
    results += [result("far", 0, "wrong"), result("far", 1, "right"), result("far", 2, "wrong")]
    assert lost_in_twins(results, 1) == (1, 2)


def test_a_fence_around_json_is_allowed_and_nothing_else_is():
    assert read_json('```json\n{"a": 1}\n```') == read_json(' {"a": 1} ')
    for text in ("", "  ", "Sure! {}", "{} {}", "[" * 100_000):
        with pytest.raises(FormatError):
            read_json(text)
