"""Training: the same data give the same weights, also after an interruption, and what was shown is learned."""

import re
from dataclasses import replace

import numpy as np
import pytest

from scengen.errors import BadConfig
from scengen.learn.data import TrainingData, Trajectory
from scengen.learn.expected import expected
from scengen.learn.models import BC, KINDS, KNN, MIP, REFINED_AT, perceptron, predict
from scengen.learn.store import StoredPolicy
from scengen.learn.train import TrainSettings, train

ENTRIES = ("robot0_eef_pos.x", "robot0_eef_pos.y", "robot0_eef_pos.z")
ROBOT = "panda_jaw"


def shown(count=8, rows=60):
    """Demonstrations in which the hand goes back to the origin, and closes where x is positive."""
    random = np.random.default_rng(3)
    found = []
    for i in range(count):
        seen = random.uniform(-0.5, 0.5, (rows, 3)).astype(np.float32)
        grip = np.where(seen[:, :1] > 0, 1.0, -1.0)
        hands = np.tile(np.array([0, 0, 0, 0, 0, 0, 1], np.float32), (rows, 1))  # so that goals are the actions
        actions = np.hstack([-seen, 0 * seen, grip]).astype(np.float32)
        found.append(Trajectory(f"{i:012x}", seen, hands, actions))
    return TrainingData("push", 1, ROBOT, 25, ("robot0_eef_pos",), ENTRIES, tuple(found), "0" * 64, {})


def trained(folder, progress=lambda *_: None, data=None, **changes):
    given = {"policy": BC, "to": str(folder), "steps": 1, "chunk": 1, "played": 1, "hidden": [32], "epochs": 6}
    return train(TrainSettings(**{**given, **changes}), data or shown(), progress)


def weights(folder):
    return (folder / "weights.npz").read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_data_give_the_same_weights(tmp_path, kind):
    for name in ("a", "b"):
        trained(tmp_path / name, policy=kind)
    assert weights(tmp_path / "a") == weights(tmp_path / "b")
    assert (tmp_path / "a" / "loss.svg").read_bytes() == (tmp_path / "b" / "loss.svg").read_bytes()


def test_another_seed_gives_other_weights(tmp_path):
    trained(tmp_path / "a")
    trained(tmp_path / "b", seed=1)
    assert weights(tmp_path / "a") != weights(tmp_path / "b")


@pytest.mark.parametrize("kind", [BC, MIP])
def test_an_interrupted_training_ends_with_the_same_weights(tmp_path, kind):
    def interrupt(done, total, told):
        if done == 3:
            raise KeyboardInterrupt

    trained(tmp_path / "whole", policy=kind)
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path / "cut", interrupt, policy=kind)
    assert not (tmp_path / "cut" / "policy.json").exists(), "half a policy cannot be played"
    assert trained(tmp_path / "cut", policy=kind).earlier == 3
    assert weights(tmp_path / "cut") == weights(tmp_path / "whole")
    assert sorted(path.name for path in (tmp_path / "cut").iterdir()) == sorted(
        path.name for path in (tmp_path / "whole").iterdir()
    )


def test_an_epoch_that_is_interrupted_inside_scikit_learn_is_not_kept(tmp_path, monkeypatch):
    """It ends the pass, warns, and returns what it has: half an epoch that a continued training would build on."""
    from sklearn.neural_network import _multilayer_perceptron as perceptrons

    batches = perceptrons.gen_batches

    def interrupt(done, total, told):
        if done == 3:
            monkeypatch.setattr(perceptrons, "gen_batches", cut)

    def cut(*arguments, **options):
        yield next(iter(batches(*arguments, **options)))
        raise KeyboardInterrupt

    trained(tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path / "cut", interrupt)
    monkeypatch.setattr(perceptrons, "gen_batches", batches)
    assert trained(tmp_path / "cut").earlier == 3
    assert weights(tmp_path / "cut") == weights(tmp_path / "whole")


def test_a_finished_training_is_not_repeated_and_never_replaced(tmp_path):
    trained(tmp_path)
    assert trained(tmp_path).losses == ()
    with pytest.raises(BadConfig, match="holds a policy of other data or settings"):
        trained(tmp_path, epochs=7)


