"""Composition of settings by Hydra: the files in conf/ with the overrides of a command line, as plain data.

Tasks are composed and loaded here, too. Each of Hydra's errors becomes one line with the nearest name or a remedy.
`scengen.cli.commands.settings` turns the composed data of a command into checked settings.
"""

import itertools
import logging
import math
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, ValueType
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from .errors import SHOWN_LENGTH, BadConfig, ScengenError, UnknownName, cut, shown
from .samplers.split import ID
from .samplers.task import Task, load
from .samplers.task_files import (
    ORIGINS,
    SEARCH_PATH,
    SELF,
    category,
    command_file,
    conf_dir,
    file_of_group,
    groups,
    is_folder,
    packages,
    search_path,
    tasks,
    unread,
)
from .validate.settings import CertifySettings
from .work.typed import typed

T = TypeVar("T")

# --- tasks ------------------------------------------------------------------------------------


def load_task(name: str, search: Sequence[str] = ()) -> Task:
    """Load a task by its name.

    Args:
        name: name of its file without `.yaml`. Paths are refused: a name from a pool must not leave the task folders.
        search: further overrides, such as folders of other packages (`search_path`) or `task.horizon=20`.

    Raises:
        UnknownName: there is no such file.
        BadConfig: the search path is not made of overrides.
    """
    if bare := [search] if isinstance(search, str) else [text for text in search if "=" not in text]:
        raise BadConfig(f"search = {cut(bare[0])}; give a list of overrides, as in ['hydra.searchpath=FOLDER']")
    if name not in (known := tasks(search_path(search))):
        raise UnknownName("task", name, known)
    return _loaded(name, search) if search else _loaded_once(name, packages())


@cache
def _loaded_once(name: str, others: tuple[str, ...]) -> Task:
    """A task as its file defines it. It is read once, like the code of its family.

    Args:
        others: folders of other packages that offer tasks.
    """
    return _loaded(name, ())


def _loaded(name: str, overrides: Sequence[str]) -> Task:
    plain, choices = composed("one_task", [f"task={name}", *overrides])
    return task_of(choices["task"], plain["task"], overrides)


