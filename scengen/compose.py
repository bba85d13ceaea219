"""Composition of settings by Hydra: the files in conf/ with the overrides of a command line, as plain data.

Hydra's errors become one line each, with the nearest name or a remedy. Tasks are composed and loaded here too; settings
of commands are checked in `scengen.commands.settings`.
"""

import itertools
import logging
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from .errors import BadConfig, UnknownName, cut
from .samplers.task import Task, load
from .task_files import ORIGINS, category, conf_dir, groups, packages, search_path, tasks
from .typed import typed
from .validate.settings import CertifySettings


def load_task(name: str, search: Sequence[str] = ()) -> Task:
    """The task of that name.

    Args:
        name: of its file, a plain word: it never leads out of the folders of tasks.
        search: further overrides, such as folders of other packages (`search_path`) or `task.horizon=20`.

    Raises:
        UnknownName: there is no such file.
    """
    if name not in (known := tasks(search_path(search))):  # a name from a pool must not leave the folders of task files
        raise UnknownName("task", name, known)
    return _loaded(name, search) if search else _installed(name, packages())


@cache
def _installed(name: str, others: tuple[str, ...]) -> Task:
    """A task as its file stands; read once, as the code of its family is.

    Args:
        others: folders of other packages that offer tasks.
    """
    return _loaded(name, ())


def _loaded(name: str, search: Sequence[str]) -> Task:
    plain, choices = composed("one_task", [f"task={name}", *search])
    return load(choices["task"], plain["task"])


def certify_levels(found: Task) -> dict[str, CertifySettings]:
    """The settings that stand behind each name of a level, such as `quick`, for a task: without a command line."""
    names = sorted(path.stem for path in (conf_dir() / "certify").glob("*.yaml"))
    return {name: typed("certify", CertifySettings, settled({}, found, name)) for name in names}


def chosen_task(verb: str, overrides: Sequence[str]) -> str | None:
    """Name of the task that a command line chooses, for a command that may go without; None if it does not.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    return composed(verb, overrides)[1].get("task")


@dataclass(frozen=True)
class Combination:
    """One of the command lines that a sweep stands for."""

    overrides: tuple[str, ...]
    swept: Mapping[str, str]
    """The settings that name several values, and the one that each has here; empty where nothing is swept."""

    def __str__(self) -> str:
        return " ".join(f"{key}={value}" for key, value in self.swept.items())


def combinations(verb: str, overrides: Sequence[str]) -> list[Combination]:
    """What a command line stands for in which settings name several values: `n=1,2`, or Hydra's choice, range, glob.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    overrides = [_spelled_out(text) for text in overrides]
    with initialize_config_dir(str(root(verb)), version_base="1.3", job_name="scengen"):
        parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
        try:
            choices = [_values(parser, _listed(text)) for text in overrides]
        except HydraException as error:
            raise BadConfig(f"{_first_lines(str(error))}; see scengen {verb} --help") from None
    if (count := math.prod(len(values) for _, values in choices)) > MOST_COMBINATIONS:
        raise BadConfig(f"{count} combinations of settings; give at most {MOST_COMBINATIONS} at once")
    found = []
    for picked in itertools.product(*(values for _, values in choices)):
        swept = {key: v for (key, values), v in zip(choices, picked, strict=True) if key and len(values) > 1}
        line = (f"{key}={value}" if key else value for (key, _), value in zip(choices, picked, strict=True))
        found.append(Combination(tuple(line), swept))
    return found


MOST_COMBINATIONS = 1000
"""How many runs one command line may ask for."""


def _values(parser: OverridesParser, text: str) -> tuple[str, list[str]]:
    """Key and values of an override that names several; else nothing, and the override as it is."""
    override = _parsed(text, parser)
    if override is None or not override.is_sweep_override():
        return "", [text]
    values = list(itertools.islice(override.sweep_string_iterator(), MOST_COMBINATIONS + 1))
    if not values:
        raise BadConfig(f"{cut(repr(text))} names no value; give at least one")
    return override.get_key_element(), values


def _spelled_out(text: str) -> str:
    """`task=all`, a category as in `task=P3`, or a list in which such words stand, as a list of tasks."""
    key, _, value = text.partition("=")
    words = value.split(",")
    if key != "task" or not any(re.fullmatch(f"{ALL}|P[1-9]|M", word) for word in words):
        return text
    known = tasks()
    named = {word: known if word == ALL else [t for t in known if category(t) == word] for word in words}
    return f"task={','.join(dict.fromkeys(t for word, found in named.items() for t in found or [word]))}"


