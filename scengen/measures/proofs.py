"""Proofs that a perturbation leaves the physics alone, changes what is perceived, and hides nothing that matters."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..envs.object_state import ObjectState, bodies_in_text
from ..envs.observations import Stream, cameras_of, privileged, streams_of
from ..episode import Actions, Episode
from ..look.looks import ROOM
from ..orientation import Orientation
from ..perturb.distractors import in_the_way, spares, visible, with_spares
from ..perturb.drawn import Drawn
from ..perturb.effects import LANGUAGE, PICTURES
from ..perturb.kinds import LEVELS, Kind, affects, stream_kind
from ..perturb.language import Words, leaks, other_words
from ..perturb.perturbation import Perturbation
from ..perturb.things import free_geoms
from ..pictures.perturbed import changed_by
from ..pictures.render import Camera, Picture
from ..pictures.views import things
from ..scenario import Scenario
from ..sim.world import World
from .distance import distance

SIZE = 128
"""Edge of the pictures that are compared [pixels]."""
MOMENTS = 4
"""Number of moments of the witness at which pictures and readings are compared, from the start to the end."""
MIN_CHANGE = 0.005
"""Least `distance` of a picture from the clean one, in the moment at which it is largest."""
MIN_READING_CHANGE = 1e-4
"""Least largest difference of a reading, in the moment at which it is largest [m, rad, N]."""
DRAWS = 64
"""Number of scenarios over which draws are compared."""
CLEARANCE = 0.005
"""Least distance of distractors from all that moves in the witness [m]."""
SWEEP = 5
"""Number of control periods between two moments at which that distance is checked."""
PASSING = 25
"""Number of control periods after a moment over which a kind is judged that changes some pictures only."""
MIN_PIXELS = 8
"""Least number of pixels of a body in one camera, if that many show it in the clean picture of some camera."""
MIN_SHARE = 0.25
"""Least share of the clean pixels of a body that the camera with most of them keeps."""
INSTRUCTION = "instruction"
"""Name of the text among the changes."""
DARK = 64
"""Grey level below which a pixel of a white picture is covered."""
SEEN = ("light_", "cam_", "geom_rgba", "geom_matid", "mat_", "site_rgba", "tex_", "vis")
"""Beginnings of the names of what pictures alone use in a compiled scene."""

PLACES = ("geom_type", "geom_size", "geom_pos", "geom_quat")
"""Names of what distractors change of spare geoms besides."""

Where = NDArray[np.bool_] | None
"""Pixels of a camera; None: all."""
Ids = Mapping[str, NDArray[np.int32]]
"""Number of the body in each pixel, by camera."""


@dataclass(frozen=True)
class Proof:
    """What was found of one kind at one level in one scenario."""

    neutral: bool
    """Whether the compiled scene differs only in what pictures alone use, and the witness ends in the same bits."""
    changes: Mapping[str, float]
    """Largest change of each camera or stream that the kind affects, over the moments; or share of other words."""
    hidden: tuple[str, ...] = ()
    """Bodies that no camera keeps in sight at a moment at which clean pictures show them."""
    leaks: tuple[str, ...] = ()
    """Names of what is shifted or hidden that the text has."""
    is_crossed: bool = False
    """Whether the witness comes close to a distractor."""
    touched: tuple[str, ...] = ()
    """Bodies that look different although a text, a rule or a goal may name their look."""

    def faults(self) -> Iterator[str]:
        """What is not proved."""
        if not self.neutral:
            yield "the physics differs"
        for name, change in self.changes.items():
            if change < (MIN_CHANGE if "rgb" in name else MIN_READING_CHANGE):
                yield f"{name} changes by {change:.2g} only"
        if not self.changes:
            yield "it changes nothing"
        for body in self.hidden:
            yield f"{body} is out of sight"
        for name in self.leaks:
            yield f"the text names {name}"
        if self.is_crossed:
            yield "a distractor is in the way"
        for body in self.touched:
            yield f"{body} looks different"


def faults_of_draws(kind: Kind) -> Iterator[str]:
    """What is wrong with the draws of a kind over `DRAWS` scenarios: all alike, or to one side only."""
    every = [Perturbation(((kind.name, LEVELS),)).of(f"scenario {n}").plain()[kind.name] for n in range(DRAWS)]
    if kind.effect.varies and len({*map(str, every)}) == 1:
        yield "all scenarios have the same draw"
    middles = {"way": 0.0, "turn": 0.0, "factor": 1.0, "fovy": 1.0}
    for name in every[0].keys() & middles.keys():
        parts = np.array([each[name] for each in every]).reshape(DRAWS, -1) - middles[name]
        parts = parts[:, np.abs(parts).max(axis=0) > 0]
        if ((parts > 0).all(axis=0) | (parts < 0).all(axis=0)).any():
            yield f"{name} is drawn to one side only"


class Stage:
    """A scenario with its witness, on which perturbations are tried one after the other."""

    def __init__(
        self,
        scenario: Scenario,
        scene_xml: str,
        embodiment: str,
        witness: Actions,
        words: Words,
        secrets: Collection[str] = (),
    ):
        """
        Args:
            words: the instruction and others.
            secrets: names that no text may have.
        """
        self.scenario, self.embodiment, self.witness = scenario, embodiment, witness
        self.words, self.secrets, self.bodies = words, secrets, bodies_in_text(scene_xml)
        self.world = World.load(scene_xml, embodiment, with_spares(ROOM))
        self.cameras = cameras_of(embodiment)
        self.streams: dict[str, Stream] = streams_of(embodiment)
        self.eye = Camera(self.world, SIZE, SIZE)
        self.states, self.digest = self._played()
        self.moments = np.linspace(0, len(witness), MOMENTS).astype(int).tolist()
        self.clean = [self._pictures(period, self.cameras) for period in self.moments]
        self.ids = [self._ids(period) for period in self.moments]
        self.shown = [self._counts(ids) for ids in self.ids]

    def close(self) -> None:
        self.eye.close()

    def proof(self, kind: Kind, level: int) -> Proof:
        """Try a kind at a level."""
        drawn = Perturbation(((kind.name, level),)).of(self.scenario.id, bodies=self.bodies, words=self.words)
        with changed_by(drawn, self.eye) as changed:
            neutral = all(name.startswith(SEEN) or self._is_spare(name, rows) for name, rows in changed.items())
            if kind.effect.reads == LANGUAGE:
                return self._text_proof(drawn.instruction or "", not changed)
            if kind.effect.reads != PICTURES:
                return Proof(not changed, self._reading_changes(kind, drawn))
            seen = [name for name, camera in self.cameras.items() if affects(kind.effect, camera)]
            shown = self._shown(kind)
            seen = [name for name in seen if any(name in each for each in shown)]
            changes, hidden = dict.fromkeys(seen, 0.0), set[str]()
            for number, period in enumerate(self.moments):
                at = max(0, period - round(drawn.delay / Loop.PERIOD))
                is_drawn = bool(changed) or at != period
                pictures = self._pictures(at, seen) if is_drawn else self.clean[number]
                for name in (name for name in seen if name in shown[number]):
                    clean, where = self.clean[number][name], shown[number][name]
                    far = self._far(drawn, name, period, pictures[name], clean, where)
                    changes[name] = max(changes[name], far)
                if not kind.effect.is_passing:
                    is_elsewhere = at != period or any(name.startswith("cam_") for name in changed)
                    ids = self._ids(at) if is_elsewhere else self.ids[number]
                    hidden |= self._lost(self.shown[number], self._counts(self._uncovered(drawn, ids)))
            if level == LEVELS and changed:
                neutral = neutral and self._played()[1] == self.digest
            touched = self._touched(changed) if kind.effect.on_things is not None else ()
            return Proof(neutral, changes, tuple(sorted(hidden)), is_crossed=self._is_crossed(), touched=touched)

    def _shown(self, kind: Kind) -> list[Mapping[str, Where]]:
        """Pixels over which a kind is judged, by camera, for each moment: all; of a kind that changes things those that
        show them, in cameras that show enough of them."""
        if kind.effect.on_things is None:
            return [dict.fromkeys(self.cameras)] * len(self.moments)
        bodies = np.unique(self.world.model.geom_bodyid[free_geoms(self.world.model, self.words.free)])
        every = ({name: np.isin(seen, bodies) for name, seen in ids.items()} for ids in self.ids)
        return [{name: where for name, where in each.items() if where.sum() >= MIN_PIXELS} for each in every]

    def _is_spare(self, name: str, rows: NDArray[np.int64]) -> bool:
        """Whether only spare geoms differ in an array."""
        return name in PLACES and set(rows.tolist()) <= {*spares(self.world.model)}

    def _touched(self, changed: Mapping[str, NDArray[np.int64]]) -> tuple[str, ...]:
        """Bodies with a geom whose colour or material differs, apart from those whose look carries no meaning."""
        model = self.world.model
        rows = {row for name in ("geom_rgba", "geom_matid") for row in changed.get(name, np.zeros(0, int)).tolist()}
        others = rows - {*free_geoms(model, self.words.free)}
        return tuple(sorted({model.body(model.geom_bodyid[geom]).name for geom in others}))

    def _is_crossed(self) -> bool:
        """Whether the witness comes close to a distractor."""
        model = self.world.model
        if not visible(model):
            return False
        moving = [g for g in range(model.ngeom) if model.body_weldid[model.geom_bodyid[g]] and model.geom_contype[g]]
        for period in range(0, len(self.states), SWEEP):
            self.world.restore(self.states[period])
            if in_the_way(model, self.world.data, moving, CLEARANCE):
                return True
        return False

    def _text_proof(self, text: str, neutral: bool) -> Proof:
        """How far a text is from the instruction, and what it gives away."""
        given = self.words.instruction
        changes = {INSTRUCTION: other_words(text, given)}
        return Proof(neutral, changes, leaks=tuple(leaks(text, given, self.secrets)))

    def _far(
        self, drawn: Drawn, name: str, period: int, picture: Picture, clean: Picture, where: Where = None
    ) -> float:
        """Distance of a camera's picture from the clean one; of passing ones the mean over some periods."""
        passing = any(effect.is_passing for effect in drawn.effects.values())
        periods = range(period, period + (PASSING if passing else 1))
        found = (drawn.on_picture(picture, self.cameras[name], each) for each in periods)
        return float(np.mean([distance(one, clean, where) for one in found]))

    def _played(self) -> tuple[list[NDArray[np.float64]], str]:
        """States of the witness from the start on, one for each control period, and the hash of the last one."""
        self.world.reset()
        episode, states = Episode(self.scenario, self.world), [self.world.state()]
        for action in self.witness:
            episode.step(action)
            states.append(self.world.state())
        return states, self.world.digest

    def _pictures(self, period: int, names: Iterable[str]) -> dict[str, Picture]:
        """Pictures of some cameras in a control period of the witness."""
        self.world.restore(self.states[period])
        return {name: self.eye.take(self.cameras[name]).copy() for name in names}

    def _ids(self, period: int) -> Ids:
        """Number of the body in each pixel of each camera in a control period of the witness."""
        self.world.restore(self.states[period])
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
            for period in self.moments:
                self.world.restore(self.states[period])
                reading = np.asarray(stream.read(self.world), float)
                far = np.abs(drawn.on_reading(name, stream.entries(name), reading.copy(), period) - reading)
                changes[name] = max(changes.get(name, 0.0), float(far.max()))
        return changes

    def _all_streams(self) -> Mapping[str, Stream]:
        state = ObjectState(self.bodies, len(self.world.arms))
        return {**self.streams, **privileged(state, type(self.scenario), Orientation)}