def task_of(name: str, node: Mapping[str, Any], overrides: Sequence[str]) -> Task:
    """Build a task from its composed file. An error in a file that does not come with scengen names the file.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    try:
        return load(name, node)
    except ScengenError as error:
        file = file_of_group(name, "task", overrides)
        changed = any(re.match(r"[+~]*task\.", text) for text in overrides)
        if file and not changed and not file.is_relative_to(conf_dir()):
            error.args = (f"{shown(file)}: {error}",)
        raise


# --- settings of certificates -----------------------------------------------------------------


def certify_levels(task: Task) -> dict[str, CertifySettings]:
    """Settings of the certificates of a task at each level of conf/certify, such as `quick`, by name of the level."""
    return {name: typed("certify", CertifySettings, certify_node({}, task, name)) for name in _names("certify")}


def certify_node(
    node: Mapping[str, Any], task: Task, level: str, verb: str = "", words: Sequence[str] = ()
) -> dict[str, Any]:
    """Settings of certificates as plain data: the file of the level, then those of the task, then the command line.

    Args:
        node: the composed settings, in which those of the task are not merged yet.
        level: name of a file in conf/certify, or in a folder certify/ of the search path.
        verb: the command, for a level of the search path.
        words: its command line.
    """
    base: dict[str, Any]
    if (file := conf_dir() / "certify" / f"{level}.yaml").is_file():
        base = OmegaConf.to_container(OmegaConf.load(file))  # type: ignore[assignment]
    else:
        base = composed(verb, [word for word in words if not re.match(r"[+~]*certify\.", word)])[0]["certify"]
    overrides = OmegaConf.create(_difference(node, base))
    return OmegaConf.to_container(OmegaConf.merge(base, OmegaConf.create(dict(task.certify)), overrides))  # type: ignore[return-value]


def _difference(node: Mapping[str, Any], base: Mapping[str, Any]) -> dict[str, Any]:
    """The entries of a mapping that differ from those of another one."""
    different = {}
    for key, value in node.items():
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping):
            different[key] = _difference(value, base[key])
        elif key not in base or base[key] != value:
            different[key] = value
    return different


# --- composition ------------------------------------------------------------------------------


def composed(verb: str, overrides: Sequence[str]) -> tuple[dict[str, Any], dict[str, str]]:
    """Compose the configuration of a command.

    Returns:
        The whole configuration as plain data, and the name of the file that was chosen in each group.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    with initialize_config_dir(str(config_dir(verb)), version_base="1.3", job_name="scengen"):
        try:
            prepared = _all_prepared(overrides)
            for text in prepared:
                _check_override(verb, text)
            prepared = _with_packages(prepared) if groups(verb) else prepared
            node = compose(config_name(verb, prepared), overrides=prepared, return_hydra_config=True)
            choices = {k: v for k, v in node.hydra.runtime.choices.items() if isinstance(v, str)}
            OmegaConf.set_struct(node, False)
            if EXPERIMENT in choices:
                files = [text for text in prepared if text.startswith(SEARCH_PATH)]
                files += [f"{group}={choices[group]}" for group in groups(verb) if group in choices]
                plain = compose(config_name(verb, prepared), overrides=files, return_hydra_config=True)
                _check_experiment(verb, choices[EXPERIMENT], node, plain, prepared)
            del node["hydra"]
            if EXPERIMENT in node and EXPERIMENT in choices:
                raise BadConfig(f"{EXPERIMENT}/{choices[EXPERIMENT]}.yaml: start it with `# @package _global_`")
            if EXPERIMENT in node:
                told = f"no folder of the search path has {EXPERIMENT}/{cut(str(node[EXPERIMENT]))}.yaml"
                raise BadConfig(f"{told}; give hydra.searchpath=FOLDER, the folder in which {EXPERIMENT}/ is")
            return OmegaConf.to_container(node, resolve=True), choices  # type: ignore[return-value]
        except (HydraException, OmegaConfBaseException) as error:
            raise _explained(verb, overrides, error) from None
        except yaml.YAMLError as error:
            raise BadConfig(f"a configuration file is not valid YAML: {_one_line(str(error))}; correct it") from None
        except (ValueError, TypeError, AssertionError, RecursionError) as error:  # Hydra checks little of its input
            raise BadConfig(f"{_one_line(str(error))}; see scengen {verb} --help") from None


def chosen_task(verb: str, overrides: Sequence[str]) -> str | None:
    """Name of the task that a command line chooses, for a command with an optional task; None if it chooses none.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    return composed(verb, overrides)[1].get("task")


def chosen_tasks(verb: str, overrides: Sequence[str]) -> list[str]:
    """Names of the tasks that a command line chooses, each once, for a command that accepts several.

    It chooses all if it names none.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    named = [text for text in overrides if text.startswith("task=")] or [f"task={ALL}"]
    asked = combinations(verb, [*named, *search_path(overrides)])
    return list(dict.fromkeys(name for one in asked if (name := chosen_task(verb, one.overrides))))


def config_dir(verb: str) -> Path:
    """The folder in which Hydra finds the file of a command and the groups from which it chooses files.

    A command without groups sees none: Hydra would take its setting `task` for a choice among the files of conf/task.
    """
    return conf_dir() if groups(verb) else conf_dir() / "command"


EXPERIMENT = "experiment"
"""Group of files with settings of people, in folders of the search path: `+experiment=heavy`."""


def config_name(verb: str, overrides: Sequence[str] = ()) -> str:
    """Name of the file of a command in its `config_dir`.

    Hydra looks for groups that overrides add (`+experiment=heavy`) in the folder of the file that it starts from, which
    must not be command/ then: a file of the same name in the folder above stands for it.
    """
    file = command_file(verb).stem
    if not groups(verb):
        return file
    if any(re.match(r"\+\w+=", text) for text in overrides):
        ConfigStore.instance().store(name=file, node={"defaults": [f"/command/{file}", SELF]})
        return file
    return f"command/{file}"


