"""Perturbations are drawn by key, change what is perceived and nothing else, and faults in them are found."""

import copy
import json
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from helpers import REFERENCE, pictures_are_possible
from PIL import Image

from scengen import cli
from scengen.compose import load_task
from scengen.envs.gym import PoolEnv
from scengen.envs.pools import reference_pool
from scengen.envs.vector import PoolVectorEnv
from scengen.errors import BadConfig, UnknownName
from scengen.evaluate.rollouts import evaluate
from scengen.evaluate.settings import EvaluateSettings
from scengen.measures.measurement import Job
from scengen.measures.perturbations import Proofs
from scengen.measures.proofs import Stage, faults_of_draws
from scengen.perturb.distractors import visible
from scengen.perturb.drawn import arrays
from scengen.perturb.effects import EFFECTS, EYE, PICTURES
from scengen.perturb.kinds import LEVELS, kinds, perceived
from scengen.perturb.language import Words
from scengen.perturb.perturbation import Perturbation
from scengen.pool import Pool

drawing = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
STREAMS = ["robot0_eef_pos", "robot0_eef_quat", "force_torque", "object-state"]
CAMERAS = ["rgb_exo_right_cam", "rgb_gripper_cam"]


@pytest.fixture(scope="module")
def row():
    return Pool.open(REFERENCE).at(0)


def test_every_effect_has_a_file_with_five_growing_strengths():
    assert kinds().keys() == EFFECTS.keys()
    for kind in kinds().values():
        assert len(kind.strengths) == LEVELS and all(np.diff(kind.strengths) > 0) and kind.why and kind.source


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("nose@3", UnknownName, r"no perturbation named 'nose' \(did you mean 'noise'\?\)"),
        ("noise", BadConfig, "give noise a level from 1 to 5, such as noise@3"),
        ("noise@6", BadConfig, "give noise a level from 1 to 5"),
        ("noise@²", BadConfig, "give noise a level from 1 to 5"),
        ("noise@1+noise@2", BadConfig, "noise is in it twice"),
        ("noise@1+", UnknownName, "no perturbation named ''"),
    ],
)
def test_what_is_no_perturbation_is_refused(text, error, says):
    with pytest.raises(error, match=says):
        Perturbation.parse(text)


@pytest.mark.parametrize("text", [None, "", "none"])
def test_nothing_perturbs_nothing(text):
    assert not Perturbation.parse(text) and str(Perturbation.parse(text)) == "none"


@pytest.mark.parametrize(
    ("observed", "perturb", "says"),
    [
        (STREAMS, "camera_fov@1", "affects all cameras, and none is observed"),
        (["rgb_exo_right_cam"], "wrist_camera@1", "affects wrist cameras, and none is observed"),
        (["rgb_gripper_cam"], "camera_angle@1", "affects fixed cameras, and none is observed"),
        (["robot0_eef_pos"], "object_noise@1", "affects streams of object-state, and none is observed"),
        (
            ["robot0_eef_pos"],
            "blur@3+wrench_noise@2",
            r"blur@3 affects all cameras, and none is observed; wrench_noise@2 .* is observed: add one, such as "
            r"observations=\[state,rgb_exo_right_cam,force_torque\]",
        ),
    ],
)
def test_a_kind_without_effect_on_what_is_observed_is_refused(observed, perturb, says):
    with pytest.raises(BadConfig, match=says):
        PoolEnv("domino_single", REFERENCE, observed, perturb=perturb)


@pytest.mark.parametrize("name", perceived())
def test_a_draw_depends_on_kind_scenario_and_seed_and_a_level_goes_farther_the_same_way(name):
    one, two = (Perturbation(((name, level),)).of("a").plain()[name] for level in (1, 2))
    assert (
        Perturbation((("blur", 1), (name, 1)) if name != "blur" else (("noise", 1), (name, 1))).of("a").plain()[name]
        == one
    )
    assert one != two
    part = Perturbation(((name, 3),))
    drawn = [
        [str(part.of(*key).plain()) for key in keys]
        for keys in ([(c, 0) for c in "abcdefgh"], [("a", n) for n in range(8)])
    ]
    assert all((len({*each}) > 1) == EFFECTS[name].varies for each in drawn)


# --- environments -------------------------------------------------------------------------------


def seen(perturb, observed, steps=3, **settings):
    """The observation after some steps, and the state."""
    env = PoolEnv("domino_single", REFERENCE, observed, width=48, height=48, perturb=perturb, **settings)
    env.reset(seed=0)
    for _ in range(steps):
        observation, *_ = env.step(np.full(7, 0.3))
    state = env.world.state()
    env.close()
    return observation, state


