"""The kinds of perturbation, from `conf/perturbations`, and what each of them affects.

A file of an installed package, `perturbations/<kind>.yaml` in a folder of its entry points `scengen.tasks`, adds a
kind: strengths for an effect that there is, or for one that a function returns (`effect: module:function`).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..errors import BadConfig, ScengenError, UnknownName, cut
from ..samplers.conditions import LEVELS
from ..samplers.task_files import conf_dir, packages
from ..work.foreign import at_fault, factory_of, is_factory
from ..work.plain import read_yaml
from .effects import CONTROL, EFFECTS, LANGUAGE, OBJECTS, PICTURES, PROPRIOCEPTION, WRENCH, Effect, is_among
from .language import NO_WORDINGS, WORDINGS, Words


@dataclass(frozen=True)
class Kind:
    """A kind of perturbation."""

    name: str
    strengths: tuple[float, ...]
    """Strength at each level."""
    unit: str
    """Unit of the strengths."""
    why: str
    """Reason for the range."""
    source: str
    """Ranges that others use."""
    own: Effect | None = None
    """Effect of a kind that a package adds; None for those of scengen, which are in `EFFECTS`."""

    @property
    def effect(self) -> Effect:
        return self.own or EFFECTS[self.name]

    def lacks(self, words: Words) -> str:
        """What a task lacks for it, with the remedy; empty if nothing.

        Args:
            words: what is said in the task.
        """
        if self.name in WORDINGS and not words.wordings:
            return NO_WORDINGS.format(words.task)
        if self.effect.on_things is not None and not words.free:
            file = f"conf/things/{words.task}.yaml"
            return f"{words.task} names no body whose look carries no meaning; if there is one, list it in {file}"
        return ""


@cache
def kinds() -> Mapping[str, Kind]:
    """All kinds, from `conf/perturbations`.

    Raises:
        BadConfig: a file is damaged, has not as many growing strengths as there are levels, or no effect.
    """
    found = dict[str, Kind]()
    for path in sorted((conf_dir() / "perturbations").glob("*.yaml")):
        if path.stem not in EFFECTS:
            raise BadConfig(f"{path}: there is no effect named {path.stem}; give it in scengen.perturb.effects")
        found[path.stem] = _kind(path)
    for folder in packages():
        for path in sorted(Path(folder.removeprefix("file://"), "perturbations").glob("*.yaml")):
            if path.stem in found or not re.fullmatch("[a-z][a-z0-9_]*", path.stem):
                raise BadConfig(f"{path}: give a kind a name that no other has, in small letters, such as my_noise")
            found[path.stem] = _kind(path, is_added=True)
    return found


def _kind(path: Path, is_added: bool = False) -> Kind:
    """The kind in a file.

    Args:
        is_added: whether a package adds it, with an effect that the file names.
    """
    node = read_yaml("kind", path)
    needed = ("strengths", "unit", "why", "source", *(("effect",) if is_added else ()))
    if odd := sorted(str(key) for key in node if key not in needed):
        raise BadConfig(f"{path}: {UnknownName('key', odd[0], needed)}")
    try:
        strengths = tuple(float(each) for each in node["strengths"])
        texts = [str(node[key]) for key in needed[1:]]
    except (KeyError, TypeError, ValueError) as error:
        raise BadConfig(f"{path}: give {', '.join(needed)} ({error})") from None
    if len(strengths) != LEVELS or any(b <= a for a, b in zip((0.0, *strengths), strengths, strict=False)):
        raise BadConfig(f"{path}: strengths = {list(strengths)}; give {LEVELS} growing positive numbers")
    return Kind(path.stem, strengths, *texts[:3], own=_own_effect(path, texts[3]) if is_added else None)


def _own_effect(path: Path, name: str) -> Effect:
    """The effect that a file of a package names.

    Raises:
        ScengenError: there is none of this name, or the function fails or returns something else.
    """
    if is_factory(name):
        setting = f"{path}: effect"
        factory = factory_of(setting, name)
        try:
            made = factory()
        except ScengenError:
            raise
        except Exception as error:
            raise at_fault(setting, name, "its function fails", error) from error
        if not isinstance(made, Effect):
            raise BadConfig(f"{setting} = {cut(name)}; it returned {type(made).__name__}, and must return an Effect")
        return made
    known = [
        each for each, effect in EFFECTS.items() if effect.reads not in (CONTROL, LANGUAGE) and not effect.on_things
    ]
    if name not in known:
        raise UnknownName(f"effect for {path}", name, [*known, "module:function"])
    return EFFECTS[name]


def perceived() -> Mapping[str, Kind]:
    """The kinds that change what is perceived and leave the physics alone: all but the conditions of control."""
    return {name: kind for name, kind in kinds().items() if kind.effect.reads != CONTROL}


def kind_of(name: str) -> Kind:
    """The kind of this name.

    Raises:
        UnknownName: there is none.
    """
    if name not in kinds():
        raise UnknownName("perturbation", name, kinds())
    return kinds()[name]


def affects(effect: Effect, camera: str) -> bool:
    """Whether an effect shows in a camera, given robosuite's name."""
    return effect.reads == PICTURES and is_among(camera, effect.cameras)


def stream_kind(stream: str) -> str:
    """Which kind of reading a stream is."""
    if "force_torque" in stream:
        return WRENCH
    own = ("eef_pos", "eef_quat", "joint_pos", "joint_vel", "joint_acc", "gripper_qpos", "gripper_qvel")
    if stream.startswith("robot") and stream.endswith(own):
        return PROPRIOCEPTION
    return "" if "tactile" in stream else OBJECTS
