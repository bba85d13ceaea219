"""Films and contact sheets show what is asked for: perturbations as a policy sees them, and looks."""

from dataclasses import replace

import pytest
from helpers import REFERENCE, pictures_are_possible

from scengen import cli
from scengen.compose import load_task
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.orientation import Orientation
from scengen.perturb.perturbation import Perturbation
from scengen.pictures import film
from scengen.pool import Pool

pytestmark = pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL")
CAMERA = {"rgb_exo_right_cam": "agentview", "rgb_gripper_cam": "robot0_eye_in_hand"}
SIZE = 64


@pytest.fixture(scope="module")
def row():
    return Pool.open(REFERENCE).row("8ed4")


def take_of(row, perturb, actions=40, seed=3):
    witness = film.Take.witness(row, load_task(row.task).scenario(row.params))
    return replace(witness, actions=row.witness[:actions], perturbation=Perturbation.parse(perturb), perturb_seed=seed)


@pytest.mark.parametrize("camera", CAMERA)
@pytest.mark.parametrize("perturb", ["light_direction@4+camera_fov@3+noise@2", "late@3+patch@2", "dropped@5"])
def test_a_film_shows_what_a_policy_sees(row, perturb, camera):
    """Picture by picture, at the moments of the film."""
    settings = {"width": SIZE, "height": SIZE, "perturb": perturb, "perturb_seed": 3}
    env, seen = PoolEnv(row.task, REFERENCE, [camera], **settings), []
    observation, _ = env.reset(options={"scenario": row.id})
    for action in (*row.witness[:40], None):
        seen.append(observation[camera].copy())
        if action is not None:
            env.world.step_filtered(action)  # the witness is filtered already
            observation = env._observe()
    env.close()
    take = take_of(row, perturb)
    with film.closing(film.Camera(take.world(), SIZE, SIZE)) as eye:
        shown = list(film._frames(take, eye, 10, CAMERA[camera], lambda done, total: None))
    assert len(shown) == 5
    assert all((one == seen[10 * number]).all() for number, one in enumerate(shown))
    strip = film.strip(take, 4, SIZE, SIZE, CAMERA[camera])[:SIZE]
    above = slice(0, 38)  # of the captions
    assert (strip[above, -SIZE:] == seen[40][above]).all()


def test_a_perturbed_film_is_turned_as_pictures_for_policies_are(row, monkeypatch):
    take = take_of(row, "blur@1", actions=0)
    monkeypatch.setattr(type(take.scenario), "orientation", Orientation(1, True))
    with film.closing(film.Camera(take.world(), SIZE, SIZE)) as eye:
        clean = eye.take("agentview")
        assert (
            take.shown(eye, "agentview", 0) == take.drawn.on_picture(clean[:, ::-1].swapaxes(0, 1)[::-1], "", 0)
        ).all()
        assert (replace(take, perturbation=Perturbation(())).shown(eye, "agentview", 0) == clean).all(), "upright"
    with pytest.raises(BadConfig, match="must be square"):
        film.strip(take, 1, SIZE, SIZE // 2)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["perturb=wrist_camera@1"], "affects wrist cameras, and none is observed"),
        (["perturb=wrench_noise@1"], "affects streams of wrench, and none is observed"),
        (["perturb=table_texture@1", "look=plain"], "shows in look=room, not in plain"),
        (["perturb=payload@1"], "payload changes what happens: a film replays what an arm has done"),
        (["perturb=blurr@1"], "did you mean 'blur'?"),
        (["perturb=blur@1", "perturb_seed=-1"], "perturb_seed = -1; it must be at least 0"),
    ],
)
def test_what_a_film_does_not_show_is_refused(words, says, tmp_path, capsys):
    target = tmp_path / "film.png"
    assert cli.run(["show", "film", f"pool={REFERENCE}", "id=8ed4", f"to={target}", *words]) == 2
    assert says in " ".join(capsys.readouterr().err.split()) and not target.exists()


def test_a_film_prints_the_instruction(tmp_path, capsys):
    words = [f"to={tmp_path / 'film.png'}", "frames=1", "width=32", "height=32", "perturb=foreign@1"]
    assert cli.run(["show", "film", f"pool={REFERENCE}", "id=8ed4", *words]) == 0
    assert "the instruction is: Kipp den ersten" in capsys.readouterr().out


@pytest.mark.parametrize("films", ["false", "true"])
def test_contact_sheets_and_strips_have_the_requested_look(films, tmp_path, capsys):
    pages = {look: tmp_path / f"{look}.html" for look in ("room", "plain")}
    for look, page in pages.items():
        words = ["images=1", f"films={films}", f"to={page}", f"look={look}"]
        assert cli.run(["show", f"pool={REFERENCE}", *words]) == 0
    assert pages["room"].stat().st_size != pages["plain"].stat().st_size
    assert cli.run(["show", f"pool={REFERENCE}", "look=rom"]) == 2
    assert "no look named 'rom' (did you mean 'room'?)" in capsys.readouterr().err
