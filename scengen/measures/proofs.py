"""Proofs that a perturbation leaves the physics alone, changes what is perceived, and hides nothing that matters."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..envs.object_state import ObjectState
from ..envs.observations import Stream, cameras_of, privileged, streams_of
from ..episode import Actions, Episode
from ..look.looks import ROOM
from ..orientation import Orientation
from ..perturb.effects import PICTURES
from ..perturb.perturbation import LEVELS, Drawn, Kind, Perturbation, affects, stream_kind
from ..pictures.render import Camera, Picture
from ..pictures.views import things
from ..scenario import Scenario
from ..sim.world import World

SIZE = 128
"""Edge of the pictures that are compared [pixels]."""
MOMENTS = 4
"""Number of moments of the witness at which pictures and readings are compared, from the start to the end."""
MIN_CHANGE = 1.0
"""Least mean difference of a picture, over pixels and channels, in the moment at which it is largest [grey levels]."""
MIN_READING_CHANGE = 1e-4
"""Least largest difference of a reading, in the moment at which it is largest [m, rad, N]."""
MIN_PIXELS = 8
"""Least number of pixels of a body in one camera, if that many show it in the clean picture of some camera."""
MIN_SHARE = 0.25
"""Least share of the clean pixels of a body that the camera with most of them keeps."""
DARK = 64
"""Grey level below which a pixel of a white picture is covered."""
SEEN = ("light_", "cam_", "geom_rgba", "mat_", "site_rgba", "tex_", "vis")
"""Beginnings of the names of what pictures alone use in a compiled scene."""

Ids = Mapping[str, NDArray[np.int32]]
"""Number of the body in each pixel, by camera."""


@dataclass(frozen=True)
class Proof:
    """What was found of one kind at one level in one scenario."""

    neutral: bool
    """Whether the compiled scene differs only in what pictures alone use, and the witness ends in the same bits."""
    changes: Mapping[str, float]
    """Largest change of each camera or stream that the kind affects, over the moments."""
    hidden: tuple[str, ...]
    """Bodies that no camera keeps in sight at a moment at which clean pictures show them."""

    def faults(self) -> Iterator[str]:
        """What is not proved."""
        if not self.neutral:
            yield "the physics differs"
        limit = {True: MIN_CHANGE, False: MIN_READING_CHANGE}
        for name, change in self.changes.items():
            if change < limit["rgb" in name]:
                yield f"{name} changes by {change:.2g} only"
        if not self.changes:
            yield "it changes nothing"
        for body in self.hidden:
            yield f"{body} is out of sight"


class Stage:
    """A scenario with its witness, on which perturbations are tried one after the other."""

    def __init__(self, scenario: Scenario, scene_xml: str, embodiment: str, witness: Actions):
        self.scenario, self.scene_xml, self.embodiment, self.witness = scenario, scene_xml, embodiment, witness
        self.world = World.load(scene_xml, embodiment, ROOM)
        self.cameras = cameras_of(embodiment)
        self.streams: dict[str, Stream] = streams_of(embodiment)
        self.eye = Camera(self.world, SIZE, SIZE)
        self.states, self.digest = self._played()
        self.clean = [self._pictures(None, number) for number in range(MOMENTS)]
        self.ids = [self._ids(number) for number in range(MOMENTS)]
        self.shown = [self._counts(ids) for ids in self.ids]

    def close(self) -> None:
        self.eye.close()

    def proof(self, kind: Kind, level: int) -> Proof:
        """Try a kind at a level."""
        drawn = Perturbation(((kind.name, level),)).of(self.scenario.id, bodies=self.world.free_bodies)
        with drawn.while_applied(self.world.model) as changed:
            neutral = all(name.startswith(SEEN) for name in changed)
            if kind.effect.reads != PICTURES:
                return Proof(neutral, self._reading_changes(kind, drawn), ())
            seen = [name for name, camera in self.cameras.items() if affects(kind.effect, camera)]
            moved = any(name.startswith("cam_") for name in changed)
            changes, hidden = dict.fromkeys(seen, 0.0), set[str]()
            for number in range(MOMENTS):
                for name, picture in self._pictures(drawn, number, seen).items():
                    far = np.abs(picture.astype(float) - self.clean[number][name]).mean()
                    changes[name] = max(changes[name], float(far))
                ids = self._ids(number) if moved else self.ids[number]
                hidden |= self._lost(self.shown[number], self._counts(self._uncovered(drawn, ids)))
            if level == LEVELS:
                neutral = neutral and self._played()[1] == self.digest
        return Proof(neutral, changes, tuple(sorted(hidden)))

    def _played(self) -> tuple[list[NDArray[np.float64]], str]:
        """States at the moments of the witness, and the hash of the last one."""
        self.world.reset()
        episode, at = Episode(self.scenario, self.world), np.linspace(0, len(self.witness), MOMENTS).astype(int)
        states = [self.world.state()] if at[0] == 0 else []
        for number, action in enumerate(self.witness, 1):
            episode.step(action)
            states += [self.world.state()] * int((at == number).sum())
        return states, self.world.digest

    def _pictures(self, drawn: Drawn | None, number: int, names: Iterable[str] | None = None) -> dict[str, Picture]:
        """Pictures of some cameras at a moment, by default of all."""
        self.world.restore(self.states[number])
        period = round(self.world.time / Loop.PERIOD)
        chosen = self.cameras if names is None else names
        found = {name: self.eye.take(self.cameras[name]).copy() for name in chosen}
        if drawn is None:
            return found
        return {name: drawn.on_picture(picture, self.cameras[name], period) for name, picture in found.items()}

    def _ids(self, number: int) -> Ids:
        """Number of the body in each pixel of each camera at a moment."""
        self.world.restore(self.states[number])
        return {name: self.eye.bodies(camera) for name, camera in self.cameras.items()}

    def _uncovered(self, drawn: Drawn, ids: Ids) -> Ids:
        """The same without pixels that would be dark in a white picture."""
        white = np.full((SIZE, SIZE, 3), 255, np.uint8)
        covered = {n: (drawn.on_picture(white, camera, 0) < DARK).all(axis=2) for n, camera in self.cameras.items()}
        return {name: np.where(covered[name], -1, seen) for name, seen in ids.items()}

    def _counts(self, ids: Ids) -> dict[str, dict[str, int]]:
        """Number of pixels of each body of the scene in each camera."""
        model, found = self.world.model, dict[str, dict[str, int]]()
        bodies = np.unique(model.geom_bodyid[things(self.world)])
        for name, seen in ids.items():
            shown, counts = np.unique(seen[np.isin(seen, bodies)], return_counts=True)
            found[name] = {model.body(b).name: c for b, c in zip(shown.tolist(), counts.tolist(), strict=True)}
        return found

    @staticmethod
    def _lost(clean: Mapping[str, Mapping[str, int]], now: Mapping[str, Mapping[str, int]]) -> set[str]:
        """Bodies that too few pixels show, of those that clean pictures show."""
        most = {body: max(c.get(body, 0) for c in clean.values()) for counts in clean.values() for body in counts}
        kept = {body: max(c.get(body, 0) for c in now.values()) for body in most}
        return {b for b, count in most.items() if count >= MIN_PIXELS and kept[b] < max(MIN_PIXELS, MIN_SHARE * count)}

    def _reading_changes(self, kind: Kind, drawn: Drawn) -> dict[str, float]:
        """Largest change of each stream that a kind affects."""
        changes = dict[str, float]()
        for name, stream in self._all_streams().items():
            if stream_kind(name) != kind.effect.reads or stream.grid:
                continue
            for state in self.states:
                self.world.restore(state)
                period, reading = round(self.world.time / Loop.PERIOD), np.asarray(stream.read(self.world), float)
                far = np.abs(drawn.on_reading(name, stream.entries(name), reading.copy(), period) - reading)
                changes[name] = max(changes.get(name, 0.0), float(far.max()))
        return changes

    def _all_streams(self) -> Mapping[str, Stream]:
        state = ObjectState(dict.fromkeys(self.world.free_bodies, True), len(self.world.arms))
        return {**self.streams, **privileged(state, type(self.scenario), Orientation)}
