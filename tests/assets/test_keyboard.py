"""A finger tip that comes down in the middle of a key touches that key and no other."""

import mujoco
import numpy as np
import pytest
from helpers import anywhere
from hypothesis import given, settings

from scengen.assets.keyboard import LETTERS, Keyboard
from scengen.assets.prop import TABLE_TOP, place, table

TIP = np.array([0.013, 0.0105])
"""Half of the closed finger tips: 26 mm along the closing direction, 21 mm across [m]."""


def pressed(keyboard, spot):
    """The keys that closed finger tips touch, which stand on the keyboard with their middle over a place."""
    scene = table()
    place(scene, keyboard, "keyboard", [0, 0, TABLE_TOP], free=False)
    tip = scene.worldbody.add_body(name="tip", pos=[spot[0], spot[1], TABLE_TOP + keyboard.height + 0.0199])
    tip.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[*TIP, 0.02])
    tip.add_freejoint()
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    touched = {model.body(int(model.geom_bodyid[g])).name for pair in data.contact.geom for g in pair} - {
        "tip",
        "world",
    }
    return {name.removeprefix("keyboard/key_") for name in touched}


@pytest.mark.parametrize("letter", LETTERS)
def test_a_press_on_a_key_touches_it_alone(letter):
    assert pressed(Keyboard(), Keyboard().at(letter)) == {letter}


@pytest.mark.parametrize(("aside", "keys"), [(0.0115, {"G"}), (0.0155, {"F", "G"})])
def test_a_press_that_drifts_touches_the_neighbour_once_it_is_off_by_its_distance(aside, keys):
    """Pitch - half a cap - half a tip = 40 - 15 - 10.5 = 14.5 mm across."""
    assert pressed(Keyboard(), Keyboard().at("G") + np.array([0, aside, 0])) == keys


@given(keyboard=anywhere(Keyboard))
@settings(max_examples=20, deadline=None)
def test_every_place_over_a_cap_has_its_letter(keyboard):
    for letter in LETTERS:
        for corner in ((-1, -1), (1, 1)):
            assert keyboard.under(keyboard.at(letter) + 0.49 * keyboard.cap * np.array([*corner, 0])) == letter
    spots = np.array([keyboard.at(letter) for letter in LETTERS])
    assert np.all(np.abs(spots[:, :2]) + keyboard.cap / 2 <= keyboard.size[:2] / 2 + 1e-9)
    gap = np.abs(spots[:, None, :2] - spots[None, :, :2]).max(axis=2) + np.eye(len(spots))
    assert gap.min() >= keyboard.cap - 1e-9


def test_the_rows_are_those_of_a_typewriter():
    keyboard = Keyboard()
    assert keyboard.at("Q")[1] > keyboard.at("P")[1] and keyboard.at("Q")[0] > keyboard.at("A")[0] > keyboard.at("Z")[0]
    assert keyboard.at("A")[1] == pytest.approx((keyboard.at("Q")[1] + keyboard.at("W")[1]) / 2)
    assert keyboard.under(keyboard.at("Q") + np.array([0, 0.02, 0])) is None
    for wrong in ("q", "QW", "", "1"):
        with pytest.raises(ValueError, match="no key named"):
            keyboard.at(wrong)