def as_yaml(verb: str, overrides: Sequence[str]) -> str:
    """The composed configuration of a command as YAML: `--cfg job`.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    plain, choices = composed(verb, overrides)
    if {"certify", "task"} <= choices.keys():
        plain["certify"] = certify_node(
            plain["certify"], task_of(choices["task"], plain["task"], overrides), choices["certify"], verb, overrides
        )
    flows = {key: None if isinstance(value, dict) else False for key, value in plain.items()}  # None: leaves in a line
    style = {"sort_keys": False, "allow_unicode": True, "width": 120}
    return "".join(yaml.safe_dump({key: plain[key]}, default_flow_style=flow, **style) for key, flow in flows.items())


def hydra_yaml(verb: str, overrides: Sequence[str]) -> str:
    """Hydra's own configuration of a command as YAML: `--cfg hydra`.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    composed(verb, overrides)
    with initialize_config_dir(str(config_dir(verb)), version_base="1.3", job_name="scengen"):
        prepared = _all_prepared(overrides)
        prepared = _with_packages(prepared) if groups(verb) else prepared
        node = compose(config_name(verb, prepared), overrides=prepared, return_hydra_config=True)
        OmegaConf.set_struct(node, False)
        return OmegaConf.to_yaml(OmegaConf.create({"hydra": OmegaConf.to_container(node.hydra, resolve=False)}))


def print_origin(verb: str, overrides: Sequence[str], topic: str) -> None:
    """Print where a configuration comes from, as Hydra does for `--info defaults`, for instance.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    if not topic:
        for each in ORIGINS[:-1]:  # the last one repeats the others, as Hydra's does
            print_origin(verb, overrides, each)
        return
    if topic not in ORIGINS:
        raise UnknownName("information of --info", topic, ORIGINS)
    composed(verb, overrides)
    with _logging_restored(), initialize_config_dir(str(config_dir(verb)), version_base="1.3", job_name="scengen"):
        prepared = _all_prepared(overrides)
        prepared = _with_packages(prepared) if groups(verb) else prepared
        GlobalHydra.instance().hydra.show_info(topic, config_name(verb, prepared), prepared)  # type: ignore[union-attr]


@contextmanager
def _logging_restored() -> Iterator[None]:
    """Restore the root logger, which Hydra sets up for its output."""
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    try:
        yield
    finally:
        root.handlers[:] = handlers
        root.setLevel(level)


# --- overrides --------------------------------------------------------------------------------

SWEEPING = ("generate", "demos")
"""Commands that take several values of a setting."""
JOINED = ("split", "perturb")
"""Settings whose parts are joined by `+`."""
LISTED = 5
"""Largest number of values that a message repeats."""
MAX_DIGITS = 4300
"""Number of digits of the longest number that Python reads."""
MAX_DEPTH = 20
"""Largest nesting of lists and groups in an override: more than any file of conf/ needs."""
LISTS = ("pool", "policy", "cameras", "mujoco", "apart", "data", "styles", "splits", "kinds")
"""Settings for which several values are a list and not a sweep. `keep` is always a list."""
PATHS = (
    *("pool", "apart", "data", "to", "film", "json", "junit", "hit", "hits", "results", "records", "ycb", "mesh"),
    *("policy", "client", "edition", "model", "device", "url", "title"),
)
"""Settings with paths, addresses or words of people, which are taken as they are: no letter in them means anything to
Hydra, except in a value that is quoted or a list in brackets."""
OPENING = {"{": "}", "[": "]"}
"""Brackets around groups and lists, each with the closing one."""
HYDRAS = re.compile(r"""'.*'|".*"|\[.*\]|\w+\(.*\)|null""", re.S)
"""Values that may be Hydra's: quoted ones, lists, functions such as `choice(a,b)`, and null."""


