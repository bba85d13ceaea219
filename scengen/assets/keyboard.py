"""A keyboard with the letters of a QWERTY layout. Each cap is a separate body, so that contacts identify the key."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from ..geometry import Vec3
from ..params import param
from .glyph import write
from .prop import Prop, Rgba, show, solid

ROWS = ("QWERTYUIOP", "ASDFGHJKL", "ZXCVBNM")
"""Letters of each row, from the far row to the near one."""
LETTERS = "".join(ROWS)
"""All letters."""
STAGGER = 0.5
"""Shift of each row against the row behind it, as a share of the pitch."""
PLATE_THICKNESS = 0.004
"""Thickness of the plate that carries the caps [m]."""
CAP_MASS = 0.01
"""Mass of a cap [kg]."""
PRINT_SIZE = 0.55
"""Height of the letters, as a share of the edge of a cap."""
STROKE_HALF_WIDTH = 0.0007
"""Half the width of the strokes of the letters [m]."""
LETTER_COLOUR: Rgba = (0.62, 0.62, 0.62, 1.0)
"""Colour of the letters."""


@dataclass(frozen=True, kw_only=True)
class Keyboard(Prop):
    """A keyboard that reads along +x: Q is far and left, at +x and +y. The origin is the middle of the plate's base.

    Paper, App. C: "virtual QWERTY keyboard with per-key contact triggers". It gives no lengths. Closed finger tips, 21
    mm wide and 26 mm long, that press the middle of a cap are 12 mm away from the neighbouring caps.
    """

    pitch: float = param(0.040, "m", 0.030, 0.050)
    """Distance between neighbouring caps of a row, and between neighbouring rows."""
    cap: float = param(0.030, "m", 0.015, 0.030)
    """Edge of a cap."""
    height: float = param(0.012, "m", 0.006, 0.030)
    """Height of the caps' upper faces above the ground."""
    friction: float = param(0.6, "1", 0.05, 1.5)
    mass: float = param(0.3, "kg", 0.1, 2.0)
    """Mass of the plate. Typewriter keyboards without their caps weigh 0.3 to 1.2 kg."""
    rgba: Rgba = (0.86, 0.86, 0.84, 1.0)

    @cached_property
    def size(self) -> Vec3:
        """Edges of the plate along x and y, and total height [m]."""
        return np.array([len(ROWS) * self.pitch, (len(ROWS[0]) + 0.5) * self.pitch, self.height])

    def at(self, letter: str) -> Vec3:
        """Middle of a cap's upper face, in the keyboard's axes [m].

        Raises:
            ValueError: it is not a capital letter.
        """
        if len(letter) != 1 or letter not in LETTERS:
            raise ValueError(f"no key named {letter!r}; known: {LETTERS}")
        row = next(i for i, letters in enumerate(ROWS) if letter in letters)
        along = ROWS[row].index(letter) + STAGGER * row - (len(ROWS[0]) - 1) / 2
        return np.array([(1 - row) * self.pitch, -along * self.pitch, self.height])

    def outside(self, offset: Vec3) -> float:
        """Distance of a place beyond the outline, seen from above; `offset` is in the keyboard's axes [m]."""
        return float((np.abs(offset) - self.size / 2)[:2].max())

    def under(self, spot: Vec3) -> str | None:
        """Letter of the cap below a point, which is in the keyboard's axes [m]; None between caps."""
        over = [letter for letter in LETTERS if np.all(np.abs(spot[:2] - self.at(letter)[:2]) <= self.cap / 2)]
        return over[0] if over else None

    def fill(self, body: mujoco.MjsBody, spec: mujoco.MjSpec) -> None:
        x, y, _ = self.size / 2
        thick, rise = PLATE_THICKNESS / 2, (self.height - PLATE_THICKNESS) / 2
        below: Rgba = (0.2, 0.2, 0.22, 1.0)
        solid(body, "plate", [x, y, thick], [0, 0, thick], friction=self.friction, mass=self.mass, rgba=below)
        for letter in LETTERS:
            key = body.add_body(name=f"key_{letter}", pos=self.at(letter).tolist())
            size, pos = [self.cap / 2, self.cap / 2, rise], [0, 0, -rise]
            solid(key, f"cap_{letter}", size, pos, friction=self.friction, mass=CAP_MASS, rgba=self.rgba)
            write(
                key, letter, [0.0, 0.0, 0.0], PRINT_SIZE * self.cap, STROKE_HALF_WIDTH, LETTER_COLOUR, f"print_{letter}"
            )


def disable(scene: mujoco.MjSpec, keyboard: str, letter: str) -> None:
    """Let a key of a keyboard in a scene give way: nothing touches it."""
    cap = scene.geom(f"{keyboard}/cap_{letter}")
    cap.contype = cap.conaffinity = 0


if __name__ == "__main__":
    show(Keyboard())
