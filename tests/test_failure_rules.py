"""Under the strict rules a goal counts that is reached by the means; under the paper's it counts however reached."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import REFERENCE, certified_here, env_class

from scengen import load_task
from scengen.attack.evidence import Hit
from scengen.envs.gym import PoolEnv
from scengen.episode import PAPER, STRICT
from scengen.errors import UnknownName
from scengen.pool import Pool
from scengen.sim.world import World
from scengen.validate.rollout import replay, run
from scengen.work.fingerprint import fingerprint

BASE = Path(__file__).parent / "checker" / "base"
POOLS = sorted(path.parent for path in BASE.glob("*/manifest.json") if re.search(r"_(id|paper)$", path.parent.name))
"""A pool of the training split of every task but one, and of each OOD condition of the paper."""


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


def reached_otherwise(monkeypatch):
    """Let the goal of domino-single hold at once, with a mean that lacks."""
    family = load_task("domino_single").family
    monkeypatch.setattr(family, "success", lambda self, world: True)
    monkeypatch.setattr(family, "HOLD", 0.0)


@pytest.mark.parametrize("rules", [STRICT, PAPER])
def test_gymnasium_ends_an_episode_by_its_rules(monkeypatch, rules):
    reached_otherwise(monkeypatch)
    plain = PoolEnv("domino_single", REFERENCE, rules=rules)
    plain.reset()
    *_, terminated, _, info = plain.step(np.zeros(7))
    assert terminated and info["success"] == (rules == PAPER) and info["lacks"]


@pytest.mark.parametrize("rules", [STRICT, PAPER])
def test_robosuite_ends_an_episode_by_its_rules(monkeypatch, rules):
    reached_otherwise(monkeypatch)
    simulated = env_class("domino_single")(
        pool=REFERENCE, rules=rules, use_camera_obs=False, has_offscreen_renderer=False, control_freq=100
    )
    simulated.reset()
    info = simulated.step(np.zeros(7))[3]
    assert info["lacks"] and info["reason"].startswith("the goal was reached otherwise") == (rules == STRICT)


@pytest.mark.parametrize("make", [PoolEnv, lambda task, pool, rules: env_class(task)(pool=pool, rules=rules)])
def test_unknown_rules_are_refused(make):
    with pytest.raises(UnknownName, match="no rules named 'lax'; known: paper, strict"):
        make("domino_single", pool=REFERENCE, rules="lax")


def test_a_hit_replays_under_the_rules_under_which_it_was_found(tmp_path):
    hit = Hit("0" * 12, "retry", False, "", 1.0, "0" * 16, (), (), {}, np.zeros((3, 7), np.float32), "domino_single")
    replace(hit, rules=PAPER).store(tmp_path)
    assert Hit.load(tmp_path / f"{hit.name}.npz").rules == PAPER
