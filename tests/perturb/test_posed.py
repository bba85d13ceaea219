"""Conditions of control: certified, verified, applied in environments, and each with an effect."""

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.compose import load_task
from scengen.control.impairment import NONE, Impairment
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.pool import Pool
from scengen.samplers.conditions import KINDS, LEVELS, impairment, start
from scengen.scenario import Conditions
from scengen.sim.embodiment import JAW
from scengen.sim.world import World
from scengen.validate.certify import Trial
from scengen.validate.impaired import impaired
from scengen.validate.playable import stored_world
from scengen.validate.rebuilt import rebuild, world_of
from scengen.validate.settings import QUICK

TASK = load_task("domino_single")
PLAIN = TASK.draw("id", 0, 0).scenario


def under(conditions, task=TASK, scenario=PLAIN):
    parts = tuple((kind, int(level)) for kind, _, level in (each.partition("@") for each in conditions.split("+")))
    return scenario.under(Conditions(parts, task.embodiment))


def moved(world, periods=100, action=None):
    """Positions of the hand after an action of each period."""
    sent = world.idle if action is None else action
    for _ in range(periods):
        world.step_filtered(world.received(sent, raw=True))
    return world.arms[0].hand


def impeded(**fields):
    return World.load(impaired(rebuild(PLAIN), Impairment(**fields), JAW))


AHEAD = np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])


def test_a_scene_holds_its_impairment():
    given = Impairment((0.1,) * 7, 4.0, 0.1, 0.2, 7.0, 0.5, 0.25, 0.4)
    world = World.load(impaired(rebuild(PLAIN), given, JAW))
    assert world.loop.impairment == given and world_of(PLAIN).loop.impairment == NONE and not NONE


@pytest.mark.parametrize("kind", KINDS)
def test_each_level_goes_farther_and_scenarios_differ_only_where_they_draw(kind):
    def of(level, scenario):
        posed = Conditions(((kind, level),), JAW)
        return impairment(posed, scenario), start(posed, 1, scenario, 0, 0)

    assert len({of(level, "a") for level in range(1, LEVELS + 1)}) == LEVELS
    drawn = {str(of(3, scenario)) for scenario in "abcdefgh"}
    assert (len(drawn) > 1) == (kind in ("start_pose", "action_noise", "lost_actions", "stiffness"))
    assert of(2, "a") == of(2, "a")


def test_a_delay_is_as_long_as_it_says():
    late, prompt = impeded(delay=8.0), impeded()
    assert np.array_equal(moved(late, 8, AHEAD), moved(impeded(delay=8.0), 8))
    moved(late, 20, AHEAD)
    assert np.linalg.norm(late.arms[0].hand - moved(prompt, 20, AHEAD)) < 2e-3


def test_lost_and_noisy_actions():
    size = [np.linalg.norm(moved(impeded(lost=lost, key=3.0), 50, AHEAD) - moved(impeded(), 0)) for lost in (0, 0.5, 1)]
    assert size[0] > 1.5 * size[1] > 0.01 and size[2] < 1e-4
    one, same, other = (moved(impeded(noise=0.2, key=key), 30, AHEAD) for key in (1.0, 1.0, 2.0))
    assert np.array_equal(one, same) and np.linalg.norm(one - other) > 1e-4


def test_a_soft_controller_lags_and_a_load_sinks():
    soft, usual = moved(impeded(stiffness=0.25), 10, AHEAD), moved(impeded(), 10, AHEAD)
    assert usual[0] - soft[0] > 0.002
    heights = [moved(impeded(payload=kg))[2] - moved(impeded())[2] for kg in (0.1, 0.2, 0.35, 0.5, 0.8)]
    assert all(b < a < -5e-4 for a, b in pairwise(heights))


