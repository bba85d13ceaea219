"""Locations of configuration files, and the contents of task files without an import of their families.

This is the fast path for commands that must answer quickly. Task files are in conf/task, in installed packages that
offer tasks, and in folders that a command line names.
"""

import filecmp
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import yaml

from ..errors import BadConfig, UnknownName, cut

PACKAGES = "scengen.tasks"
"""Group of entry points with which an installed package offers tasks: `any_name = "my_package.conf"` names a folder in
it that holds `task/<task>.yaml` or kinds of perturbation."""
OFFERED = ("task", "perturbations")
"""Folders of which a package offers one at least."""
OF_TASKS = ("facts", "language", "things")
"""Folders next to `task` whose files belong to the tasks of these names."""
ID = "id"
"""Name of the training split."""
EMBODIMENT = "panda_jaw"
"""Default robot of a task: one arm with a jaw."""
SEARCH_PATH = "hydra.searchpath="
"""Override that adds folders of configuration."""
SELF = "_self_"
"""Word for the file itself in the list `defaults` of a file."""
ORIGINS = ("defaults", "defaults-tree", "searchpath", "config")
"""Topics of Hydra's --info that are supported: the files in order or as a tree, the folders, and everything."""


@cache
def conf_dir() -> Path:
    """The folder of configuration files: inside an installed package, next to it in a checkout."""
    return shipped("conf")


def shipped(name: str) -> Path:
    """A folder that comes with scengen: inside an installed package, next to it in a checkout.

    Raises:
        BadConfig: the folder is missing.
    """
    here = Path(__file__).parents[1]
    found = next((d for d in (here / name, here.parent / name) if d.is_dir()), None)
    if found is None:
        raise BadConfig(f"the {name}/ folder is missing from this installation; install scengen again")
    return found


@cache
def packages() -> tuple[str, ...]:
    """Configuration folders of installed packages that offer tasks (`PACKAGES`), in Hydra's spelling.

    Raises:
        BadConfig: a package offers a folder that does not exist.
    """
    return tuple(sorted(f"file://{_offered(point)}" for point in entry_points(group=PACKAGES)))


def _offered(point: EntryPoint) -> str:
    """The folder that an entry point names."""
    try:
        found = find_spec(point.value)
    except (ImportError, ValueError):
        found = None
    folders = (found and found.submodule_search_locations) or ()
    for folder in folders:
        if any(Path(folder, group).is_dir() for group in OFFERED):
            return folder
    whose = point.dist.name if point.dist else point.name
    raise BadConfig(
        f"the package {whose} offers tasks in {point.value}/task, which does not exist; reinstall or remove the package"
    )


def command_file(verb: str) -> Path:
    """The file with the settings of a command."""
    return conf_dir() / "command" / f"{verb.replace(' ', '_')}.yaml"


def groups(verb: str) -> list[str]:
    """Groups from which a command line may choose a file, such as `task`."""
    return re.findall(r"^ +- /(\w+):", command_file(verb).read_text(), re.M)


def search_path(overrides: Sequence[str]) -> tuple[str, ...]:
    """The overrides that add folders of other packages, `hydra.searchpath=[file:///path/to/conf]`, with whole paths.

    Plain paths are accepted: `hydra.searchpath=conf,../other/conf`.
    """
    return tuple(_whole(o) for o in overrides if o.startswith(SEARCH_PATH))


def _whole(override: str) -> str:
    """An override of the search path with the scheme, the whole path and the quotes that Hydra needs."""
    folders = [each.strip(" '\"") for each in override.removeprefix(SEARCH_PATH).strip("[] ").split(",")]
    whole = (f if re.match(r"(file|pkg)://", f) else f"file://{Path(f).expanduser().resolve()}" for f in folders if f)
    return f"{SEARCH_PATH}[{','.join(map(repr, whole))}]"


def tasks(search: Sequence[str] = ()) -> list[str]:
    """Names of all task files, including those of other packages (`packages`, `search_path`)."""
    return sorted(_files(tuple(search)))


def splits(name: str, search: Sequence[str] = ()) -> tuple[str, ...]:
    """The splits that a task file names.

    Raises:
        UnknownName: there is no such file.
        BadConfig: the file is not YAML.
    """
    return (ID, *(_head(name, tuple(search)).get("axes") or ()))