def _all_prepared(overrides: Sequence[str]) -> list[str]:
    """The overrides of a command line as Hydra reads them."""
    task = next((text.removeprefix("task=") for text in overrides if text.startswith("task=")), "${task}")
    return [_prepared(text, task) for text in overrides]


def _prepared(text: str, task: str = "${task}") -> str:
    """An override as Hydra reads it: paths and ids quoted, and brackets around the values of a setting that is a list.

    The value of `id` is quoted: `12e4` is the beginning of an id and not a number.

    Args:
        task: text for `${task}` in a path.
    """
    if text.startswith(SEARCH_PATH):
        return search_path([text])[0]
    key, given, value = text.partition("=")
    if key == "id" and value != "null" and re.fullmatch(r"[\w@+/]+", value, re.ASCII):
        return f"id='{value}'"
    if key in PATHS and given:
        value = value.replace("${task}", task)
        named = [value] if key not in LISTS or _is_hydras(value) else _split(value)
        whole = [path if _is_hydras(path) else _quote(_at_home(path)) for path in named]
        return f"{key}={whole[0]}" if len(whole) == 1 else f"{key}=[{','.join(whole)}]"
    is_list = key == "keep" or (key in LISTS and "," in value and value[:1] not in ("'", '"'))
    return f"{key}=[{value}]" if is_list and not value.startswith("[") else text


def _is_hydras(value: str) -> bool:
    """Whether a value of one of `PATHS` is meant for Hydra: no file has this name, and Hydra can read it."""
    if not HYDRAS.fullmatch(value) or os.path.exists(value) or (override := _parsed(f"key={value}")) is None:
        return False
    return not override.is_sweep_override() or override.value_type is not ValueType.SIMPLE_CHOICE_SWEEP


def _split(value: str) -> list[str]:
    """Paths of a list with commas. The longest part that exists is one of them: a comma may belong to a name."""
    parts, found = value.split(","), list[str]()
    while parts:
        longest = next((n for n in range(len(parts), 0, -1) if os.path.exists(",".join(parts[:n]))), 1)
        found.append(",".join(parts[:longest]))
        parts = parts[longest:]
    return found


def _at_home(path: str) -> str:
    """A path with the home folder for `~`, which shells leave after an `=`."""
    return os.path.expanduser(path) if path.startswith("~") and not os.path.exists(path) else path


def _quote(value: str) -> str:
    """A text in quotes as Hydra reads them: backslashes before a quote, or at the end, are doubled."""
    doubled = re.sub(r"(\\*)('|$)", lambda found: 2 * found[1] + ("\\'" if found[2] else ""), value)
    return f"'{doubled}'"


def _with_packages(overrides: Sequence[str]) -> list[str]:
    """Overrides that make Hydra search installed packages, too, after the folders that the overrides name."""
    named, others = search_path(overrides), [text for text in overrides if not text.startswith(SEARCH_PATH)]
    if not packages():
        return [*named, *others]
    values = [override.value() for text in named if (override := _parsed(text))]
    folders = [folder for value in values for folder in (value if isinstance(value, list) else [value])]
    return [f"hydra.searchpath=[{','.join([*map(str, folders), *packages()])}]", *others]


def _check_experiment(verb: str, experiment: str, node: DictConfig, plain: DictConfig, prepared: Sequence[str]) -> None:
    """Refuse an experiment with settings that the command lacks, or with those of Hydra, which would have no effect.

    Args:
        plain: the same configuration without the experiment.

    Raises:
        BadConfig: one line with the remedy.
    """
    added = {text.partition("=")[0].lstrip("+") for text in prepared if text.startswith("+")}
    if odd := [str(key) for key in node if key not in {*plain, *added, EXPERIMENT}]:
        told = UnknownName(f"setting of {verb}", odd[0], [str(key) for key in plain if key != "hydra"])
        raise BadConfig(f"{EXPERIMENT}/{experiment}.yaml: {told}")
    chosen, usual = (OmegaConf.to_container(each.hydra) for each in (node, plain))
    for key in ("mode", "run", "sweep", "launcher", "sweeper", "verbose", "env", "callbacks"):
        if chosen[key] != usual[key]:  # type: ignore[index]
            remedy = f"leave hydra.{key} out; {_instead_of(f'hydra.{key}')}"
            raise BadConfig(f"{EXPERIMENT}/{experiment}.yaml: {remedy}scengen accepts no setting of Hydra in a file")


