"""Memory: what has happened in an episode, as named numbers in MuJoCo's user data.

They are part of MuJoCo's integration state: zero after a reset, saved, restored and replayed with everything else, and
the same for whoever steps the model. Their names stand in the scene, so that a world needs no task to read them.
"""

from collections.abc import Callable

import mujoco

from ..errors import UnknownName

KEY = "memory"
"""Name of the scene's custom text that holds the names."""


def remember(scene: mujoco.MjSpec, *names: str) -> None:
    """Give a scene its memory: one number for each name, all 0 at the start."""
    scene.nuserdata = len(names)
    scene.add_text(name=KEY, data=" ".join(names))


class Memory:
    """The numbers of one simulation by name."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, check: Callable[[], None]):
        """`check`: called before anything is written; raises if nothing may be."""
        self.names = _names(model)
        """In the order of the user data."""
        self._data, self._check = data, check

    def __getitem__(self, name: str) -> float:
        return float(self._data.userdata[self._place(name)])

    def __setitem__(self, name: str, value: float) -> None:
        self._check()
        self._data.userdata[self._place(name)] = value

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise UnknownName("memory", name, self.names)
        return self.names.index(name)


def _names(model: mujoco.MjModel) -> tuple[str, ...]:
    text = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_TEXT, KEY)
    if text == -1:
        return ()
    first, size = model.text_adr[text], model.text_size[text]
    return tuple(model.text_data[first : first + size - 1].decode().split())
