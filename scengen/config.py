"""From the command line to checked settings: Hydra composes, this module types and explains."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from .errors import BadConfig, UnknownName
from .samplers.task import Task, load
from .validate.settings import CertifySettings

T = TypeVar("T")


@dataclass(frozen=True)
class Composed:
    """What a command line amounts to."""

    settings: dict[str, Any]
    """Everything but task and certify."""
    task: Task | None
    level: CertifySettings
    resolved: dict[str, Any]
    """The whole configuration as plain data, task file included."""


@cache
def conf_dir() -> Path:
    """The folder of configuration files: inside an installed package, beside it in a checkout."""
    here = Path(__file__).parent
    found = next((d for d in (here / "conf", here.parent / "conf") if (d / "command").is_dir()), None)
    if found is None:
        raise BadConfig("the conf/ folder is missing from this installation; install scengen again")
    return found


def read(verb: str, overrides: Sequence[str]) -> Composed:
    """Compose conf/command/<verb>.yaml with the overrides of a command line, and check all of it.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    node, choices = _compose(verb, overrides)
    plain: dict[str, Any] = OmegaConf.to_container(node, resolve=True)  # type: ignore[assignment]
    settings = {k: v for k, v in plain.items() if k not in ("task", "certify")}
    for key, value in settings.items():
        if value == "???":
            raise BadConfig(f"{verb} needs {key}=...; see scengen {verb} --help")
    task = load(choices["task"], plain["task"]) if "task" in plain else None
    level = CertifySettings()
    if "certify" in plain:
        plain["certify"] = _settle(plain["certify"], task, choices["certify"])
        level = typed("certify", CertifySettings, plain["certify"])
    return Composed(settings, task, level, plain)


def search_path(overrides: Sequence[str]) -> tuple[str, ...]:
    """Those overrides that add folders of other packages, `hydra.searchpath=[file:///path/to/conf]`."""
    return tuple(o for o in overrides if o.startswith("hydra.searchpath="))


def tasks(search: Sequence[str] = ()) -> list[str]:
    """Names of all task files, those of other packages included (`search_path`)."""
    with initialize_config_dir(str(conf_dir()), version_base="1.3", job_name="scengen"):
        loader = GlobalHydra.instance().config_loader()
        return sorted(loader.get_group_options("task", config_name="command/tasks", overrides=list(search)))


def task(name: str, search: Sequence[str] = ()) -> Task:
    """The task of that name, as its file says.

    Raises:
        UnknownName: there is no such file.
    """
    found = read("one_task", [f"task={name}", *search]).task
    assert found is not None
    return found


def typed(where: str, cls: type[T], node: Mapping[str, Any]) -> T:
    """Fill a dataclass from plain data, checking names and types.

    Raises:
        UnknownName, BadConfig: a key or the type of a value is wrong.
    """
    known = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    for key in node:
        if key not in known:
            raise UnknownName(f"key of {where}" if where else "key", key, known)
    filled = {}
    for name, field in known.items():
        default = field.default if field.default is not MISSING else None
        if field.default_factory is not MISSING:
            default = field.default_factory()
        filled[name] = _value(f"{where}.{name}".strip("."), field.type, node.get(name, default))
    return cls(**filled)


def _value(where: str, kind: Any, value: Any) -> Any:
    if is_dataclass(kind):
        if not isinstance(value, (Mapping, kind)):  # type: ignore[arg-type]
            raise BadConfig(f"{where} = {value!r}; it must be a group of settings")
        return value if isinstance(value, kind) else typed(where, kind, value)  # type: ignore[arg-type]
    spelled = {int: "a whole number", float: "a number", str: "a word", bool: "true or false"}
    options = kind.__args__ if hasattr(kind, "__args__") and not hasattr(kind, "__origin__") else (kind,)
    if float in options and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if value is None and type(None) in options:
        return None
    if str in options and isinstance(value, (int, float)) and not isinstance(value, bool):
        return str(value)
    for option in options:
        plain = getattr(option, "__origin__", option)
        if isinstance(value, plain) and not (isinstance(value, bool) and plain is not bool):
            return value
    wanted = " or ".join(spelled.get(o, "a list") for o in options if o is not type(None))
    raise BadConfig(f"{where} = {value!r}; it must be {wanted}")