@pytest.mark.parametrize(
    "changed", [{"seed": 9}, {"task": "pull"}, {"rows": 10**6}, {"played": 1, "chunk": 2}, {"epochs": 60}]
)
def test_a_policy_with_other_settings_than_its_training_gives_is_not_called_the_same(tmp_path, changed):
    trained(tmp_path, chunk=2, played=2)
    stored = StoredPolicy.open(tmp_path)
    StoredPolicy(replace(stored.settings, **changed), stored.arrays).write(tmp_path)
    with pytest.raises(BadConfig, match=f"has another {next(iter(changed))} than this training gives; delete it"):
        trained(tmp_path, chunk=2, played=2)


@pytest.mark.parametrize(
    ("kind", "array"), [(BC, "input_mean"), (MIP, "output_scale"), (KNN, "inputs"), (KNN, "chunks")]
)
def test_arrays_that_follow_from_the_data_are_compared(tmp_path, kind, array):
    """The other weights follow from the training alone, and the command says that they are claimed."""
    trained(tmp_path, policy=kind)
    stored = StoredPolicy.open(tmp_path)
    StoredPolicy(stored.settings, {**stored.arrays, array: stored.arrays[array] + np.float32(0.01)}).write(tmp_path)
    with pytest.raises(BadConfig, match=f"has another {array} than this training gives; delete it"):
        trained(tmp_path, policy=kind)


def test_an_unfinished_training_of_other_settings_is_not_replaced(tmp_path):
    def interrupt(done, total, told):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path, interrupt)
    with pytest.raises(BadConfig, match="unfinished training with other data or settings"):
        trained(tmp_path, epochs=7)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_shown_is_learned(tmp_path, kind):
    """The error on held-out demonstrations falls far below 1, the error of always playing the mean."""
    found = trained(tmp_path, policy=kind, epochs=60, data=shown(40))
    assert found.losses[-1][1] < 0.2
    stored = StoredPolicy.open(tmp_path)
    here = np.array([[0.3, -0.2, 0.1]], np.float32)
    predicted = predict(kind, stored.arrays, stored.features.inputs(here))
    action = predicted[0] * stored.arrays["output_scale"] + stored.arrays["output_mean"]
    assert action[:3] == pytest.approx([-0.3, 0.2, -0.1], abs=0.12) and action[6] > 0.5


def test_validation_uses_no_scenario_that_was_learned_from(tmp_path):
    """Several runs of one scenario are on the same side."""
    data = shown(8)
    twice = [replace(one, observations=one.observations + 0.01) for one in data.trajectories]
    both = replace(data, trajectories=(*data.trajectories, *twice), sha256="1" * 64)
    found = trained(tmp_path, policy=KNN, data=both)
    assert (found.settings.demonstrations, found.held_out) == (14, 2)
    assert found.losses[-1][1] > 0.01, "a run of the same scenario is 1 cm away"


def test_mip_refines_its_own_first_prediction(tmp_path):
    trained(tmp_path, policy=MIP)
    arrays = StoredPolicy.open(tmp_path).arrays
    here = np.array([[0.5, -1.0, 0.25]], np.float32)
    first = perceptron(arrays, np.hstack([here, np.zeros((1, 8), np.float32)]))
    second = perceptron(arrays, np.hstack([here, REFINED_AT * first, np.full((1, 1), REFINED_AT, np.float32)]))
    assert np.array_equal(predict(MIP, arrays, here), second) and not np.allclose(first, second)


def test_an_ensemble_is_the_mean_of_its_members(tmp_path):
    assert trained(tmp_path, members=3, hidden=[16, 8]).settings.members == 3
    arrays = {
        name: one for name, one in StoredPolicy.open(tmp_path).arrays.items() if name[:-1] in ("weights", "biases")
    }
    here = np.array([[0.5, -1.0, 0.25], [0.0, 0.1, 0.2]], np.float32)
    each = [perceptron({name: one[k : k + 1] for name, one in arrays.items()}, here) for k in range(3)]
    assert perceptron(arrays, here) == pytest.approx(np.mean(each, axis=0), abs=1e-6)
    assert not np.allclose(each[0], each[1]), "members begin with weights of their own"