def test_a_slow_gripper_closes_later():
    def closed(world, periods=12):
        moved(world, periods, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
        return world.loop._arms[0]["state"]["jaw"][0]

    assert closed(impeded()) == -1.0 < closed(impeded(gripper=0.125)) < 0.0
    cup = load_task("packing")
    text, pull = rebuild(cup.draw("id", 0, 0).scenario), []
    for factor in (1.0, 0.125):
        world = World.load(impaired(text, Impairment(gripper=factor), cup.embodiment), cup.embodiment)
        pull += closed(world, 2), closed(world, 6)
    assert pull == [1.0, 1.0, 0.25, 1.0]
    moved(world, 1, AHEAD)
    assert world.loop._arms[0]["state"]["jaw"][0] == 0.0, "it lets go at once"


@pytest.mark.parametrize("name", ["start", "delay", "noise", "lost", "key", "stiffness", "gripper", "payload"])
def test_numbers_of_a_stranger_are_refused(name):
    text = rebuild(PLAIN)
    for value in ("inf", "-5", "1e12", "0.5" if name in ("delay", "key") else "1e9"):
        data = " ".join([value] * (7 if name == "start" else 1))
        numeric = f'<custom><numeric name="impaired_{name}" data="{data}"/></custom></mujoco>'
        with pytest.raises(ValueError, match=f"impaired_{name} = .*it holds|inf"):
            World.load(text.replace("</mujoco>", numeric), JAW)
    with pytest.raises(ValueError, match="offsets 14 joints at the start; its robot has 7"):
        impeded(start=(0.0,) * 13 + (0.1,))


@pytest.mark.parametrize("name", ["domino_single", "cup_inversion", "packing", "slip_recovery"])
def test_another_start_touches_nothing_new_and_keeps_what_is_held(name):
    task = load_task(name)
    scenario = task.draw("id", 0, 0).scenario
    usual, posed = world_of(scenario, task.embodiment), under("start_pose@5", task, scenario)
    world = world_of(posed, task.embodiment)
    off = [arm.joint_pos - other.joint_pos for arm, other in zip(world.arms, usual.arms, strict=True)]
    assert [np.sqrt(np.mean(one**2)) for one in off] == pytest.approx([0.2] * len(off), abs=1e-5)
    if usual.loop.holds:
        moved(world, 20)
        assert any(world.arms[0].grips(body) for body in world.free_bodies)
    assert rebuild(posed) == rebuild(posed)


def test_states_are_restored_with_actions_under_way():
    world = impeded(delay=6.0, noise=0.1, lost=0.2, key=4.0)
    moved(world, 10, AHEAD)
    state = world.state()
    twin, ahead = copy.deepcopy(world), moved(world, 20, -AHEAD)
    assert np.array_equal(moved(pickle.loads(pickle.dumps(twin)), 20, -AHEAD), ahead)
    world.restore(state)
    assert np.array_equal(moved(world, 20, -AHEAD), ahead)
    world.reset()
    assert world.state().tobytes() == impeded(delay=6.0, noise=0.1, lost=0.2, key=4.0).state().tobytes()


# --- certificates -------------------------------------------------------------------------------


def test_a_level_beyond_the_oracle_is_not_certified():
    trial = Trial(under("stiffness@1"), TASK.horizon, QUICK, JAW)
    assert all(trial.check(name).passed for name in ("compiles", "rest", "solved", "witness"))
    beyond = Trial(PLAIN, TASK.horizon, QUICK, JAW)
    assert beyond.check("compiles").passed
    beyond.text = impaired(beyond.text, Impairment(payload=3.0), JAW)
    beyond.world = World.load(beyond.text, JAW)
    assert "the oracle failed" in beyond.check("solved").reason


def test_a_pool_under_conditions_is_certified_verified_and_told_apart(tmp_path, capsys):
    words = ["generate", "task=domino_single", "n=1", "certify.robust.runs=1", "certify.robust.bound=0.04"]
    assert cli.run([*words, "perturb=action_delay@2+start_pose@1", f"pool={tmp_path / 'pool'}"]) == 0
    (row,) = Pool.open(tmp_path / "pool").rows()
    assert row.split == "action_delay@2+start_pose@1" and row.axes == ("action_delay@2", "start_pose@1")
    assert row.id != row.id_twin == PLAIN.id and TASK.scenario(row.params).id == PLAIN.id
    assert World.load(row.scene_xml).loop.impairment.delay == 4.0
    assert cli.run(["verify", f"pool={tmp_path / 'pool'}"]) == 0
    capsys.readouterr()
    for perturb, told in {
        "noise@2": "noise changes what is perceived and no physics",
        "action_delay@9": "give action_delay a level from 1 to 5",
        "action_delai@1": "did you mean 'action_delay'",
    }.items():
        assert cli.run([*words, f"perturb={perturb}", f"pool={tmp_path / 'no'}"]) == 2
        assert told in capsys.readouterr().err
    assert cli.run([*words, "split=payload", f"pool={tmp_path / 'no'}"]) == 2
    assert "give payload a level from 1 to 5, such as payload@3" in capsys.readouterr().err


# --- environments -------------------------------------------------------------------------------


def test_an_environment_poses_the_scene_that_a_pool_would_hold():
    env = PoolEnv("domino_single", pool=REFERENCE, perturb="action_delay@2+start_pose@1")
    env.reset(options={"scenario": PLAIN.id})
    posed = rebuild(under("action_delay@2+start_pose@1"))
    assert env.world.digest == World.load(posed).digest != stored_world(env.row).digest
    told = env.drawn.plain()
    assert told == {"action_delay": {"delay": 4.0}, "start_pose": {"size": 0.03}}
    kept = copy.deepcopy(env)
    for one in (env, kept):
        for _ in range(10):
            one.step(AHEAD)
    assert env.world.digest == kept.world.digest
    env.close()


def test_conditions_upon_conditions_and_films_of_what_happened_are_refused(tmp_path, capsys):
    row = next(iter(Pool.open(REFERENCE).rows()))
    text = impaired(row.scene_xml, Impairment(delay=2.0), JAW)
    with pytest.raises(BadConfig, match="has conditions of control already"):
        posed = Conditions((("payload", 1),), JAW)
        stored_world(type(row)(**{**vars(row), "scene_xml": text}), None, posed)
    for words, told in {
        ("show", "film", f"pool={REFERENCE}", "id=8ed4", f"to={tmp_path / 'f.png'}"): "film a pool of",
        ("agent", f"pool={REFERENCE}", "model=facts", "stage=1", f"to={tmp_path / 'a'}"): "only stage=3 acts",
    }.items():
        assert cli.run([*words, "perturb=payload@1"]) == 2 and told in capsys.readouterr().err
    words = ["record", f"pool={REFERENCE}", f"to={tmp_path / 'r'}", "perturb=payload@1"]
    assert cli.run(words) == 2 and "payload changes what happens: a recording films" in capsys.readouterr().err
