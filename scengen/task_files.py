"""Where configuration lies, and what task files say without a look at their families: for what has to be quick.

Files of tasks lie in conf/task, in installed packages that offer some, and in folders that a command line names.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import yaml

from .errors import BadConfig, UnknownName, cut

PACKAGES = "scengen.tasks"
"""Group of entry points with which an installed package offers tasks: `any_name = "my_package.conf"` names a folder
in it that holds `task/<task>.yaml`."""
ID = "id"
"""Name of the split that policies train on."""
EMBODIMENT = "panda_jaw"
"""The robot of a task whose file names none: one arm with a jaw."""
ORIGINS = ("defaults", "defaults-tree", "searchpath", "config")
"""What Hydra's --info tells here: which file gives what, in order or as a tree; the folders; and all of it."""


@cache
def conf_dir() -> Path:
    """The folder of configuration files: inside an installed package, beside it in a checkout."""
    return shipped("conf")


def shipped(name: str) -> Path:
    """A folder that comes with scengen: inside an installed package, beside it in a checkout.

    Raises:
        BadConfig: it is missing.
    """
    here = Path(__file__).parent
    found = next((d for d in (here / name, here.parent / name) if d.is_dir()), None)
    if found is None:
        raise BadConfig(f"the {name}/ folder is missing from this installation; install scengen again")
    return found


@cache
def packages() -> tuple[str, ...]:
    """Folders of configuration of installed packages that offer tasks (`PACKAGES`), as Hydra writes them.

    Raises:
        BadConfig: a package offers a folder that is not there.
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
        if Path(folder, "task").is_dir():
            return folder
    whose = point.dist.name if point.dist else point.name
    raise BadConfig(f"the package {whose} offers tasks in {point.value}/task, which is not there; mend or remove it")


def groups(verb: str) -> list[str]:
    """Groups from which a command line may choose a file, such as `task`."""
    return re.findall(r"^ +- /(\w+):", (conf_dir() / "command" / f"{verb}.yaml").read_text(), re.M)


def search_path(overrides: Sequence[str]) -> tuple[str, ...]:
    """Those overrides that add folders of other packages, `hydra.searchpath=[file:///path/to/conf]`."""
    return tuple(o for o in overrides if o.startswith("hydra.searchpath="))


def tasks(search: Sequence[str] = ()) -> list[str]:
    """Names of all task files, those of other packages included (`packages`, `search_path`)."""
    return sorted(_files(tuple(search)))


def splits(name: str, search: Sequence[str] = ()) -> tuple[str, ...]:
    """The splits that the file of a task names.

    Raises:
        UnknownName: there is no such file.
        BadConfig: it is no YAML.
    """
    return (ID, *(_head(name, tuple(search)).get("axes") or ()))


@dataclass(frozen=True)
class About:
    """What the file of a task says of it in words; fields as in `samplers.task.Task`."""

    name: str
    code: str
    category: str
    instruction: str
    embodiment: str
    axes: tuple[str, ...]
    paper_axes: tuple[str, ...]
    """Those of them that are the paper's, see `paper_source`."""


def about(name: str, search: Sequence[str] = ()) -> About:
    """What the file of a task says of it. Whether that makes sense, shows when the task is loaded.

    Raises:
        UnknownName: there is no such file.
        BadConfig: it is no YAML, or lacks something.
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
    told = {key: str(value) for key, value in words.items()}
    return About(
        name, **told, embodiment=str(head.get("embodiment", EMBODIMENT)), axes=(*axes,), paper_axes=(*of_paper,)
    )


def paper_source(name: str, category: str) -> str:
    """The source of an axis that the paper's table of OOD conditions (App. I) has for a task."""
    return f"paper, App. I, {category} {name.replace('_', '-')}"


def category(name: str) -> str:
    """The category of a task, as its file names it."""
    return str(_head(name).get("category"))


def certified() -> dict[str, dict[str, dict[str, Any]]]:
    """What certification came to when the tasks were measured: conf/certified.yaml.

    Returns:
        By task and split: `indices` tried, `certified` among them at level quick, `cpu` [s] for each that was, and what
        else the head of the file tells.
    """
    found: dict[str, dict[str, dict[str, Any]]] = yaml.safe_load((conf_dir() / "certified.yaml").read_text())
    return found


def _files(search: tuple[str, ...]) -> dict[str, Path]:
    """The file of each task; of several with the same name the one that Hydra takes."""
    named = [_plain(each) for text in search_path(search) for each in text.partition("=")[2].strip("[]").split(",")]
    offered = [folder.removeprefix("file://") for folder in packages()]
    folders = [conf_dir(), *(Path(folder) for folder in [*named, *offered] if folder)]
    return {path.stem: path for folder in reversed(folders) for path in sorted((folder / "task").glob("*.yaml"))}


def _plain(folder: str) -> str:
    """A folder as a path, of which Hydra is told with its scheme; nothing if there is none."""
    scheme, _, rest = folder.strip(" '\"").partition("://")
    if scheme != "pkg":
        return rest
    spec = find_spec(rest.replace("/", "."))
    return next(iter((spec and spec.submodule_search_locations) or [""]))


@cache
def _head(name: str, search: tuple[str, ...] = ()) -> Mapping[str, Any]:
    """What a task file says, as it stands there."""
    files = _files(search)
    if name not in files:
        raise UnknownName("task", name, files)
    try:
        plain = yaml.load(files[name].read_text(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
        return dict(plain)
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise BadConfig(f"{files[name]} is no YAML: {' '.join(str(error).split())[:300]}; correct it") from None