ALL = "all"
"""Stands for all tasks."""


def shown(verb: str, overrides: Sequence[str]) -> str:
    """The composed configuration of a command as YAML: `--cfg job`.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    plain, choices = composed(verb, overrides)
    if {"certify", "task"} <= choices.keys():
        plain["certify"] = settled(plain["certify"], load(choices["task"], plain["task"]), choices["certify"])
    lines = {key: None if isinstance(value, dict) else False for key, value in plain.items()}  # None: leaves in a line
    told = {"sort_keys": False, "allow_unicode": True, "width": 120}
    return "".join(yaml.safe_dump({key: plain[key]}, default_flow_style=flow, **told) for key, flow in lines.items())


def show_origin(verb: str, overrides: Sequence[str], what: str) -> None:
    """Print what Hydra tells of where a configuration comes from: `--info defaults`, for instance.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    if what not in ORIGINS:
        raise UnknownName("information of --info", what, ORIGINS)
    composed(verb, overrides)
    with _logging_kept(), initialize_config_dir(str(root(verb)), version_base="1.3", job_name="scengen"):
        asked = [_listed(o) for o in overrides]
        asked = _with_packages(asked) if groups(verb) else asked
        GlobalHydra.instance().hydra.show_info(what, file(verb), asked)  # type: ignore[union-attr]


@contextmanager
def _logging_kept() -> Iterator[None]:
    """Hydra prints through the root logger, which it sets up for that and leaves so."""
    root_logger = logging.getLogger()
    handlers, level = list(root_logger.handlers), root_logger.level
    try:
        yield
    finally:
        root_logger.handlers[:] = handlers
        root_logger.setLevel(level)


def _with_packages(overrides: Sequence[str]) -> list[str]:
    """Overrides in which Hydra also searches installed packages, behind the folders that they name themselves."""
    named, others = search_path(overrides), [o for o in overrides if not o.startswith("hydra.searchpath=")]
    if not packages():
        return [*named, *others]
    given = [override.value() for text in named if (override := _parsed(text))]
    folders = [folder for each in given for folder in (each if isinstance(each, list) else [each])]
    return [f"hydra.searchpath=[{','.join([*map(str, folders), *packages()])}]", *others]