def test_a_limit_of_time_ends_the_training(tmp_path):
    assert trained(tmp_path, epochs=100_000, minutes=0.01).settings.epochs < 100_000


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"policy": "bcc"}, "no policy to train named 'bcc' (did you mean 'bc'?)"),
        ({"played": 9}, "played = 9; it must be at most chunk = 1"),
        ({"epochs": 0}, "epochs = 0; it must be at least 1"),
        ({"demonstrations": 1}, "demonstrations = 1; it must be at least 2"),
        ({"members": 0}, "members = 0; it must lie in [1, 1000]"),
        ({"hidden": []}, "hidden = []; give the units"),
    ],
)
def test_settings_without_a_meaning_are_refused(tmp_path, changes, said):
    with pytest.raises(Exception) as error:
        trained(tmp_path, **changes)
    assert said in str(error.value) and not list(tmp_path.iterdir())


def by_heart(count=10, rows=8, entries=40):
    """Demonstrations of noise: they can be learned by heart alone."""
    random, data, found = np.random.default_rng(5), shown(count, rows), []
    for one in data.trajectories:
        seen = random.uniform(-1, 1, (rows, entries)).astype(np.float32)
        actions = np.hstack([random.uniform(-1, 1, (rows, 6)), one.actions[:, 6:]]).astype(np.float32)
        found.append(replace(one, actions=actions, observations=seen))
    return replace(data, trajectories=tuple(found), entries=tuple(f"noise.{k}" for k in range(entries)))


HARD = {"hidden": [128], "members": 1, "epochs": 80}
"""A network that is large enough to learn the noise of `by_heart`."""


def test_a_policy_that_learns_by_heart_is_said_to_and_one_that_learns_is_not(tmp_path):
    noise = trained(tmp_path / "noise", data=by_heart(), **HARD)
    assert "the held-out error rose from" in noise.memorised and "memorised them" in noise.memorised
    assert trained(tmp_path / "shown").memorised == ""


def test_with_patience_the_weights_of_the_best_epoch_are_kept(tmp_path):
    whole = trained(tmp_path / "whole", data=by_heart(), **HARD)
    best = 1 + int(np.argmin([held_out for _, held_out in whole.losses]))
    early = trained(tmp_path / "early", data=by_heart(), patience=5, **HARD)
    assert best + 5 < 80 and len(early.losses) == best + 5 and early.losses == whole.losses[: best + 5]
    assert early.settings.epochs == best

    class Cut(Exception):
        pass

    def cut(done, *_):
        if done == best:
            raise Cut

    with pytest.raises(Cut):
        trained(tmp_path / "cut", cut, data=by_heart(), **HARD)
    with (
        np.load(next((tmp_path / "cut").glob("unfinished-*"))) as stored,
        np.load(tmp_path / "early" / "weights.npz") as kept,
    ):
        assert all(
            np.array_equal(stored[name], kept[name]) for name in stored if name.startswith(("weights", "biases"))
        )


def test_an_interrupted_training_with_patience_ends_with_the_same_weights(tmp_path):
    def interrupt(done, total, told):
        if done == 20:
            raise KeyboardInterrupt

    settings = {"data": by_heart(), "patience": 15, **HARD}
    trained(tmp_path / "whole", **settings)
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path / "cut", interrupt, **settings)
    assert trained(tmp_path / "cut", **settings).earlier == 20
    assert weights(tmp_path / "cut") == weights(tmp_path / "whole")
    assert trained(tmp_path / "cut", **settings).losses == (), "it is there already"


def test_a_training_says_what_to_expect():
    assert re.fullmatch(
        r"to expect: of 20 training scenarios bc solved [\d.]+ after 25, [\d.]+ after 50, .* demonstrations.*",
        expected("domino_single", BC),
    )
    assert "was not measured" in expected("packing", BC)