def facts_file(name: str, search: Sequence[str] = ()) -> Path | None:
    """The file with the questions and sub-goals of a task, see `file_of_group`."""
    return file_of_group(name, "facts", search)


def file_of_group(name: str, group: str, search: Sequence[str] = ()) -> Path | None:
    """The file of a task in another group, such as `facts/<task>.yaml` next to the folder of its task file.

    None if it has none.
    """
    path = _files(tuple(search)).get(name)
    found = path.parents[1] / group / path.name if path else None
    return found if found and found.is_file() else None


def conf_of(name: str, search: Sequence[str] = ()) -> Path | None:
    """The folder of configuration files that a task is from; None if there is no such task."""
    path = _files(tuple(search)).get(name)
    return path.parents[1] if path else None


def behaviour_file(name: str, search: Sequence[str] = ()) -> Path:
    """The file with the stored behaviour of a task, `behaviour/<task>.json` next to the folder of its task file.

    Raises:
        UnknownName: there is no such task.
    """
    files = _files(tuple(search))
    if name not in files:
        raise UnknownName("task", name, files)
    return files[name].parents[1] / "behaviour" / f"{name}.json"


def version(name: str, search: Sequence[str] = ()) -> int:
    """Version of a task: the `VERSION` that the class of its family states in its file, which is not imported; else 1.

    A module that cannot be found is version 1, too; loading the task raises the error.

    Raises:
        UnknownName: there is no such file.
        BadConfig: the file is not YAML.
    """
    module, _, family = str(_head(name, tuple(search)).get("family")).rpartition(".")
    try:
        found = find_spec(module)
    except (ImportError, ValueError):
        found = None
    return _stated_version(found.origin, family) if found and found.origin else 1


@cache
def _stated_version(path: str, family: str) -> int:
    """The `VERSION` of a class in a Python file; 1 if it states none. Parsing the files of all tasks takes 0.3 s."""
    of_class = re.search(rf"^class {family}\b.*?(?=^class |\Z)", Path(path).read_text(), re.M | re.S)
    stated = of_class and re.search(r"^    VERSION\b[^=\n]*=\s*(\d+)\s*$", of_class[0], re.M)
    return int(stated[1]) if stated else 1


@dataclass(frozen=True)
class About:
    """Description of a task in its file; fields as in `samplers.task.Task`."""

    name: str
    """Name of the task."""
    code: str
    """Number in the paper, such as T17; X1 and so on for a task of our own."""
    category: str
    """Category: P1 to P7 or M as in the paper, X for a task of our own."""
    instruction: str
    """Instruction for a policy."""
    embodiment: str
    """Robot of the task, one of `sim.embodiment.EMBODIMENTS`."""
    axes: tuple[str, ...]
    """Names of its OOD axes."""
    paper_axes: tuple[str, ...]
    """Names of those axes that are the paper's, see `paper_source`."""


def about(name: str, search: Sequence[str] = ()) -> About:
    """Read the description of a task from its file. It is validated only when the task is loaded.

    Raises:
        UnknownName: there is no such file.
        BadConfig: the file is not YAML, or lacks a key.
    """
    head = _head(name, tuple(search))
    words = {key: head.get(key) for key in ("code", "category", "instruction")}
    if missing := [key for key, value in words.items() if value is None]:
        raise BadConfig(f"task {name} lacks {', '.join(missing)}; give it")
    axes = head.get("axes") or {}
    if not isinstance(axes, Mapping):
        raise BadConfig(f"{name}.axes = {cut(repr(axes))}; expected a group of settings, {{name: value}}")
    source = paper_source(name, str(words["category"]))
    of_paper = [axis for axis, node in axes.items() if isinstance(node, Mapping) and node.get("source") == source]
    values = {key: str(value) for key, value in words.items()}
    return About(
        name, **values, embodiment=str(head.get("embodiment", EMBODIMENT)), axes=(*axes,), paper_axes=(*of_paper,)
    )


def paper_source(name: str, category: str) -> str:
    """Source of an axis that the paper's table of OOD conditions (App. I) has for a task."""
    return f"paper, App. I, {category} {name.replace('_', '-')}"


def category(name: str) -> str:
    """Category of a task, from its file."""
    return str(_head(name).get("category"))


