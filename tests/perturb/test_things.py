"""Colours and textures of things change where no text names them, and whatever they become, things stay apart."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

from scengen.agents import facts
from scengen.compose import load_task
from scengen.errors import BadConfig
from scengen.look.colour import CHROMATIC, chroma, lab, turn
from scengen.look.looks import ROOM
from scengen.perturb.distractors import with_spares
from scengen.perturb.drawn import arrays
from scengen.perturb.kinds import LEVELS, kind_of
from scengen.perturb.language import WORDINGS, Words, free_bodies
from scengen.perturb.perturbation import Perturbation
from scengen.perturb.things import APART, EDGE, FACES, OTHER_HUE, PRINT, free_geoms
from scengen.sim.world import World, scene_geoms
from scengen.validate.rebuilt import rebuild

TASKS = sorted(path.stem for path in (Path(__file__).parents[2] / "conf" / "things").glob("*.yaml"))
NAMES = r"\b(red|green|blue|yellow|orange|white|black|gr[ae]y|brown|pink|purple|violet|(dark|light)(er)?|steel)\b"
"""Words for a look."""
GOALS = ("look_mat", "look_marked", "look_print")
"""Finishes of goals, marks and texts."""
SEEDS = range(4)


def loaded(name):
    task = load_task(name)
    return World.load(rebuild(task.draw("id", 0, 0).scenario), task.embodiment, with_spares(ROOM)).model


def words_of(name):
    return Words.of(name, load_task(name).instruction)


def drawn(name, kind, level=LEVELS, seed=0, further=()):
    return Perturbation(((kind, level), *further)).of("a", seed, words=words_of(name))


@pytest.mark.parametrize("name", TASKS)
def test_only_bodies_whose_look_no_text_names_are_listed(name):
    model, words, sheet = loaded(name), words_of(name), facts.load(load_task(name))
    free = free_geoms(model, words.free)
    bodies = {model.body(model.geom_bodyid[geom]).name for geom in free}
    for pattern in words.free:
        assert free_geoms(model, [pattern]), f"{pattern} names no body"
    told = [sheet.name_of(body) for body in bodies]
    assert not [text for text in told if text and re.search(NAMES, text)]
    assert not {model.mat(model.geom_matid[geom]).name for geom in free} & {*GOALS}
    texts = [words.instruction, *(text for kind in WORDINGS[:3] for text in words.wordings[kind])]
    nouns = {text.split()[-1] for text in told if text}
    phrases = {found[0] for text in texts for noun in nouns for found in re.finditer(rf"{NAMES} {noun}\b", text)}
    kept = {model.body(number).name for number in range(model.nbody)} - bodies
    assert phrases <= {sheet.name_of(body) for body in kept}, "the red block among other blocks"


@pytest.mark.parametrize("name", TASKS)
def test_things_stay_apart_from_others_and_take_no_hue_of_theirs(name):
    model, kind = loaded(name), kind_of("thing_colour")
    every = free_geoms(model, words_of(name).free)
    before = model.geom_rgba.copy()
    free = one_of_each(before, every)
    others = one_of_each(before, [geom for geom in things_of(model) if geom not in every])
    stored, far = lab(before[:, :3]), []
    for seed, level in itertools.product(SEEDS, range(1, LEVELS + 1)):
        with drawn(name, kind.name, level, seed).while_applied(model) as changed:
            assert changed.keys() <= {"geom_rgba"} and {*changed["geom_rgba"]} <= {*every}
            assert len({tuple(model.geom_rgba[geom]) for geom in every}) == len(free), "things of one colour stay alike"
            now = lab(model.geom_rgba[:, :3])
            for one, other in itertools.chain(itertools.product(free, others), itertools.combinations(free, 2)):
                was, away = (np.linalg.norm(each[one] - each[other]) for each in (stored, now))
                assert away > min(APART, was) - 0.7, (one, other)
            for one, other in itertools.product(free, others):
                if min(chroma(now[one]), chroma(now[other])) >= CHROMATIC:
                    was = turn(stored[one], stored[other]) if chroma(stored[one]) >= CHROMATIC else OTHER_HUE
                    assert turn(now[one], now[other]) > min(OTHER_HUE, was) - 2.0, "red is not orange"
            far.append(np.linalg.norm(now[free] - stored[free], axis=1).mean())
        assert (model.geom_rgba == before).all()
    assert (np.diff(np.reshape(far, (len(SEEDS), LEVELS)), axis=1) > 0).all(), "a higher level goes farther"


def one_of_each(rgba, geoms):
    """One geom of each colour."""
    return [*{tuple(rgba[geom, :3].round(3).tolist()): geom for geom in geoms}.values()]


def things_of(model):
    """Opaque or tinted geoms of things that pictures show, and the table."""
    shown = [geom for geom in scene_geoms(model) if model.geom_group[geom] < 3 and model.geom_rgba[geom, 3] > 0]
    return [*shown, model.geom("table_top").id]


@pytest.mark.parametrize("name", ["domino_single", "cup_extract", "packing"])
def test_a_print_is_on_things_alone_and_is_taken_off_again(name):
    model = loaded(name)
    free, stored = free_geoms(model, words_of(name).free), arrays(model)
    with drawn(name, "thing_texture").while_applied(model) as changed:
        assert {*changed} == {"geom_matid", "geom_rgba", "tex_data"}
        assert {*changed["geom_matid"]} == {*free} >= {*changed["geom_rgba"]}
        materials = {model.mat(model.geom_matid[geom]).name for geom in free}
        colours = {tuple(stored["geom_rgba"][geom].tolist()) for geom in free}
        assert len(materials) == len(colours) and all(each.startswith(PRINT) for each in materials)
        for geom in free:
            start = model.tex_adr[model.tex(model.mat(model.geom_matid[geom]).name).id]
            shades = {*map(tuple, model.tex_data[start : start + FACES * 3 * EDGE**2].reshape(-1, 3).tolist())}
            own = tuple((255 * stored["geom_rgba"][geom, :3].astype(float)).round().astype(int).tolist())
            near = [shade for shade in shades if np.abs(np.subtract(shade, own)).max() <= 1]
            assert len(near) == 1 and len(shades) == 2, "its colour and another one"
    assert all(array.tobytes() == stored[name].tobytes() for name, array in arrays(model).items())


@pytest.mark.parametrize("further", [("table_colour", 5), ("light_colour", 5)])
def test_a_thing_has_the_same_colour_with_any_other_kind(further):
    found = []
    for others in ((), (further,)):
        model = loaded("domino_single")
        drawn("domino_single", "thing_colour", further=others).on_model(model)
        found.append(model.geom_rgba[free_geoms(model, ["tile_*"])].copy())
        reverse = Perturbation((*others, ("thing_colour", LEVELS))).of("a", words=words_of("domino_single"))
        again = loaded("domino_single")
        reverse.on_model(again)
        assert (again.geom_rgba == model.geom_rgba).all()
    assert (found[0] == found[1]).all()


def test_a_task_without_such_things_is_refused():
    words = words_of("mirror_pick_place")
    for kind in ("thing_colour", "thing_texture"):
        says = "mirror_pick_place names no body whose look carries no meaning; if there is one, list it in conf/things/"
        with pytest.raises(BadConfig, match=says):
            Perturbation(((kind, 1),)).check_words(words)
        with pytest.raises(BadConfig, match=says):
            Perturbation(((kind, 1),)).of("a", words=words).on_model(loaded("mirror_pick_place"))


@pytest.mark.parametrize(
    "text", ["[box]", "bodies: box", "bodies: [1]", "bodies: [box]\nothers: [cup]", "bodies: {a: b}"]
)
def test_a_damaged_file_is_refused_in_one_line(text, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(BadConfig):
        free_bodies(path)


def test_colours_and_prints_of_the_same_things_are_refused():
    with pytest.raises(BadConfig, match="change the look of the same things: give one of them"):
        Perturbation.parse("thing_colour@1+thing_texture@1")


def test_things_of_an_unknown_task_are_refused():
    with pytest.raises(BadConfig, match="thing_colour: give words="):
        Perturbation.parse("thing_colour@1").of("a").on_model(loaded("domino_single"))


def test_another_colour_is_found_where_few_are_clear():
    """One colour of fifty is clear of the other things of this task."""
    model, words = loaded("seesaw_balance"), words_of("seesaw_balance")
    own = free_geoms(model, words.free)
    for seed in range(24):
        with drawn("seesaw_balance", "thing_colour", seed=seed).while_applied(model) as changed:
            assert {*own} <= {*changed["geom_rgba"].tolist()}, f"seed {seed} changes no colour"
