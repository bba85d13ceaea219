"""Perturbations by name and level, and what they draw for a scenario.

`light_direction@3+noise@1` is two kinds at their levels. Values depend on kind, scenario and seed; their strength on
the level: a scenario looks the same in each episode and process, also with further kinds, and a higher level goes
farther in the same direction.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco

from ..errors import BadConfig
from ..look.looks import ROOM, Look
from ..samplers import conditions
from ..scenario import Conditions
from .distractors import with_spares
from .drawn import Drawn, Senses, random
from .effects import CONTROL, EVERY, FIXED, LANGUAGE, OBJECTS, PICTURES, PROPRIOCEPTION, WRENCH, WRIST
from .kinds import LEVELS, affects, kind_of, kinds, stream_kind
from .language import WORDINGS, Words

NONE = "none"
"""Name of no perturbation."""
EXAMPLES = {
    EVERY: "rgb_exo_right_cam",
    FIXED: "rgb_exo_right_cam",
    WRIST: "rgb_gripper_cam",
    PROPRIOCEPTION: "robot0_eef_pos",
    WRENCH: "force_torque",
    OBJECTS: "object-state",
}
"""A camera or a stream that kinds affect, by what they affect."""


@dataclass(frozen=True)
class Perturbation:
    """Some kinds at their levels."""

    parts: tuple[tuple[str, int], ...]
    """Kind and level of each."""

    @classmethod
    def parse(cls, text: str | None) -> "Perturbation":
        """Read `kind@level`, several separated by `+`; nothing for None, an empty text or `none`.

        Raises:
            UnknownName: there is no such kind.
            BadConfig: a level does not exist, or two parts are one kind, or change the same.
        """
        parts = list[tuple[str, int]]()
        for one in (text or "").split("+") if text not in (None, "", NONE) else ():
            name, at, level = one.strip().partition("@")
            kind_of(name)
            if not at or not level.isdecimal() or not 1 <= int(level) <= LEVELS:
                raise BadConfig(f"perturb = {text}; give {name} a level from 1 to {LEVELS}, such as {name}@3")
            if name in dict(parts):
                raise BadConfig(f"perturb = {text}; {name} is in it twice: give each kind once")
            parts.append((name, int(level)))
        texts = [name for name, _ in parts if name in WORDINGS]
        prints = [name for name, _ in parts if kinds()[name].effect.on_things is not None]
        for both, what in ((texts, "replace the same instruction"), (prints, "change the look of the same things")):
            if len(both) > 1:
                raise BadConfig(f"perturb = {text}; {' and '.join(both)} {what}: give one of them")
        return cls(tuple(parts))

    def __str__(self) -> str:
        return "+".join(f"{name}@{level}" for name, level in self.parts) or NONE

    def __bool__(self) -> bool:
        return bool(self.parts)

    @property
    def has_words(self) -> bool:
        """Whether a part changes the instruction."""
        return any(kinds()[name].effect.reads == LANGUAGE for name, _ in self.parts)

    def conditions(self, embodiment: str) -> Conditions | None:
        """The conditions of control among the parts, for a robot; None if there are none."""
        parts = tuple(part for part in self.parts if kinds()[part[0]].effect.reads == CONTROL)
        return Conditions(parts, embodiment) if parts else None

    def check_perceived(self, why: str) -> None:
        """Raise `BadConfig` if a part changes what happens and not only what is perceived.

        Args:
            why: reason why such parts have no place here, and what to do instead.
        """
        if posed := [name for name, _ in self.parts if kinds()[name].effect.reads == CONTROL]:
            raise BadConfig(f"perturb = {self}; {posed[0]} changes what happens: {why}")

    @property
    def shows_spares(self) -> bool:
        """Whether a part shows spare geoms."""
        return any(kinds()[name].effect.is_added for name, _ in self.parts)

    @property
    def is_of_words(self) -> bool:
        """Whether all parts change the instruction, and nothing else."""
        return bool(self) and all(kinds()[name].effect.reads == LANGUAGE for name, _ in self.parts)

    def check_words(self, words: Words) -> None:
        """Raise `BadConfig` if a task lacks what a part needs: other wordings, or things that no text names."""
        for name, level in self.parts:
            if lacks := kinds()[name].lacks(words):
                raise BadConfig(f"perturb = {name}@{level}: {lacks}")

    def dressed(self, look: Look) -> Look:
        """A look of a scene that is to be perturbed: with spare geoms if a part shows them."""
        return with_spares(look) if self.shows_spares else look

    def check(
        self,
        streams: Sequence[str],
        cameras: Sequence[str],
        look: Look = ROOM,
        setting: str = "observations=[state,{}]",
    ) -> None:
        """Raise `BadConfig` if parts affect nothing that is observed. Instruction and control always count.

        Args:
            streams: names of the observed streams.
            cameras: robosuite's names of the observed cameras.
            look: look of the pictures.
            setting: the setting that adds a stream or a camera, with `{}` for its name.
        """
        lacking, added = list[str](), list[str]()
        for name, level in self.parts:
            effect = kinds()[name].effect
            if effect.reads in (LANGUAGE, CONTROL):
                continue
            if look.name not in effect.looks:
                raise BadConfig(
                    f"perturb = {name}@{level} shows in look={' and '.join(effect.looks)}, not in {look.name}"
                )
            if effect.reads == PICTURES:
                which = what = effect.cameras
                is_seen = any(affects(effect, camera) for camera in cameras)
            else:
                which, what = effect.reads, f"streams of {effect.reads}"
                is_seen = any(stream_kind(stream) == which for stream in streams)
            if not is_seen:
                lacking.append(f"{name}@{level} affects {what}, and none is observed")
                added.append(EXAMPLES[which])
        if lacking:
            raise BadConfig(
                f"perturb = {'; '.join(lacking)}: add one, such as {setting.format(','.join(dict.fromkeys(added)))}"
            )

    def senses(
        self, model: mujoco.MjModel, scenario: str, task: str, instruction: str, seed: int, search: Sequence[str] = ()
    ) -> Senses:
        """What is perceived of a scenario, whose compiled scene is changed for it.

        Args:
            scenario: its id.
            task: name of its task.
            instruction: the instruction of the task.
            seed: another number draws another perturbation.
            search: folders of other packages, see `task_files.search_path`.
        """
        bodies = [model.body(number).name for number in range(model.nbody)] if self else ()
        words = Words.of(task, instruction, search) if self else None
        senses = Senses(self.of(scenario, seed, bodies, words))
        senses.drawn.on_model(model)
        return senses

    def of(self, scenario: str, seed: int = 0, bodies: Iterable[str] = (), words: Words | None = None) -> "Drawn":
        """What is drawn for a scenario.

        Args:
            scenario: its id.
            bodies: names of the bodies of its scene. Readings of others stay 0.
            words: what is said in the task, for a part that changes it, or things that it does not name.
        """
        values = {}
        for name, level in self.parts:
            effect, rng = kinds()[name].effect, random("draw", name, scenario, seed)
            values[name] = (
                conditions.values(name, level, scenario, seed)
                if effect.reads == CONTROL
                else effect.draw(kinds()[name].strengths[level - 1], rng)
            )
        starts = tuple(f"{start}{body}_" for body in bodies for start in ("", "seen_"))
        return Drawn(scenario, seed, dict(self.parts), values, starts, words)