def paper_lengths() -> dict[str, float]:
    """Mean lengths of the paper's demonstrations by task [s]: conf/paper_lengths.yaml."""
    found: dict[str, float] = yaml.safe_load((conf_dir() / "paper_lengths.yaml").read_text())
    return found


def _files(search: tuple[str, ...]) -> dict[str, Path]:
    """The file of each task. Among files of the same name, the one that Hydra uses."""
    named = [_plain(each) for text in search_path(search) for each in text.partition("=")[2].strip("[]").split(",")]
    offered = [folder.removeprefix("file://") for folder in packages()]
    folders = [conf_dir(), *(Path(folder) for folder in [*named, *offered] if folder)]
    paths = (path for folder in reversed(folders) for path in sorted((folder / "task").glob("*.yaml")))
    return {path.stem: path for path in paths if path.is_file()}  # Hydra passes over pipes and devices, too


def _plain(folder: str) -> str:
    """Path of a folder that Hydra spells with a scheme; empty if the folder does not exist."""
    scheme, _, rest = folder.strip(" '\"").partition("://")
    if scheme != "pkg":
        return rest
    try:
        spec = find_spec(rest.replace("/", "."))
    except (ImportError, ValueError):
        spec = None
    return next(iter((spec and spec.submodule_search_locations) or [""]))


def is_folder(folder: str) -> bool:
    """Whether a folder that Hydra spells with a scheme exists."""
    path = _plain(folder)
    return bool(path) and Path(path).is_dir()


def unread(folder: str) -> str:
    """A file in a folder of a search path that no command would read, and why; empty if there is none."""
    here, home = Path(_plain(folder)), conf_dir()
    for path in sorted(here.glob("*/*.yaml")):
        group, name = path.parent.name, path.stem
        shadow, of_task = home / group / path.name, group in ("task", *OF_TASKS)
        if shadow.is_file() and path.is_file() and filecmp.cmp(shadow, path, shallow=False):
            continue
        if of_task and (home / "task" / path.name).is_file():
            own = f"name it after a task of your own, which `defaults: [{name}, _self_]` continues"
            return f"{path} would not be read, scengen's task {name} has its own files; {own}"
        if shadow.is_file():
            return f"{path} would not be read, scengen has a file of that name; give it another name"
        if group in OF_TASKS and not (here / "task" / path.name).is_file():
            return f"{path} would not be read, its folder has no task/{path.name}; name it after a task there"
        if group == "perturbations":
            return f"{path} would not be read; offer the folder by an installed package, see docs/perturb.md"
    return ""


MAX_TASK_FILE = 1_000_000
"""Size of the largest task file that is read [bytes]; those of conf/task have up to 10 kB."""
MAX_BASES = 20
"""Largest number of task files of which each continues the next one."""


@cache
def _head(name: str, search: tuple[str, ...] = (), depth: int = 0) -> Mapping[str, Any]:
    """Contents of a task file, on top of the files that its `defaults` name, as Hydra composes them."""
    files = _files(search)
    if name not in files:
        raise UnknownName("task", name, files)
    if depth > MAX_BASES:
        raise BadConfig(f"{files[name]} is its own base; name other files in its defaults")
    if (size := files[name].stat().st_size) > MAX_TASK_FILE:
        raise BadConfig(f"{files[name]} has {size} bytes; a task file has at most {MAX_TASK_FILE}")
    try:
        plain = dict(yaml.load(files[name].read_text(), getattr(yaml, "CSafeLoader", yaml.SafeLoader)))
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise BadConfig(f"{files[name]} is not YAML: {' '.join(str(error).split())[:300]}; correct it") from None
    bases = plain.pop("defaults", None) or []
    if not isinstance(bases, list) or not all(isinstance(base, str) for base in bases):
        raise BadConfig(f"{files[name]}: defaults = {cut(repr(bases))}; expected a list of tasks, and _self_")
    if SELF not in bases:
        bases.append(SELF)
    found: dict[str, Any] = {}
    for base in bases:
        found = _over(found, plain if base == SELF else _head(base.removeprefix("/task/"), search, depth + 1))
    return found


def _over(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """A group of settings on top of another one: groups within them are merged, other values are replaced."""
    merged = dict(below)
    for key, value in above.items():
        under = merged.get(key)
        merged[key] = _over(under, value) if isinstance(value, Mapping) and isinstance(under, Mapping) else value
    return merged
