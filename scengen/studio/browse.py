"""Browsing: a scenario next to its training twin, its certificate, and its witness and shortcuts played in 3-D."""

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from ..errors import ScengenError
from ..geometry import Vec3
from ..look.looks import ROOM
from ..pictures import film
from ..pictures.page import template
from ..pictures.shared_view import twin_scene
from ..pictures.sheet import moved
from ..pool import Pool, PoolRow
from ..samplers.task import Task
from ..sim.world import World
from ..validate.playable import check_row, stored_world
from ..validate.words import lines
from .player import Player
from .scene import FAULTS, SceneView, filmed, one_line
from .seen import Seen

TWIN_OFFSET: Vec3 = np.array([0.0, 1.4, 0.0])
"""Position of the training twin, at the side of the scenario [m]: the table is 0.8 m wide."""
LABEL_OFFSET: Vec3 = np.array([0.0, 1.4, 1.3])
"""Position of the label of the training twin [m], above its table."""
FIELD_OF_VIEW = np.radians(45.0)
"""Vertical angle of the camera [rad]: that of MuJoCo's viewer."""
CAMERA: Vec3 = np.array([1.6, -1.25, 1.9])
"""Position of the camera for one scenario [m]: above the free corner of the table."""
LOOK_AT: Vec3 = np.array([-0.12, 0.0, 0.92])
"""Point that it looks at [m]."""
CAMERA_FOR_TWO: Vec3 = np.array([2.9, 0.7, 2.2])
"""Position of the camera for a scenario and its twin [m]."""
LOOK_AT_FOR_TWO: Vec3 = np.array([-0.1, 0.7, 0.9])
"""Point that it looks at [m]."""


@dataclass(frozen=True)
class Shelf:
    """Pools that can be browsed, each with its task as it was when the pool was made."""

    pools: Sequence[Pool]
    tasks: Mapping[str, Task]
    """Tasks by the folders of the pools."""
    search: tuple[str, ...] = ()
    """Overrides that add folders of other packages, see `task_files.search_path`."""

    def label(self, number: int) -> str:
        """Name of a pool for people."""
        pool = self.pools[number]
        task = self.tasks[str(pool.folder)]
        return f"{number + 1}. {task.code} {task.name} / {pool.split} ({len(pool)})"


def longest_shortcut(row: PoolRow) -> str:
    """The shortcut that lasts longest before it fails, by the certificate; empty if none was tried."""
    checks = [check for check in row.certificate.checks if check.name == "shortcuts"]
    lasted = {}
    for name, tried in (checks[0].numbers if checks else {}).items():
        seconds = tried.get("filtered", {}).get("seconds") if isinstance(tried, Mapping) else None
        lasted[name] = float(seconds) if isinstance(seconds, (int, float)) else 0.0
    return max(lasted, key=lasted.__getitem__, default="")