def _check_override(verb: str, text: str) -> None:
    """Refuse overrides that scengen does not support, or that Hydra cannot process.

    Raises:
        BadConfig: one line with the remedy.
    """
    quoted = cut(repr(text))
    if _depth(text) > MAX_DEPTH:
        raise BadConfig(f"{quoted} is nested too deeply; quote it if the brackets are part of a name")
    override = _parsed(text)
    if override is None and re.search(rf"\d{{{MAX_DIGITS + 1}}}", text):
        raise BadConfig(f"{quoted} has a number of more than {MAX_DIGITS} digits; give a shorter one")
    if override is None or not override.key_or_group:
        raise BadConfig(f"{quoted} is not an override; expected key=value{_remedy(verb, text)}")
    key = override.key_or_group
    if override.package is not None:
        raise BadConfig(f"{quoted}: a setting has no package after @; see scengen {verb} --help")
    if override.is_sweep_override():
        raise BadConfig(f"{quoted} has multiple values; {_one_by_one(verb, override)}")
    if (
        key in JOINED
        and key in _known(verb)
        and isinstance(value := override.value(), list)
        and key not in _lists(verb)
    ):
        parts = [*map(str, value)]
        ways = [] if ID in parts else [f"parts are joined by +; give {key}={'+'.join(parts)}"]
        ways += [f"{key}={','.join(parts)} without brackets makes a run of each"] if verb in SWEEPING else []
        raise BadConfig(f"{quoted}: {'; '.join(ways) or 'give one of them'}")
    if key.split(".")[0].split("/")[0] == "hydra" and key != "hydra.searchpath":
        instead = _instead_of(key)
        raise BadConfig(f"{quoted}: leave it out; {instead}scengen accepts no setting of Hydra but hydra.searchpath")
    if override.is_delete() and (name := re.split("[./]", key)[0]) not in (known := _known(verb)):
        raise UnknownName(f"setting of {verb}", name, known)
    if override.is_delete() and not key.startswith("task."):
        raise BadConfig(f"{quoted}: {key} cannot be deleted; leave it out for its default, or give another value")
    if key == "hydra.searchpath":
        folders = override.value()
        for folder in folders if isinstance(folders, list) else [folders]:
            if not re.match(r"(file|pkg)://.", str(folder)):
                raise BadConfig(f"{quoted}: give a folder of configuration as file:///folder or pkg://package")
            if not is_folder(str(folder)):  # Hydra only warns, and goes on without it
                named = cut(str(folder).removeprefix("file://"))
                raise BadConfig(
                    f"hydra.searchpath: there is no folder {named}; give one that holds task/, certify/ or experiment/"
                )
            if why := unread(str(folder)):
                raise BadConfig(f"{quoted}: {why}")
    in_group = key in ("task", "certify", "executor") and key in groups(verb)
    if in_group and isinstance(value := override.value(), list) and value:
        raise BadConfig(f"{quoted} is a list; give {key}={','.join(map(str, value))} without brackets")
    if in_group and not re.fullmatch(r"\w+", str(override.value()), re.ASCII):
        raise BadConfig(f"{quoted}: expected the name of a file of conf/{key} without .yaml; {_files_of(key)}")
    if key in groups(verb) and override.value() is None:
        raise BadConfig(f"{quoted}: leave it out, or name a file of conf/{key}")