def composed(verb: str, overrides: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """The whole configuration as plain data, and which file was chosen in each group."""
    with initialize_config_dir(str(root(verb)), version_base="1.3", job_name="scengen"):
        try:
            asked = [_listed(o) for o in overrides]
            for override in asked:
                _check_override(verb, override)
            asked = _with_packages(asked) if groups(verb) else asked
            node = compose(file(verb), overrides=asked, return_hydra_config=True)
            choices = {k: v for k, v in node.hydra.runtime.choices.items() if isinstance(v, str)}
            OmegaConf.set_struct(node, False)
            del node["hydra"]
            plain = OmegaConf.to_container(node, resolve=True)
            return plain, choices  # type: ignore[return-value]
        except (HydraException, OmegaConfBaseException) as error:
            raise _explain(verb, overrides, error) from None
        except yaml.YAMLError as error:
            raise BadConfig(f"a configuration file is no YAML: {_first_lines(str(error))}; correct it") from None
        except (ValueError, TypeError, AssertionError, RecursionError) as error:  # Hydra checks little of what it gets
            raise BadConfig(f"{_first_lines(str(error))}; see scengen {verb} --help") from None


def root(verb: str) -> Path:
    """The folder in which Hydra finds the file of a command, and the groups from which it chooses files.

    One that chooses none sees none: Hydra would take its setting `task` for a choice among the files of conf/task.
    """
    return conf_dir() if groups(verb) else conf_dir() / "command"


def file(verb: str) -> str:
    """The file of a command, as it is called in its `_root`."""
    return f"command/{verb}" if groups(verb) else verb


DEEPEST = 20
"""How deeply lists and groups may be nested in an override: more than any file of conf/ needs."""


def _check_override(verb: str, text: str) -> None:
    """Refuse what Hydra takes for something that scengen does not do, or what it cannot digest.

    Raises:
        BadConfig: one line with the remedy.
    """
    told = cut(repr(text))
    if _depth(text) > DEEPEST:
        raise BadConfig(f"{told} is nested too deeply; quote it if the brackets are part of a name")
    override = _parsed(text)
    if override is None or not override.key_or_group:
        raise BadConfig(f"{told} is no override; expected key=value, quoted if the value holds spaces or commas")
    key = override.key_or_group
    if override.package is not None:
        raise BadConfig(f"{told}: settings have no package after @; see scengen {verb} --help")
    if override.is_sweep_override():
        raise BadConfig(f"{told} names several values; give one, or quote what is meant as a word: {key}='...'")
    if key.split(".")[0].split("/")[0] == "hydra" and key != "hydra.searchpath":
        raise BadConfig(f"{told}: of Hydra's own settings give none but hydra.searchpath=[file:///folder]")
    if override.is_delete() and "." not in key:
        raise BadConfig(f"{told}: {key} cannot be deleted; leave it out for its default, or give another value")
    if key == "hydra.searchpath":
        folders = override.value()
        for folder in folders if isinstance(folders, list) else [folders]:
            if not re.match(r"(file|pkg)://.", str(folder)):
                raise BadConfig(f"{told}: give a folder of configuration as file:///folder or pkg://package")
    if key in ("task", "certify") and not re.fullmatch(r"\w+", str(override.value()), re.ASCII):
        names = groups(verb)
        if key in names:
            raise BadConfig(f"{told}: expected the name of a file of conf/{key} without .yaml; see scengen tasks")
    if key in ("task", "certify") and override.value() is None:
        raise BadConfig(f"{told}: leave it out, or name a file of conf/{key}")


def _parsed(text: str, parser: OverridesParser | None = None) -> Override | None:
    try:
        return (parser or OverridesParser.create()).parse_overrides([text])[0]
    except (HydraException, RecursionError, ValueError, TypeError):  # numbers of 5000 digits are a ValueError
        return None


def _depth(text: str) -> int:
    """How deeply brackets are nested, quoted ones included."""
    deepest = depth = 0
    for letter in text:
        depth += (letter in "[{(") - (letter in "]})")
        deepest = max(deepest, depth)
    return deepest


def _listed(override: str) -> str:
    """`keep=refuted,unknown`, `pool=a,b` and the like mean lists here, not sweeps; `keep` always is one.

    What `id` gives is a word: `12e4` begins an id and is no number.
    """
    key, _, value = override.partition("=")
    if key == "id" and value != "null" and re.fullmatch(r"[\w@+/]+", value, re.ASCII):
        return f"id='{value}'"
    many = key == "keep" or (key in ("pool", "cameras", "mujoco") and "," in value and value[:1] not in ("'", '"'))
    return f"{key}=[{value}]" if many and not value.startswith("[") else override


def settled(node: Mapping[str, Any], task: Task, choice: str) -> dict[str, Any]:
    """The chosen file of conf/certify, then the task's own settings, then the command line: the later one wins."""
    base: dict[str, Any] = OmegaConf.to_container(OmegaConf.load(conf_dir() / "certify" / f"{choice}.yaml"))  # type: ignore[assignment]
    asked = OmegaConf.create(_difference(node, base))
    special = OmegaConf.create(dict(task.certify))
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
        return _unknown_key(verb, overrides, match[1]) or BadConfig(f"{_first_lines(text)}; see scengen {verb} --help")
    if isinstance(error, OmegaConfBaseException):
        what = f"{error.full_key}: " if error.full_key else ""
        return BadConfig(f"{what}{_first_lines(text.splitlines()[0])}; give the value itself")
    return BadConfig(f"{_first_lines(text)}; see scengen {verb} --help")


def _unknown_key(verb: str, overrides: Sequence[str], path: str) -> UnknownName | BadConfig | None:
    """Name the key at which the path of an override leaves the configuration."""
    files = _with_packages([o for o in overrides if re.match(r"(task|certify|executor|hydra\.searchpath)=", o)])
    try:
        node: Any = compose(file(verb), overrides=files if groups(verb) else [])
    except HydraException:
        return None
    seen: list[str] = []
    for part in path.split("."):
        if not isinstance(node, DictConfig):
            return None
        if part not in node:
            known = {*map(str, node), *([] if seen else groups(verb))}
            if seen == ["executor"] and not known:
                return BadConfig(f"{path} is a setting of executor=ray; say that as well")
            unknown = UnknownName(f"key in {'.'.join(seen)}" if seen else f"setting of {verb}", part, known)
            if seen[:2] == ["task", "id"]:  # what a task file does not list stays at its nominal value: it can be added
                return BadConfig(f"{unknown}; +{path}=... adds one")
            return unknown
        seen.append(part)
        node = node[part]
    return None


def _first_lines(text: str) -> str:
    return " ".join(text.split())[:300]
