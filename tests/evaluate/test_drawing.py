"""Pictures take most of the time of an evaluation: only those are drawn that a policy uses."""

import json
import sys
from collections import deque
from itertools import chain
from pathlib import Path
from types import SimpleNamespace

import helpers
import numpy as np
import pytest
from helpers import pictures_are_possible

from scengen import cli
from scengen.envs.vector import PoolVectorEnv
from scengen.evaluate.remote.policy import RemotePolicy
from scengen.evaluate.rollouts import evaluate
from scengen.evaluate.settings import EvaluateSettings

pytestmark = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
POOL, CAMERA = str(helpers.REFERENCE), "rgb_exo_right_cam"
SMALL = {"width": 24, "height": 24, "action_repeat": 100, "look": "plain", "observations": [CAMERA]}
CHUNK = 4
POLICIES = '''
"""Moves by what its pictures show, in chunks of {chunk} actions."""

import numpy as np


class Often:
    """It uses one picture of each chunk, and does not say so."""

    def __init__(self, env):
        self.left = 0

    def reset(self, observation, info, seed):
        self.left = 0

    def act(self, observation):
        if not self.left:
            self.left, self.way = {chunk}, float(observation["{camera}"].mean()) / 255 - 0.5
        self.left -= 1
        return [self.way] * 7


class Seldom(Often):
    """It says when it uses pictures, and gets no others."""

    def act(self, observation):
        assert ("{camera}" in observation) == (not self.left)
        return super().act(observation)

    def looks(self):
        return not self.left


class Broken(Often):
    def looks(self):
        raise ValueError("no idea")
'''
CHANGED = ("policy", "sha256", "episode")


@pytest.fixture
def lines(tmp_path, monkeypatch):
    """A function that plays a policy and returns its lines, and the pictures that were drawn."""
    (tmp_path / "eyes.py").write_text(POLICIES.format(chunk=CHUNK, camera=CAMERA))
    monkeypatch.chdir(tmp_path)
    yield lambda name, to="", **changes: played(f"eyes:{name}", tmp_path / f"{name}{to}", **changes)
    sys.modules.pop("eyes", None)


def played(policy, to, **changes):
    given = {"pool": POOL, "seeds": 2, "rollouts": 1, "arms": "none", "to": str(to), **SMALL, **changes}
    found = evaluate(EvaluateSettings(policy=policy, **given), lambda *_: None)
    return [{k: v for k, v in line.items() if k not in CHANGED} for line in found.episodes], found.spent


def test_the_plan_and_the_progress_name_every_condition(lines, tmp_path):
    """Before the first episode, with the arm that pictures bring along; and one total for all of them."""
    given = {"pool": POOL, "seeds": 1, "rollouts": 1, "to": str(tmp_path / "told"), **SMALL, "look": "room"}
    told, shown = list[str](), list[tuple[int, int, str]]()
    settings = EvaluateSettings(policy="eyes:Often", perturb="noise@1", **given)
    evaluate(settings, lambda *now: shown.append(now) if told else None, announce=told.append)
    (plan,) = told
    assert plan.startswith(
        "episodes: 1 clean, 1 noise@1, 1 arm blind (scenarios: 1, rollouts of each: 1); arms=none leaves out"
    )
    assert {total for _, total, _ in shown} == {3} and shown[-1] == (3, 3, "arm blind")
    assert {name for *_, name in shown} == {"clean", "noise@1", "arm blind"}
    evaluate(EvaluateSettings(policy="eyes:Often", arms="none", **given), lambda *_: None, announce=told.append)
    assert told[1].startswith(
        "episodes: 1 clean (scenarios: 1, rollouts of each: 1); 1 from an earlier run; pictures are slow"
    )