def _one_by_one(verb: str, override: Override) -> str:
    """What to give instead of several values of a setting, to a command that takes one."""
    key = override.get_key_element()
    if verb in SWEEPING:
        return "one combination is shown at a time; give one"
    if override.value_type is ValueType.SIMPLE_CHOICE_SWEEP and verb == "new":
        return "give one"
    try:
        values = list(itertools.islice(override.sweep_string_iterator(), MAX_COMBINATIONS))
    except HydraException:
        values = ["VALUE"]
    shown = [*map(shlex.quote, values[:LISTED]), *(["..."] if len(values) > LISTED else [])]
    target = next((f" {name}=NAME-$x" for name in ("to", "json") if name in _known(verb)), "")
    loop = f"for x in {' '.join(shown)}; do scengen {verb} ... {key}=$x{target}; done"
    return f"{verb} takes one at a time ({' and '.join(SWEEPING)} take several); repeat it: {loop}"


def _lists(verb: str) -> list[str]:
    """Names of the settings of a command that may be lists, by the default or the example in its file."""
    return re.findall(r"^(\w+):.*[\[]", command_file(verb).read_text(), re.M)


def _instead_of(key: str) -> str:
    """What to give instead of a setting of Hydra, with a semicolon; empty if nothing replaces it."""
    said = {
        "launcher": "workers=N uses the cores of this machine, executor=ray those of a cluster",
        "sweeper": "several values make a sweep, as in seed=1,2",
        "sweep": "several values make a sweep, as in seed=1,2, and pool= or to= names its folder",
        "run": "pool= or to= names the folder of the results",
    }
    instead = said.get(re.split("[./]", key)[1] if re.search("[./]", key) else "")
    return f"{instead}; " if instead else ""


def _known(verb: str) -> list[str]:
    """Names of the settings of a command, and of the groups from which it takes files."""
    own = re.findall(r"^(\w+):", command_file(verb).read_text(), re.M)
    return [*groups(verb), *(name for name in own if name != "defaults")]


def _remedy(verb: str, text: str) -> str:
    """The remedy for an override that Hydra cannot read: a name for a bare word, or quotes as a shell takes them."""
    parts = re.split(r"\s+(?=[+~]{0,2}[\w./]+=)", text)
    if len(parts) > 1 and all(map(_parsed, parts)):
        return f"; these are {len(parts)} settings: give {' '.join(map(shlex.quote, parts))}"
    key, given, value = text.partition("=")
    if value[:1] in OPENING:
        split = [closing for opening, closing in OPENING.items() if value.count(opening) > value.count(closing)]
        if split and value[-1] in (*OPENING.values(), "'"):
            return f"; a bracket is not closed: {split[0]} is missing"
        if split:
            return f"; a shell splits it at spaces: put all of it in single quotes, '{key}=...'"
        return '; put double quotes around texts within it, as in {why: "a; b"}'
    if key.startswith(("task.id.", "task.axes.")) and (call := re.fullmatch(r"(\w+)\((.*)\)", value)):
        return f"; give '{key}=[{call[1]},{call[2]}]'"
    fixed = f'{key}="{value}"'
    if given and len(text) < SHOWN_LENGTH and re.fullmatch(r"[\w.+]+", key) and _parsed(fixed):
        return f"; quote the value twice: {shlex.quote(fixed)}"
    if not given and "task" in groups(verb) and text in tasks():
        return f"; did you mean task={text}?"
    if not given and (named := [key for key in ("pool", "data") if key in _known(verb)]) and os.path.exists(text):
        return f"; did you mean {named[0]}={cut(text)}?"
    return f"; see scengen {verb} --help"


def _files_of(group: str) -> str:
    """Command that lists the files of a group, or their names."""
    return "see scengen tasks" if group == "task" else f"known: {', '.join(_names(group))}"


def _names(group: str) -> list[str]:
    return sorted(path.stem for path in (conf_dir() / group).glob("*.yaml"))


def _parsed(text: str, parser: OverridesParser | None = None) -> Override | None:
    """An override as Hydra reads it; None if Hydra cannot."""
    try:
        return (parser or OverridesParser.create()).parse_overrides([text])[0]
    except (HydraException, RecursionError, ValueError, TypeError):  # numbers of 5000 digits are a ValueError
        return None


