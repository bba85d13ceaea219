"""A display behind a keyboard that shows a word: faint letters until they are typed, then bold ones in their place."""

from collections.abc import Callable

import mujoco
import numpy as np

from ..geometry import UP, Vec3, quat
from ..sim.world import World
from .glyph import write
from .keyboard import PRINT_SIZE, Keyboard
from .prop import Rgba, place, shown

LETTER_HEIGHT = 0.024
"""Height of the letters on the display [m]."""
LETTER_SPACING = 0.030
"""Distance between the middles of letters on the display [m]."""
DISTANCE = 0.035
"""Distance of the display's middle behind the keyboard [m]."""
COLOURS: tuple[tuple[Rgba, Rgba, Rgba], ...] = (
    ((1.0, 0.80, 0.55, 1.0), (0.96, 0.66, 0.38, 1.0), (0.70, 0.25, 0.0, 1.0)),
    ((0.70, 0.82, 1.0, 1.0), (0.48, 0.66, 1.0, 1.0), (0.0, 0.10, 0.55, 1.0)),
)
"""Colours of a cap, of a faint and of a bold letter, by owner: another robot's, the agent's."""


def place_with_display(
    scene: mujoco.MjSpec,
    keyboard: Keyboard,
    name: str,
    pos: Vec3,
    yaw: float,
    word: str,
    is_own: Callable[[int], bool],
) -> None:
    """Add a keyboard with a display that shows a word to a scene, and colour the caps of the word's letters.

    Bold letters wait below the table top until `show_typed` shows them.

    Args:
        scene: the scene.
        keyboard: the keyboard.
        name: name of the keyboard's body.
        pos: position of the keyboard [m].
        yaw: yaw of the keyboard [rad].
        word: the word.
        is_own: function that says whether a place of the word is the agent's. The key of a letter that is twice in the
            word shows the first owner.
    """
    place(scene, keyboard, name, pos, yaw)
    plate, count, turn = scene.body(name), len(word), quat("z", yaw)
    half = [LETTER_HEIGHT, LETTER_SPACING * count / 2, 0.0005]
    shown(plate, "display", (0.97, 0.97, 0.95, 1.0), size=half, pos=_spot(keyboard, count, (count - 1) / 2))
    hidden = pos - 0.03 * UP
    for k, letter in reversed(list(enumerate(word))):
        cap, faint, bold = COLOURS[is_own(k)]
        scene.geom(f"{name}/cap_{letter}").rgba = np.array(cap, np.float32)
        write(plate, letter, _spot(keyboard, count, k), LETTER_HEIGHT, 0.0010, faint, f"faint_{k}")
        typed = scene.worldbody.add_body(name=f"typed_{k}", mocap=True, pos=hidden.tolist(), quat=turn)
        spots = (_spot(keyboard, count, k), LETTER_HEIGHT), (keyboard.at(letter), PRINT_SIZE * keyboard.cap)
        for spot, height in spots:  # 0.3 mm before the faint letters, their strokes twice as wide
            write(typed, letter, spot + 0.0003 * UP, height, 0.0020, bold, f"bold_{height:.3f}_{k}")


def show_typed(world: World, body: str, count: int) -> None:
    """Show the first letters of the word bold at the current place of the keyboard. For `events`."""
    keyboard = world.body(body)
    for k in range(count):
        world.move(f"typed_{k}", world.data.xpos[keyboard], world.data.xquat[keyboard])


def _spot(keyboard: Keyboard, count: int, k: float) -> Vec3:
    """Position of a place of a word of `count` letters on the display, in the keyboard's axes [m]."""
    return np.array([keyboard.size[0] / 2 + DISTANCE, LETTER_SPACING * ((count - 1) / 2 - k), 0.001])