@pytest.mark.parametrize(
    ("perturb", "changed"),
    [
        ("proprioception_noise@2", ["robot0_eef_pos", "robot0_eef_quat"]),
        ("proprioception_bias@2", ["robot0_eef_pos", "robot0_eef_quat"]),
        ("wrench_noise@2", ["force_torque"]),
        ("object_noise@2", ["object-state"]),
        ("wrench_noise@1+object_noise@1", ["force_torque", "object-state"]),
    ],
)
def test_readings_change_and_the_simulation_does_not(perturb, changed):
    (clean, state), (found, same) = seen(None, STREAMS), seen(perturb, STREAMS)
    assert (state == same).all()
    assert [name for name in STREAMS if (clean[name] != found[name]).any()] == changed
    if "robot0_eef_quat" in changed:
        assert np.linalg.norm(found["robot0_eef_quat"]) == pytest.approx(1.0, abs=1e-6)
    again, _ = seen(perturb, STREAMS)
    other, _ = seen(perturb, STREAMS, perturb_seed=1)
    assert all((again[name] == found[name]).all() for name in STREAMS)
    assert any((other[name] != found[name]).any() for name in changed)


def test_a_bias_stays_and_noise_does_not():
    for perturb, stays in (("proprioception_bias@3", True), ("proprioception_noise@3", False)):
        errors = [
            seen(perturb, STREAMS, n)[0]["robot0_eef_pos"] - seen(None, STREAMS, n)[0]["robot0_eef_pos"] for n in (2, 9)
        ]
        assert np.allclose(*errors, atol=1e-6) == stays


@drawing
@pytest.mark.parametrize("perturb", ["noise@3", "light_direction@3+camera_angle@2"])
def test_slots_and_copies_perceive_the_same(perturb):
    observed = [*CAMERAS[:1], "robot0_eef_pos"]
    settings = {"observations": observed, "width": 48, "height": 48, "perturb": perturb}
    single, many = (
        PoolEnv("domino_single", REFERENCE, **settings),
        PoolVectorEnv("domino_single", REFERENCE, 2, **settings),
    )
    single.reset(seed=0)
    many.reset(seed=0)
    for _ in range(2):
        one, *_ = single.step(np.zeros(7))
        both, *_ = many.step(np.zeros((2, 7)))
    twin = copy.deepcopy(single)
    assert all((both[name][0] == one[name]).all() for name in observed)
    again, *_ = twin.step(np.zeros(7))
    after, *_ = single.step(np.zeros(7))
    assert all((again[name] == after[name]).all() for name in observed)
    for env in (single, many, twin):
        env.close()


def test_episodes_of_an_evaluation_say_what_was_drawn(tmp_path):
    words = ["evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", f"to={tmp_path}"]
    assert cli.run([*words, "perturb=proprioception_bias@4"]) == 0
    assert '"perturb": {"proprioception_bias": {"bias": 0.007' in (tmp_path / "episodes.jsonl").read_text()
    assert "| id | proprioception_bias@4 |" in (tmp_path / "table.md").read_text()


# --- proofs -------------------------------------------------------------------------------------


def staged(row, secrets=()):
    scenario = load_task(row.task).scenario(row.params)
    words = Words.of(row.task, row.instruction)
    return closing(Stage(scenario, row.scene_xml, row.embodiment, row.witness, words, secrets))


@pytest.fixture(scope="module")
def stage(row):
    with staged(row, ["low_starter"]) as made:
        yield made


@drawing
@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("thing_colour", 1),
        ("thing_texture", 5),
        ("light_direction", 2),
        ("camera_angle", 2),
        ("noise", 3),
        ("object_noise", 1),
    ],
)
def test_sound_kinds_are_proved(stage, name, level):
    assert list(stage.proof(kinds()[name], level).faults()) == []


@drawing
def test_readings_of_a_scene_without_free_bodies_are_proved():
    """The pendulum hangs on hinges."""
    row = Pool.open(reference_pool("pendulum_grasp")).at(0)
    with staged(row) as hanging:
        assert not hanging.world.free_bodies
        assert list(hanging.proof(kinds()["object_noise"], 1).faults()) == []


def planted(monkeypatch, name, **parts):
    """A kind with a fault in its effect."""
    monkeypatch.setattr("scengen.perturb.kinds.EFFECTS", {**EFFECTS, name: replace(EFFECTS[name], **parts)})
    return kinds()[name]


def spare_wrist(change):
    """A change of cameras that leaves those on wrists out."""

    def spared(model, values):
        before = {n: model.cam_fovy[n] for n in range(model.ncam) if model.camera(n).name.endswith(EYE)}
        change(model, values)
        for number, fovy in before.items():
            model.cam_fovy[number] = fovy

    return spared


def weigh(model, values):
    model.body_mass[:] *= 1.0001