def _depth(text: str) -> int:
    """Depth to which brackets are nested, quoted ones included."""
    deepest = depth = 0
    for letter in text:
        depth += (letter in "[{(") - (letter in "]})")
        deepest = max(deepest, depth)
    return deepest


# --- sweeps -----------------------------------------------------------------------------------

MAX_COMBINATIONS = 1000
"""Largest number of runs in one command line."""
ALL = "all"
"""Word for all tasks in `task=all`."""


@dataclass(frozen=True)
class Combination:
    """One of the command lines of a sweep."""

    overrides: tuple[str, ...]
    """Overrides with one value each."""
    swept: Mapping[str, str]
    """The settings with multiple values, and their value in this combination; empty without a sweep."""

    def __str__(self) -> str:
        return " ".join(f"{key}={value}" for key, value in self.swept.items())


def each_checked(requested: Sequence[Combination], look: Callable[[Combination], T], nothing: str) -> list[T]:
    """Apply a function to all combinations.

    Args:
        nothing: what a message says was not made.

    Raises:
        ScengenError: no combination is valid, for the same reason.
        BadConfig: a combination is not valid; the message names it.
    """
    results, errors = list[T](), dict[str, ScengenError]()
    for one in requested:
        try:
            results.append(look(one))
        except ScengenError as error:
            errors[str(one)] = error
    if not errors:
        return results
    first, error = next(iter(errors.items()))
    if len(errors) == len(requested) and len({*map(str, errors.values())}) == 1:
        raise error
    raise BadConfig(f"{first}: {error}; {nothing}; leave this combination out")


def combinations(verb: str, overrides: Sequence[str]) -> list[Combination]:
    """All combinations of a command line with multiple values: `n=1,2`, or Hydra's choice, range and glob.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    overrides = [_with_task_names(text) if verb != "new" else text for text in overrides]
    with initialize_config_dir(str(config_dir(verb)), version_base="1.3", job_name="scengen"):
        parser = OverridesParser.create(config_loader=GlobalHydra.instance().config_loader())
        try:
            choices = [_swept_values(parser, _prepared(text)) for text in overrides]
        except HydraException as error:
            raise BadConfig(f"{_one_line(str(error))}; see scengen {verb} --help") from None
    if (count := math.prod(len(values) for _, values in choices)) > MAX_COMBINATIONS:
        raise BadConfig(f"{count} combinations of settings; give at most {MAX_COMBINATIONS} at once")
    found = []
    for picked in itertools.product(*(values for _, values in choices)):
        swept = {key: v for (key, values), v in zip(choices, picked, strict=True) if key and len(values) > 1}
        line = (f"{key}={value}" if key else value for (key, _), value in zip(choices, picked, strict=True))
        found.append(Combination(tuple(line), swept))
    return found


def _swept_values(parser: OverridesParser, text: str) -> tuple[str, list[str]]:
    """Key and values of an override with multiple values; an empty key and the override itself otherwise."""
    override = _parsed(text, parser)
    if override is None or not override.is_sweep_override():
        return "", [text]
    values = list(itertools.islice(override.sweep_string_iterator(), MAX_COMBINATIONS + 1))
    if not values:
        raise BadConfig(f"{cut(repr(text))} has no value; give at least one")
    return override.get_key_element(), values


def _with_task_names(text: str) -> str:
    """An override of the task with the names of tasks instead of `all` and of categories, as in `task=P3,packing`."""
    key, _, value = text.partition("=")
    words = value.split(",")
    if key != "task" or not any(re.fullmatch(f"{ALL}|P[1-9]|M", word) for word in words):
        return text
    known = tasks()
    named = {word: known if word == ALL else [t for t in known if category(t) == word] for word in words}
    return f"task={','.join(dict.fromkeys(t for word, found in named.items() for t in found or [word]))}"


# --- errors -----------------------------------------------------------------------------------


def _explained(verb: str, overrides: Sequence[str], error: Exception) -> BadConfig | UnknownName:
    """Hydra's error as one line, with the nearest name."""
    text = str(error)
    if match := re.search(r"Could not find '(\w+)/([^']*)'", text):
        group, name = match.groups()
        return UnknownName(group, name, re.findall(r"^\s+(\S+)$", text, re.M))
    if match := re.search(r"In '([^']+)': Could not load '(\w+)/([^']*)'", text):
        file, group, name = match.groups()
        known = tasks(search_path(overrides)) if group == "task" else _names(group)
        return BadConfig(f"{cut(file)}.yaml, defaults: {UnknownName(group, name, known)}")
    if (match := re.match(r"force-add of config groups is not supported: '\+\+(.*)'", text)) or (
        match := next(filter(None, (re.match(f"({EXPERIMENT}=.*)", each) for each in overrides)), None)
    ):
        return BadConfig(f"{EXPERIMENT} is a group of your own files; give +{cut(match[1])}, with one plus")
    if match := re.search(r"You must specify '(\w+)'", text):
        known = ", ".join(re.findall(r"^\s+(\S+)$", text, re.M))
        return BadConfig(f"{verb} needs {match[1]}=NAME; known: {known}")
    if match := re.search(r"Could not override '([^']+)'", text):
        return _unknown_key(verb, overrides, match[1]) or BadConfig(f"{_one_line(text)}; see scengen {verb} --help")
    if match := re.match(r"Error merging override (.*)", text):
        return BadConfig(f"{cut(match[1])} is not a value of this setting; {_forms(match[1])}")
    if isinstance(error, OmegaConfBaseException):
        key = f"{error.full_key}: " if error.full_key else ""
        return BadConfig(f"{key}{_one_line(text.splitlines()[0])}; give the value itself")
    return BadConfig(f"{_one_line(text)}; see scengen {verb} --help")