@pytest.mark.parametrize("slots", [1, 2])
def test_a_policy_that_says_when_it_looks_plays_the_same_with_fewer_pictures(lines, slots):
    often, every = lines("Often", slots=slots)
    seldom, used = lines("Seldom", slots=slots)
    assert often == seldom and all(line["pictures"] for line in seldom)
    acts = [-(-line["actions"] // SMALL["action_repeat"]) for line in seldom]
    assert every.pictures == sum(1 + count for count in acts), "one at the start and one after each action"
    assert used.pictures == sum(1 + count // CHUNK for count in acts)
    assert 0 < used.drawing < used.seconds and used.drawing < every.drawing


def test_workers_report_their_drawing(lines):
    alone, used = lines("Seldom")
    together, sum_of_both = lines("Seldom", workers=2, to="elsewhere")
    assert alone == together and used.pictures == sum_of_both.pictures


def test_blind_rollouts_draw_the_first_picture_alone(lines):
    seen, every = lines("Often", seeds=1)
    both, more = lines("Often", seeds=1, arms="blind", to="blind")
    blind = [line for line in both if line["arm"] == "blind"]
    assert len(blind) == 1 and more.pictures == every.pictures + 1
    assert [line for line in both if line["arm"] == "clean"] == seen
    assert blind[0]["renderer"] == seen[0]["renderer"] != "" and blind[0]["pictures"] != seen[0]["pictures"]


def test_late_pictures_are_drawn_whether_they_are_used_or_not(lines):
    often, _ = lines("Often", perturb="late@3", seeds=1)
    seldom, _ = lines("Seldom", perturb="late@3", seeds=1)
    assert often == seldom and any(line["perturbation"] != "none" for line in seldom)


def test_a_policy_that_cannot_say_whether_it_looks_is_named(lines, capsys):
    given = [f"observations=[{CAMERA}]", "width=24", "height=24", "seeds=1", "rollouts=1", "arms=none"]
    assert cli.run(["evaluate", "policy=eyes:Broken", f"pool={POOL}", *given]) == 2
    assert "its looks" in capsys.readouterr().err


def test_the_command_says_how_much_of_the_time_was_drawing(lines, capsys):
    given = [
        f"observations=[{CAMERA}]",
        "width=24",
        "height=24",
        "action_repeat=100",
        "look=plain",
        "seeds=1",
        "rollouts=1",
    ]
    argv = ["evaluate", "policy=eyes:Seldom", f"pool={POOL}", "to=out", "arms=none", *given]
    assert cli.run(argv) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "drawing took " in said and " pictures in " in said
    assert cli.run(argv) == 0
    assert "drawing took" not in capsys.readouterr().out, "nothing was played"
    table = json.loads(Path("out/table.json").read_text())
    assert "spent" not in json.dumps(table) and "drawing" not in json.dumps(table)


@pytest.mark.parametrize("past", [{}, {"video.front": (-1, 0)}, {"video.front": (-7, 0), "state.pose": (-3, 0)}])
@pytest.mark.parametrize("execute", [1, 3, 4])
def test_a_server_looks_at_the_observations_of_its_requests_alone(past, execute):
    policy = object.__new__(RemotePolicy)
    policy._plan, policy._past, policy.client = deque(), past, SimpleNamespace(execute=execute)
    said = []
    for _ in range(40):
        if not policy._plan:
            policy._plan.extend([np.zeros(7)] * execute)
        policy._plan.popleft()
        said.append(policy.looks())
    offsets = {0, *chain(*past.values())}
    requests = range(0, 100, execute)
    used = {request + offset for request in requests for offset in offsets}
    assert said == [number in used for number in range(1, 41)]


def test_a_vector_environment_draws_the_chosen_slots():
    envs = PoolVectorEnv("domino_single", POOL, 2, observations=[CAMERA], width=24, height=24)
    envs.reset(seed=0)
    seen, *_ = envs.step(np.zeros((2, 7)), draw=[False, True])
    assert not seen[CAMERA][0].any() and seen[CAMERA][1].any()
    assert [env.drawing.pictures for env in envs.envs] == [1, 2]
    seen, *_ = envs.step(np.zeros((2, 7)))
    assert seen[CAMERA][0].any()
    envs.close()