def blind(model, values):
    model.cam_pos[:] += 5.0


def move_a_tile(model, values):
    model.geom_pos[model.body("tile_0").geomadr[0]] += 0.01


def collide(model, values):
    EFFECTS["distractors"].on_model(model, values)
    model.geom_contype[visible(model)] = 1
    model.geom_conaffinity[visible(model)] = 1


def put_in_the_way(model, values):
    EFFECTS["distractors"].on_model(model, values)
    model.geom_pos[visible(model)[0]] = model.body("tile_0").pos


def paint_the_slab(model, values, bodies):
    EFFECTS["thing_colour"].on_things(model, values, bodies)
    model.geom_rgba[model.body("slab").geomadr[0], :3] = [0.9, 0.45, 0.1]


FAULTS = {
    "red that turned orange": ("thing_colour", {"on_things": paint_the_slab}, "slab looks different"),
    "things that stay as they are": ("thing_colour", {"on_things": lambda model, values, bodies: None}, "changes by 0"),
    "a print that is not uploaded": (
        "thing_texture",
        {"on_things": lambda model, values, bodies: None},
        "changes by 0",
    ),
    "a dead light": ("light_direction", {"on_model": lambda model, values: None}, "changes by 0"),
    "the wrist left out": ("camera_fov", {"on_model": spare_wrist(EFFECTS["camera_fov"].on_model)}, "rgb_gripper_cam"),
    "a picture that is not changed": ("noise", {"on_picture": lambda picture, values, rng: picture}, "changes by 0"),
    "masses that change": ("table_colour", {"on_model": weigh}, "the physics differs"),
    "a camera that looks away": ("camera_position", {"on_model": blind}, "is out of sight"),
    "a patch over everything": ("patch", {"on_picture": lambda picture, values, rng: 0 * picture}, "is out of sight"),
    "a reading that is not changed": (
        "object_noise",
        {"on_reading": lambda n, reading, v, rng: reading},
        "changes by 0",
    ),
    "nothing that it changes": ("noise", {"reads": "sounds"}, "it changes nothing"),
    "a frozen texture": ("table_texture", {"on_model": lambda model, values: None}, "changes by 0"),
    "a field of view that is not applied": ("camera_fov", {"on_model": lambda model, values: None}, "changes by 0"),
    "noise in one stream of several": (
        "proprioception_noise",
        {
            "on_reading": lambda n, r, v, rng: (
                EFFECTS["proprioception_noise"].on_reading(n, r, v, rng) if len(r) == 3 else r
            )
        },
        "robot0_joint_pos changes by 0",
    ),
    "things that move": ("distractors", {"on_model": move_a_tile}, "the physics differs"),
    "distractors that collide": ("distractors", {"on_model": collide}, "the physics differs"),
    "a distractor in the way": ("distractors", {"on_model": put_in_the_way}, "a distractor is in the way"),
    "a picture that is not late": ("late", {"is_late": False}, "changes by 0"),
    "frames that never drop": ("dropped", {"on_picture": lambda picture, values, rng: picture}, "changes by 0"),
    "a text that stays": ("reworded", {"on_text": lambda text, values, words: text}, "instruction changes by 0"),
    "an axis in the text": (
        "verbose",
        {"on_text": lambda text, values, words: f"{text} This is low starter."},
        "the text names low_starter",
    ),
}


@drawing
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_found(stage, monkeypatch, fault):
    name, parts, says = FAULTS[fault]
    told = list(stage.proof(planted(monkeypatch, name, **parts), 3).faults())
    assert any(says in each for each in told), told


@pytest.mark.parametrize(
    ("name", "draw", "says"),
    [
        ("camera_angle", lambda strength, rng: {"turn": [strength, 0.0, 0.0]}, "all scenarios have the same draw"),
        (
            "camera_position",
            lambda strength, rng: {"way": [strength * rng.normal(), 0.0, strength * rng.random()]},
            "way is drawn to one side only",
        ),
        ("exposure", lambda strength, rng: {"factor": 1.0 + rng.random()}, "factor is drawn to one side only"),
    ],
)
def test_faults_of_draws_are_found(monkeypatch, name, draw, says):
    assert not [*faults_of_draws(kinds()[name])]
    assert says in [*faults_of_draws(planted(monkeypatch, name, draw=draw))]


