"""Memory: named numbers in MuJoCo's user data that record an episode's history.

The numbers are part of MuJoCo's integration state: zero after a reset; saved, restored and replayed with everything
else; and the same for every program that steps the model. Their names are in the scene, so that a world can read them
without its task.
"""

from collections.abc import Callable

import mujoco

from ..errors import UnknownName

TEXT_NAME = "memory"
"""Name of the scene's custom text that holds the names."""


def remember(scene: mujoco.MjSpec, *names: str) -> None:
    """Give a scene its memory: one number for each name, all 0 at the start."""
    scene.nuserdata = len(names)
    scene.add_text(name=TEXT_NAME, data=" ".join(names))


class Memory:
    """Numbers of one simulation by name."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, check: Callable[[], None]):
        """Read the names from the model.

        Args:
            model: the compiled scene.
            data: its simulation, whose user data hold the numbers.
            check: called before every write; it raises if writing is not allowed now.
        """
        self.names = _names(model)
        """Names in the order of the user data."""
        self._numbers, self._check = data.userdata, check
        self._index = {name: number for number, name in enumerate(self.names)}

    def __getitem__(self, name: str) -> float:
        return self._numbers.item(self._at(name))

    def __setitem__(self, name: str, value: float) -> None:
        self._check()
        self._numbers[self._at(name)] = value

    def _at(self, name: str) -> int:
        """Index of a name in the user data."""
        try:
            return self._index[name]
        except KeyError:
            raise UnknownName("memory", name, self.names) from None


def _names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of a model's memory, in the order of the user data."""
    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, TEXT_NAME)
    if text == -1:
        return ()
    first, size = model.text_adr[text], model.text_size[text]
    return tuple(model.text_data[first : first + size - 1].decode().split())
