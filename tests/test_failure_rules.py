"""Strict rules end episodes of certificates; under the paper's rules they do not count, and the others do."""

import ast
import inspect
import re
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE, certified_here, env_class

from scengen import list_tasks, load_task
from scengen.attack.evidence import Hit
from scengen.envs.gym import PoolEnv
from scengen.episode import PAPER, STRICT, Episode
from scengen.errors import UnknownName
from scengen.pool import Pool
from scengen.scenario import Scenario, Strict
from scengen.sim.world import World
from scengen.validate.rollout import replay, run
from scengen.work.fingerprint import fingerprint

BASE = Path(__file__).parent / "checker" / "base"
POOLS = sorted(path.parent for path in BASE.glob("*/manifest.json") if re.search(r"_(id|paper)$", path.parent.name))
"""A pool of the training split of every task but one, and of each OOD condition of the paper."""


@dataclass(frozen=True)
class Judge:
    """A scenario that fails for one reason."""

    reason: str | None

    def failure(self, world):
        return self.reason

    def success(self, world):
        return False

    def means(self):
        return {}

    events = Scenario.events


@pytest.mark.parametrize(
    ("reason", "rules", "outcome"),
    [
        ("lost", STRICT, "failure"),
        ("lost", PAPER, "failure"),
        (Strict("held"), STRICT, "failure"),
        (Strict("held"), PAPER, None),
        (None, PAPER, None),
    ],
)
def test_strict_rules_do_not_count_under_the_papers(reason, rules, outcome):
    world = World.load(Pool.open(REFERENCE).at(0).scene_xml)
    episode = Episode(Judge(reason), world, rules=rules)
    assert episode.step(world.idle.astype(np.float32)) == outcome
    assert episode.reason == ((reason or "") if outcome else "")


@pytest.mark.parametrize("pool", POOLS, ids=lambda pool: pool.name)
def test_a_witness_succeeds_under_both_rules(pool):
    """Under the strict rules it is certified; under the paper's it succeeds at the same time, in the same state."""
    certified_here(pool)
    row = Pool.open(pool).at(0)
    scenario = load_task(row.task).scenario(row.params)
    world = World.load(row.scene_xml, row.embodiment)
    paper = replay(scenario, world, row.witness, row.horizon, rules=PAPER)
    certified = {check.name: check for check in row.certificate.checks}["solved"].numbers
    assert paper.solved and paper.seconds == pytest.approx(certified["seconds"], abs=0.02)
    assert paper.digest == row.certificate.final_state or row.certificate.fingerprint != fingerprint()


def judged(family):
    """Whether each reason that `failure` returns is strict, in the order of the source."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(family.failure)))
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value and node.lineno > 1:
            strict = any(
                isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Strict" and node in ast.walk(call)
                for call in ast.walk(tree)
            )
            found.append((node.lineno, strict))
    return [strict for _, strict in sorted(found)]


@pytest.mark.parametrize("task", list_tasks())
def test_strict_rules_are_judged_last(task):
    """Otherwise one of them could hide a failure that counts under both rules."""
    kinds = judged(load_task(task).family)
    assert kinds == sorted(kinds)


def push(world):
    """Push the slab by hand."""
    from scengen.geometry import UP
    from scengen.skills.motion import CLOSED, go_to

    at = world.com("slab")
    yield from go_to(world.arm, at + 0.2 * UP, grip=CLOSED)
    yield from go_to(world.arm, at, grip=CLOSED)


def test_a_rule_of_the_paper_counts_under_both():
    row = Pool.open(REFERENCE).at(0)
    scenario, world = load_task(row.task).scenario(row.params), World.load(row.scene_xml)
    for rules in (STRICT, PAPER):
        assert run(scenario, world, push, row.horizon, rules=rules).reason == "the robot touched the slab"


# --- where rules are chosen ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("rules", [STRICT, PAPER])
def test_gymnasium_ends_an_episode_by_its_rules(monkeypatch, rules):
    task = load_task("domino_single")
    monkeypatch.setattr(task.family, "failure", lambda self, world: Strict("held") if world.time > 0.015 else None)
    plain = PoolEnv("domino_single", REFERENCE, rules=rules)
    plain.reset()
    over = [plain.step(np.zeros(7))[2] for _ in range(3)]
    assert over[1] == (rules == STRICT)


@pytest.mark.parametrize("rules", [STRICT, PAPER])
def test_robosuite_ends_an_episode_by_its_rules(monkeypatch, rules):
    task = load_task("domino_single")
    monkeypatch.setattr(task.family, "failure", lambda self, world: Strict("held") if world.time > 0.015 else None)
    simulated = env_class("domino_single")(
        pool=REFERENCE, rules=rules, use_camera_obs=False, has_offscreen_renderer=False, control_freq=100
    )
    simulated.reset()
    reasons = [simulated.step(np.zeros(7))[3]["reason"] for _ in range(3)]
    assert (reasons[1] == "held") == (rules == STRICT)


@pytest.mark.parametrize("make", [PoolEnv, lambda task, pool, rules: env_class(task)(pool=pool, rules=rules)])
def test_unknown_rules_are_refused(make):
    with pytest.raises(UnknownName, match="no rules named 'lax'; known: paper, strict"):
        make("domino_single", pool=REFERENCE, rules="lax")


def test_a_hit_replays_under_the_rules_under_which_it_was_found(tmp_path):
    hit = Hit("0" * 12, "retry", False, "", 1.0, "0" * 16, (), (), {}, np.zeros((3, 7), np.float32), "domino_single")
    replace(hit, rules=PAPER).store(tmp_path)
    assert Hit.load(tmp_path / f"{hit.name}.npz").rules == PAPER
