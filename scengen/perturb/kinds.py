"""The kinds of perturbation, from `conf/perturbations`, and what each of them affects."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from ..errors import BadConfig, UnknownName
from ..samplers.task_files import conf_dir
from ..work.plain import read_yaml
from .effects import CONTROL, EFFECTS, OBJECTS, PICTURES, PROPRIOCEPTION, WRENCH, Effect, is_among

LEVELS = 5
"""Number of levels of each kind."""


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

    @property
    def effect(self) -> Effect:
        return EFFECTS[self.name]


@cache
def kinds() -> Mapping[str, Kind]:
    """All kinds, from `conf/perturbations`.

    Raises:
        BadConfig: a file is damaged, has not as many growing strengths as there are levels, or no effect.
    """
    found = {}
    for path in sorted((conf_dir() / "perturbations").glob("*.yaml")):
        node, name = read_yaml("kind", path), path.stem
        if name not in EFFECTS:
            raise BadConfig(f"{path}: there is no effect named {name}; give it in scengen.perturb.effects")
        try:
            strengths = tuple(float(each) for each in node["strengths"])
            kind = Kind(name, strengths, *(str(node[key]) for key in ("unit", "why", "source")))
        except (KeyError, TypeError, ValueError) as error:
            raise BadConfig(f"{path}: give strengths, unit, why and source ({error})") from None
        if len(strengths) != LEVELS or any(b <= a for a, b in zip((0.0, *strengths), strengths, strict=False)):
            raise BadConfig(f"{path}: strengths = {list(strengths)}; give {LEVELS} growing positive numbers")
        found[name] = kind
    return found


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
