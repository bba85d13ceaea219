"""The vector environment: the bits of single environments, in any number of threads, in the order of the pool."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from helpers import REFERENCE, pictures_are_possible

import scengen.envs.gym
from scengen import load_task
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import proprioception, streams_of
from scengen.envs.vector import PoolVectorEnv
from scengen.errors import BadConfig, UnknownName, Unstable
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.sim.world import World
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rebuilt import world_of

STREAMS = ["robot0_eef_pos", "robot0_joint_vel", "force_torque", "robot0_tactile_left", "object-state"]
STEPS = 40


@pytest.fixture
def brief(monkeypatch):
    """Episodes are lost after 0.1 s in the scenario with most tiles, later in others."""
    end = lambda self, world: "too late" if world.time > 0.05 + 0.02 * self.count else None  # noqa: E731
    monkeypatch.setattr(DominoSingle, "failure", end)


def actions(steps, slots):
    return np.random.default_rng(0).uniform(-1, 1, (steps, slots, 7)).astype(np.float32)


def played(threads, mode, slots=3):
    """All that a vector environment returns in a run, and the scenarios in each slot."""
    envs = PoolVectorEnv("domino_single", REFERENCE, slots, threads, mode, observations=STREAMS)
    seen, infos = envs.reset(seed=4, options={"labels": True})
    trace, ids = [(seen, None, None, None)], [[name] for name in infos["scenario"]]
    for row in actions(STEPS, slots):
        seen, rewards, terminated, truncated, infos = envs.step(row)
        trace.append((seen, rewards, terminated, truncated))
        for slot in np.flatnonzero(infos.get("_scenario", [])):
            ids[slot].append(infos["scenario"][slot])
    envs.close()
    return trace, ids


@pytest.mark.parametrize("task", ["plate_shelf_hobi", "plate_shelf_hetbi"])
def test_what_many_simulations_hold_is_what_is_read_of_each(task):
    """Both hands, and no jaw in place of a suction cup; `eef_quat` is converted, the rest is copied."""
    known = load_task(task)
    world = world_of(known.draw(ID, 0, 0).scenario, known.embodiment)
    for wiggle in (0.5, -0.5):
        for _ in range(20):
            world.step_filtered(np.full(14, wiggle, np.float32))
        for stream in (streams := streams_of(known.embodiment)).values():
            if stream.view:
                held = np.array([stream.view(world)] * 2)
                told = stream.convert(held) if stream.convert else held
                assert [row.tobytes() for row in told] == [stream.read(world).tobytes()] * 2
    viewed = {name for name, stream in streams.items() if stream.view}
    assert viewed == set(proprioception(known.embodiment))


@pytest.mark.usefixtures("brief")
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_bits_are_those_of_single_environments_in_any_number_of_threads(mode):
    trace, ids = played(1, mode)
    assert sum(map(len, ids)) > 6, "some episodes end"
    for threads in (2, 3):
        other, names = played(threads, mode)
        assert names == ids
        for ours, theirs in zip(trace, other, strict=True):
            assert all(ours[0][name].tobytes() == theirs[0][name].tobytes() for name in STREAMS)
            assert all(np.array_equal(a, b) for a, b in zip(ours[1:], theirs[1:], strict=True))
    for slot in range(3):
        env, names = PoolEnv("domino_single", REFERENCE, STREAMS), iter(ids[slot])
        seen, over = env.reset(options={"scenario": next(names)})[0], False
        for step, row in enumerate(actions(STEPS, 3)):
            assert all(trace[step][0][name][slot].tobytes() == seen[name].tobytes() for name in STREAMS)
            if over and mode == "NextStep":
                seen, over = env.reset(options={"scenario": next(names)})[0], False
                assert not trace[step + 1][2][slot]
                continue
            seen, reward, terminated, truncated, _ = env.step(row[slot])
            over = terminated or truncated
            assert [part[slot] for part in trace[step + 1][1:]] == [reward, terminated, truncated]
            if over and mode == "SameStep":
                seen = env.reset(options={"scenario": next(names)})[0]


@pytest.mark.parametrize("threads", [1, 2])
def test_scenarios_with_different_numbers_of_bodies_share_an_environment(threads):
    slots, rows = 24, list(Pool.open(REFERENCE).rows())
    envs = PoolVectorEnv("domino_single", REFERENCE, slots, threads)
    envs.reset(seed=0)
    assert len({env.world.model.nbody for env in envs.envs}) == 4, "four numbers of tiles"
    witnesses = [rows[slot % len(rows)].witness for slot in range(slots)]
    for step in range(STEPS):
        envs.step(np.array([witness[step] for witness in witnesses]))
    for slot, env in enumerate(envs.envs[: len(rows)]):
        single = World.load(rows[slot].scene_xml)
        for action in rows[slot].witness[:STEPS]:
            single.step_filtered(action)
        assert {other.world.digest for other in envs.envs[slot :: len(rows)]} == {single.digest} == {env.world.digest}
    envs.close()


@pytest.mark.usefixtures("brief")
def test_scenarios_are_handed_out_in_the_order_of_the_pool_each_once():
    _, ids = played(2, "SameStep", slots=2)
    order = [row.id for row in Pool.open(REFERENCE).rows(witness=False)]
    assert [names[0] for names in ids] == [order[4], order[5]]
    handed_out = sorted(order.index(name) for names in ids for name in names[1:3])
    assert handed_out == [0, 1, 2, 3]


@pytest.mark.usefixtures("brief")
def test_the_end_of_an_episode_is_in_the_infos_of_the_same_step():
    envs = PoolVectorEnv("domino_single", REFERENCE, 2, autoreset_mode=AutoresetMode.SAME_STEP)
    first, _ = envs.reset(seed=0)
    for row in actions(STEPS, 2):
        seen, _, terminated, _, infos = envs.step(row)
        if terminated.any():
            break
    slot = int(np.flatnonzero(terminated)[0])
    assert infos["final_info"]["reason"][slot] == "too late" and infos["_final_info"][slot]
    assert infos["final_info"]["time"][slot] > 0.1 and infos["time"][slot] == 0.0
    last = infos["final_obs"][slot]["robot0_eef_pos"]
    assert not np.array_equal(last, seen["robot0_eef_pos"][slot])
    assert np.allclose(seen["robot0_eef_pos"][slot], first["robot0_eef_pos"][slot], atol=1e-3), "at its start again"


def test_infos_and_spaces_are_those_of_gymnasiums_own_vector_environment():
    ours = gymnasium.make_vec("scengen/domino_single-v2", num_envs=2, pool=REFERENCE)
    theirs = SyncVectorEnv([lambda: PoolEnv("domino_single", REFERENCE)] * 2)
    assert isinstance(ours, PoolVectorEnv) and ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    for step in ("reset", *actions(3, 2)):
        a, b = (envs.reset(seed=1) if isinstance(step, str) else envs.step(step) for envs in (ours, theirs))
        assert a[0] in ours.observation_space
        assert all(np.array_equal(a[0][name], b[0][name]) for name in b[0])
        assert all(np.array_equal(x, y) and x.dtype == y.dtype for x, y in zip(a[1:-1], b[1:-1], strict=True))
        assert a[-1].keys() == b[-1].keys()
        assert all(np.array_equal(a[-1][key], b[-1][key]) and a[-1][key].dtype == b[-1][key].dtype for key in b[-1])


def test_returned_arrays_are_never_written_again():
    envs = PoolVectorEnv("domino_single", REFERENCE, 2)
    seen, _ = envs.reset(seed=0)
    kept = {name: value.copy() for name, value in seen.items()}
    for row in actions(20, 2):
        envs.step(row)
    assert all(np.array_equal(seen[name], kept[name]) for name in seen)


@pytest.mark.usefixtures("brief")
def test_without_autoreset_a_slot_waits_for_its_reset():
    envs = PoolVectorEnv("domino_single", REFERENCE, 4, autoreset_mode=AutoresetMode.DISABLED)
    env = PoolEnv("domino_single", REFERENCE)
    names = [row.id for row in Pool.open(REFERENCE).rows(witness=False)]
    envs.reset(seed=0)
    given, over, rewards, ends = actions(STEPS, 4), np.zeros(4, bool), np.zeros(4), {}
    for row in given:
        before, (seen, rewards, terminated, truncated, infos) = over, envs.step(row)
        over = terminated | truncated
        assert (over >= before).all() and not rewards.any()
        for slot in np.flatnonzero(over & ~before):
            ends[slot] = {name: value[slot].copy() for name, value in seen.items()}
            assert infos["reason"][slot] == "too late"
        for slot in np.flatnonzero(before):
            assert all(np.array_equal(seen[name][slot], value) for name, value in ends[slot].items())
    assert over.all()
    mask = np.array([False, True, False, False])
    seen, infos = envs.reset(options={"scenario": names[5], "reset_mask": mask, "labels": True})
    assert infos["scenario"][1] == names[5] and infos["_scenario"].tolist() == mask.tolist()
    seen, _, terminated, _, _ = envs.step(given[0])
    assert terminated.tolist() == [True, False, True, True]
    env.reset(options={"scenario": names[5]})
    single = env.step(given[0, 1])[0]
    assert all(np.array_equal(seen[name][1], value) for name, value in single.items())
    assert all(np.array_equal(seen[name][0], value) for name, value in ends[0].items())


def test_slots_that_the_first_reset_leaves_out_stand_still():
    envs = PoolVectorEnv("domino_single", REFERENCE, 2, autoreset_mode=AutoresetMode.DISABLED)
    envs.reset(seed=0, options={"reset_mask": [True, False]})
    _, _, _, truncated, _ = envs.step(np.zeros((2, 7)))
    assert truncated.tolist() == [False, True]
    assert [world.time for world in envs.get_attr("world")] == [pytest.approx(0.01), 0.0]


@pytest.mark.parametrize("mask", [[True], [False, False], [0, 1], "1"])
def test_a_mask_that_is_none_is_refused(mask):
    envs = PoolVectorEnv("domino_single", REFERENCE, 2)
    with pytest.raises(BadConfig, match="give 2 booleans, one of them true"):
        envs.reset(options={"reset_mask": mask})


def test_scenarios_can_be_named_for_each_slot():
    order = [row.id for row in Pool.open(REFERENCE).rows(witness=False)]
    envs = PoolVectorEnv("domino_single", REFERENCE, 2)
    _, infos = envs.reset(options={"scenario": [order[3], order[1]], "labels": True})
    assert [*infos["scenario"]] == [order[3], order[1]]
    _, infos = envs.reset(seed=[5, None], options={"labels": True})
    assert [*infos["scenario"]] == [order[5], order[2]]


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
def test_pictures_are_those_of_single_environments():
    names = {"observations": ["rgb_exo_right_cam"], "width": 64, "height": 64}
    envs, single = PoolVectorEnv("domino_single", REFERENCE, 2, **names), PoolEnv("domino_single", REFERENCE, **names)
    seen, _ = envs.reset(seed=0)
    assert np.array_equal(seen["rgb_exo_right_cam"][1], single.reset(seed=1)[0]["rgb_exo_right_cam"])
    assert envs.render() is None and envs.envs[0]._renderer is not None
    envs.close()


@pytest.mark.parametrize(
    ("settings", "error", "says"),
    [
        ({"num_envs": 0}, BadConfig, r"num_envs = 0; it must be a whole number in \[1, 4096\]"),
        ({"threads": 1.5}, BadConfig, "threads = 1.5; it must be a whole number"),
        ({"autoreset_mode": "Never"}, UnknownName, "no autoreset_mode named 'Never'"),
        ({"observations": ["nothing"]}, UnknownName, "no observation named 'nothing'"),
    ],
)
def test_settings_without_a_meaning_are_refused(settings, error, says):
    with pytest.raises(error, match=says):
        PoolVectorEnv("domino_single", REFERENCE, **settings)


def test_bad_actions_and_seeds_are_refused_before_anything_is_simulated():
    envs = PoolVectorEnv("domino_single", REFERENCE, 2)
    with pytest.raises(BadConfig, match="call reset first"):
        envs.step(np.zeros((2, 7)))
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=r"shape \(2, 7\), not \(7,\)"):
        envs.step(np.zeros(7))
    with pytest.raises(ValueError, match="that of slot 1 is"):
        envs.step([[0] * 7, [np.nan] * 7])
    assert envs.get_attr("world")[0].time == 0.0
    with pytest.raises(BadConfig, match="3 seeds for 2 slots"):
        envs.reset(seed=[1, 2, 3])


def test_a_simulation_that_becomes_unstable_ends_its_episode(monkeypatch):
    def unstable(world, sent):
        raise Unstable("MuJoCo raised a warning")

    envs, env = PoolVectorEnv("domino_single", REFERENCE, 2), PoolEnv("domino_single", REFERENCE)
    envs.reset(seed=0), env.reset(seed=0)
    monkeypatch.setattr(World, "step_filtered", unstable)
    *_, terminated, truncated, infos = envs.step(np.zeros((2, 7)))
    assert terminated.all() and not truncated.any() and not infos["success"].any()
    assert [*infos["reason"]] == ["MuJoCo raised a warning"] * 2
    *_, terminated, truncated, info = env.step(np.zeros(7))
    assert terminated and not truncated and info["reason"] == "MuJoCo raised a warning"


def test_an_error_in_a_thread_reaches_the_caller(monkeypatch):
    envs = PoolVectorEnv("domino_single", REFERENCE, 4, 2)
    envs.reset(seed=0)
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        envs.step(np.zeros((4, 7)))


assert scengen.envs.gym  # registers the tasks