def _compose(verb: str, overrides: Sequence[str]) -> tuple[DictConfig, dict[str, str]]:
    with initialize_config_dir(str(conf_dir()), version_base="1.3", job_name="scengen"):
        try:
            asked = [_listed(o) for o in overrides]
            node = compose(f"command/{verb}", overrides=asked, return_hydra_config=True)
        except (HydraException, OmegaConfBaseException) as error:
            raise _explain(verb, overrides, error) from None
        except yaml.YAMLError as error:
            raise BadConfig(f"a configuration file is no YAML: {' '.join(str(error).split())}") from None
    choices = {k: v for k, v in node.hydra.runtime.choices.items() if isinstance(v, str)}
    OmegaConf.set_struct(node, False)
    del node["hydra"]
    return node, choices


def _listed(override: str) -> str:
    """`keep=refuted,unknown`, `pool=a,b` and `cameras=a,b` mean lists here, not sweeps; `keep` always is one."""
    key, _, value = override.partition("=")
    many = key == "keep" or (key in ("pool", "cameras") and "," in value)
    return f"{key}=[{value}]" if many and not value.startswith("[") else override


def _settle(node: dict[str, Any], task: Task | None, choice: str) -> dict[str, Any]:
    """The level's file, then the task's own settings, then the command line: the later one wins."""
    base: dict[str, Any] = OmegaConf.to_container(OmegaConf.load(conf_dir() / "certify" / f"{choice}.yaml"))  # type: ignore[assignment]
    asked = OmegaConf.create(_difference(node, base))
    special = OmegaConf.create(dict(task.certify) if task else {})
    return OmegaConf.to_container(OmegaConf.merge(base, special, asked))  # type: ignore[return-value]


def _difference(node: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    different = {}
    for key, value in node.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping):
            different[key] = _difference(value, base[key])
        elif key not in base or base[key] != value:
            different[key] = value
    return different


def _explain(verb: str, overrides: Sequence[str], error: Exception) -> BadConfig | UnknownName:
    """One line with the nearest name, from Hydra's error."""
    text = str(error)
    if match := re.search(r"Could not find '(\w+)/([^']*)'", text):
        group, name = match.groups()
        return UnknownName(group, name, re.findall(r"^\s+(\S+)$", text, re.M))
    if match := re.search(r"You must specify '(\w+)'", text):
        known = ", ".join(re.findall(r"^\s+(\S+)$", text, re.M))
        return BadConfig(f"which {match[1]}? say {match[1]}=NAME; known: {known}")
    if match := re.search(r"Could not override '([^']+)'", text):
        return _unknown_key(verb, overrides, match[1]) or BadConfig(_first_lines(text))
    for override in overrides:
        try:
            OverridesParser.create().parse_overrides([override])
        except HydraException:
            return BadConfig(
                f"{override!r} is no override; expected key=value, quoted if the value holds spaces or commas"
            )
    return BadConfig(_first_lines(text))


def _unknown_key(verb: str, overrides: Sequence[str], path: str) -> UnknownName | None:
    """Name the level at which the path of an override leaves the configuration."""
    groups = [o for o in overrides if re.match(r"(task|certify)=", o)]
    try:
        node: Any = compose(f"command/{verb}", overrides=groups)
    except HydraException:
        return None
    seen: list[str] = []
    for part in path.split("."):
        if not isinstance(node, DictConfig):
            return None
        if part not in node:
            return UnknownName(f"key in {'.'.join(seen)}" if seen else f"setting of {verb}", part, map(str, node))
        seen.append(part)
        node = node[part]
    return None


def _first_lines(text: str) -> str:
    return " ".join(text.split())[:300]