class Browser:
    """The tab with which one person looks at scenarios."""

    def __init__(self, client: viser.ClientHandle, shelf: Shelf):
        self._client, self._shelf, self._busy = client, shelf, threading.RLock()
        self._view, self._twin = SceneView(client.scene, "/scene"), SceneView(client.scene, "/twin")
        self._row: PoolRow | None = None
        self._shown = ("", -1)
        """Folder and place of the scenario that is shown."""
        self._world: World | None = None
        gui = client.gui
        labels = [shelf.label(number) for number in range(len(shelf.pools))]
        self._pool = gui.add_dropdown("pool", labels)
        self._place = gui.add_number("scenario", 1, min=1, max=max(1, len(shelf.pools[0])), step=1)
        self._find = gui.add_text("find id", "")
        self._missing = gui.add_html("")
        self._steps = gui.add_button_group("", ("previous", "next"))
        self._beside = gui.add_checkbox("training twin", True)
        self._what: viser.GuiDropdownHandle[str] = gui.add_dropdown("play", [str(film.WITNESS)])
        self.player = Player(client, self._view)
        """The controls of the film."""
        self.seen = Seen(client, shelf.search)
        """What a policy sees."""
        self._about = gui.add_html("")
        self._label: viser.LabelHandle | None = None
        self._sight = CAMERA
        """Position that the camera was sent to last."""
        self._pool.on_update(lambda _: self._turned_to(1))
        self._place.on_update(lambda _: self._run(self._show))
        self._steps.on_click(lambda event: self.step(1 if event.target.value == "next" else -1))
        self._find.on_update(lambda _: self._run(self._found))
        self._beside.on_update(lambda _: self._run(self._show_twin))
        self._what.on_update(lambda event: self._run(self._play) if event.client is not None else None)
        self._run(self._show)

    @property
    def pool(self) -> Pool:
        """The chosen pool."""
        return self._shelf.pools[self._pool.options.index(self._pool.value)]

    @property
    def task(self) -> Task:
        """Its task."""
        return self._shelf.tasks[str(self.pool.folder)]

    def step(self, by: int) -> None:
        """Go to the next scenario, or to the previous one."""
        self._turned_to(min(max(1, int(self._place.value) + by), len(self.pool)))

    def close(self) -> None:
        self.player.close()
        self.seen.close()

    def _turned_to(self, place: int) -> None:
        self._place.max = max(1, len(self.pool))
        if int(self._place.value) == place:
            self._run(self._show)
        else:
            self._place.value = place

    def _run(self, work: Callable[[], None]) -> None:
        """Do some work after the previous one; show a fault on the page."""
        with self._busy:
            try:
                work()
            except FAULTS as error:
                self.player.unload()
                self._about.content = template("studio_fault.html").render(fault=one_line(error))

    def _show(self) -> None:
        """Show the chosen scenario, with its witness ready to be played."""
        place = int(self._place.value) - 1
        if self._shown == (str(self.pool.folder), place):
            return
        self._shown = (str(self.pool.folder), place)
        self.player.unload()
        self.seen.show(None)
        self._row = self._world = None  # if anything below fails, the page shows nothing of another scenario
        with self._client.atomic():
            self._view.clear()
            self._twin.clear()
        row = self.pool.at(place)
        best = longest_shortcut(row)
        self._about.content = self._description(row, best)  # what is read is shown before what is simulated
        self.player.outcome.content = template("studio_fault.html").render(note="trying the scene ...")
        check_row(row)
        self._row, self._world = row, stored_world(row, look=ROOM)
        with self._client.atomic():
            self._view.show(self._world)
        scenario = self.task.scenario(row.params)
        shortcuts = scenario.shortcuts()
        self._what.options = (film.WITNESS, *sorted(shortcuts, key=lambda name: name != best))
        self._what.value = film.WITNESS
        self._show_twin()
        self._play(play=False)
        self.seen.show(row, scenario)

    def _show_twin(self) -> None:
        """Show or hide the training twin, which a scenario of training does not have."""
        row = self._row
        with self._client.atomic():
            self._twin.clear()
            if self._label is not None:
                self._label.remove()
                self._label = None
            if row is None or not row.shifted or not self._beside.value:
                self._look(CAMERA, LOOK_AT)
                return
            self._look(CAMERA_FOR_TWO, LOOK_AT_FOR_TWO)
            world = World.load(twin_scene(self.pool, self.task, row), self.task.embodiment, look=ROOM)
            self._twin.show(world, TWIN_OFFSET, robot=False, room=False)
            self._label = self._client.scene.add_label("/twin_label", "training twin", position=LABEL_OFFSET)

    def _look(self, position: Vec3, target: Vec3) -> None:
        """Move the camera, unless it is there already, so that a view that a person has turned to stays."""
        if self._sight is not position:
            self._sight = position
            self._client.camera.position, self._client.camera.look_at = position, target

    def _play(self, play: bool = True) -> None:
        """Load the film of what was chosen."""
        row, world = self._row, self._world
        if row is None or world is None:
            return
        scenario, name = self.task.scenario(row.params), str(self._what.value)
        self.player.outcome.content = template("studio_fault.html").render(note="computing ...")
        if name == film.WITNESS:
            actions, horizon = row.witness, row.horizon
        else:
            take, _ = film.shortcut(row, scenario, name)
            actions, horizon = take.actions, 3.0 * row.horizon
        made = filmed(world, scenario, actions, horizon)
        self.player.load(made, play)
        self.player.outcome.content = template("studio_fault.html").render(note=f"{name}: {made.outcome}")

    def _found(self) -> None:
        """Go to the scenario of an id or name. If there is none, a line says so, and the page stays as it is."""
        text, told = str(self._find.value).strip(), ""
        if text:
            pool = self.pool
            try:
                self._place.value = pool.directory.find(text, pool.name_at, str(pool.folder)) + 1
            except ScengenError as error:
                told = one_line(error)
        self._missing.content = template("studio_fault.html").render(fault=told)

    def _description(self, row: PoolRow, best: str) -> str:
        """Description of the scenario with units; texts of the pool are escaped."""
        task, sampler = self.task, self.pool.manifest.config.sampler
        words = [f"task={row.task}", f"split={row.split}", f"seed={row.seed}", f"index={row.index}"]
        if sampler != "iid":
            words.insert(2, f"sampler={sampler}")
        values: dict[str, Any] = {
            "row": row,
            "task": task,
            "moved": [moved(task, name, value) for name, value in row.shifted.items()],
            "params": [(task.known[name], value) for name, value in row.params.items() if name in task.known],
            "lines": list(lines(row.certificate.checks)),
            "command": f"scengen try {' '.join(words)} film=try.mp4",
            "best": best,
        }
        return template("studio_scenario.html").render(values)