@drawing
def test_a_level_that_changes_no_more_than_the_one_before_is_found(monkeypatch):
    task, kept = load_task("domino_single"), kinds()
    kind = replace(kept["noise"], strengths=(4.0, 8.0, 8.0, 24.0, 36.0))
    monkeypatch.setattr("scengen.measures.perturbations.perceived", lambda: {"noise": kind})
    monkeypatch.setattr("scengen.measures.perturbations.kinds", lambda: {"noise": kind})
    monkeypatch.setattr("scengen.perturb.perturbation.kinds", lambda: {"noise": kind})
    found = Proofs({"n": 1}).result(Job(task, ("id",), {"n": 1}))
    assert found.rows[0].value["faults"] == {"noise@3": ["it changes more than level 2 in 0% only"]}
    assert found.rows and not Proofs({"n": 1, "kinds": "noise"}).result(Job(task, ("id",), {"n": 1})).rows
    with pytest.raises(UnknownName, match="did you mean 'noise'"):
        list(Proofs({"n": 1, "kinds": ["noisy"]}).jobs(task))
    assert found.words == "4 of 5 cells are proved\nnoise@3 is not: it changes more than level 2 in 0% only"


@drawing
def test_a_scene_is_left_as_it_was(stage):
    model, before = stage.world.model, arrays(stage.world.model)
    for name, kind in kinds().items():
        if kind.effect.reads == PICTURES:
            with Perturbation(((name, 5),)).of("a", words=stage.words).while_applied(model):
                pass
    assert all(array.tobytes() == before[name].tobytes() for name, array in arrays(model).items())


@drawing
def test_a_sheet_shows_each_level_beside_the_clean_picture(tmp_path, capsys):
    target = tmp_path / "sheet.png"
    words = ["show", "perturb", f"pool={REFERENCE}", "id=8ed4", "perturb=blur+shadow", f"to={target}", "size=32"]
    assert cli.run(words) == 0 and target.stat().st_size > 1000
    assert "blur: 1.9" in capsys.readouterr().out
    assert cli.run([*words, "perturb=table_texture"]) == 0
    cells = np.hsplit(np.asarray(Image.open(target).convert("RGB"), float)[-12:], 6)
    assert np.abs(cells[5] - cells[0]).mean() > 5, "textures are uploaded again"
    assert cli.run([*words, "perturb=wrist_camera"]) == 2
    assert "affects wrist cameras" in capsys.readouterr().err
    assert cli.run([*words, "perturb=foreign"]) == 0 and "foreign@1: Kipp den ersten" in capsys.readouterr().out
    assert cli.run([*words, "perturb=late"]) == 2 and "a single picture does not" in capsys.readouterr().err


# --- what a person gives ----------------------------------------------------------------------------


@pytest.mark.parametrize("perturb", ["shadow@3", "wrist_camera@1"])
def test_a_condition_that_cannot_be_played_is_found_before_the_clean_episodes(tmp_path, monkeypatch, perturb):
    """Its name comes after `none`, so that hours of clean episodes would be played first."""
    monkeypatch.setattr("scengen.evaluate.rollouts._played", lambda *_: pytest.fail("it has begun"))
    settings = EvaluateSettings(policy="random", pool=str(REFERENCE), to=str(tmp_path), perturb=perturb)
    with pytest.raises(BadConfig, match="and none is observed"):
        evaluate(settings, lambda *_: None)


@pytest.mark.parametrize("condition", [{"perturb": "terse@2"}, {"arms": ["reworded"]}])
def test_words_that_a_task_lacks_are_found_before_the_clean_episodes(tmp_path, monkeypatch, condition):
    monkeypatch.setattr("scengen.evaluate.rollouts._played", lambda *_: pytest.fail("it has begun"))
    monkeypatch.setattr("scengen.samplers.task_files.file_of_group", lambda *_: None)
    monkeypatch.setattr(EvaluateSettings, "_gets_text", True)
    settings = EvaluateSettings(policy="random", pool=str(REFERENCE), to=str(tmp_path), **condition)
    with pytest.raises(BadConfig, match="domino_single has no other wordings; write "):
        evaluate(settings, lambda *_: None)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("reworded: [a, b, c, d, e]\n", "it has a key twice; give each key once"),
        ("", "terse has the instruction of the task itself; give other words"),
    ],
)
def test_words_that_change_nothing_or_stand_twice_are_refused(tmp_path, monkeypatch, text, says):
    path = tmp_path / "push.yaml"
    groups = {kind: [f"{kind} {k}" for k in range(5)] for kind in ("reworded", "vague", "foreign")}
    groups["terse"] = ["Push it.", "a", "b", "c", "d"]
    path.write_text("".join(f"{kind}: {json.dumps(texts)}\n" for kind, texts in groups.items()) + text)
    monkeypatch.setattr(
        "scengen.samplers.task_files.file_of_group", lambda _, group, *__: path if group == "language" else None
    )
    with pytest.raises(BadConfig, match=says):
        Words.of("push", "Push it.")
    if not text:
        assert Words.of("push", "Pull it.").wordings["terse"][0] == "Push it."