def _forms(override: str) -> str:
    """What a setting accepts that cannot be merged with the value given."""
    if re.match(r"\+*task\.(id|axes)\.", override):
        return (
            "give a number, [uniform, low, high], [loguniform, low, high], [integer, low, high] or [choice, a, b, ...]"
        )
    return "give one value of the kind of its default"


def _unknown_key(verb: str, overrides: Sequence[str], path: str) -> UnknownName | BadConfig | None:
    """The error for the first key in the path of an override that the configuration does not have."""
    files = _with_packages([o for o in overrides if re.match(r"(task|certify|executor|hydra\.searchpath)=", o)])
    try:
        node: Any = compose(config_name(verb), overrides=files if groups(verb) else [])
    except HydraException:
        return None
    seen: list[str] = []
    for part in path.split("."):
        if not isinstance(node, DictConfig):
            whole = ".".join(seen)
            return BadConfig(f"{path}: {whole} has no settings in it; give {whole}=... alone")
        if not seen and part in groups(verb) and part not in node.keys():  # noqa: SIM118
            return BadConfig(f"{path}: no {part} is chosen; give {part}=NAME, too")
        if part not in node.keys():  # noqa: SIM118  (`in` leaves out what has no value yet)
            known = {*map(str, node), *([] if seen else groups(verb))}
            if seen == ["executor"] and not known:
                return BadConfig(f"{path} is a setting of executor=ray; give that, too")
            unknown = UnknownName(f"key in {'.'.join(seen)}" if seen else f"setting of {verb}", part, known)
            if seen == ["task", "axes"] and path.count(".") == 2:
                return BadConfig(f"{unknown}; +{path}={{why: ..., replace: {{...}}}} adds an axis")
            if seen[:2] == ["task", "id"]:  # a parameter that the task file does not list is nominal: it can be added
                return BadConfig(f"{unknown}; +{path}=... adds one")
            return unknown
        seen.append(part)
        node = None if OmegaConf.is_missing(node, part) else node[part]
    return None


def _one_line(text: str) -> str:
    return " ".join(text.split())[:300]
