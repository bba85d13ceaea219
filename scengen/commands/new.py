"""write a package with a task that certifies as it is, to change into your own"""

import keyword
import re
import sys
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path

from .. import task_files
from ..conformance.rules import SNAKE_CASE
from ..errors import BadConfig, cut
from ..task_files import shipped
from ..work.targets import try_folder, write
from . import OK, Arguments, say
from .settings import read

TASK, PACKAGE = "push_off", "my_tasks"
"""Names in the example that is copied."""
LONGEST = 60
"""Letters of a name: no part of a path may have more than 255 bytes."""
TAKEN = {"task": ("conf",), "package": ("conf", "scengen", "test", "tests")}
"""Names that the new package needs for something else."""


@dataclass(frozen=True)
class NewSettings:
    """Settings of `scengen new`; conf/command/new.yaml explains them."""

    task: str
    package: str
    to: str | None

    def check(self) -> None:
        """Raise `BadConfig` for a name that Python or scengen cannot use, or that is in use."""
        for kind, name in (("task", self.task), ("package", self.package)):
            good = SNAKE_CASE.fullmatch(name) and not keyword.iskeyword(name) and len(name) <= LONGEST
            if not good or name in TAKEN[kind]:
                what = "in snake_case that neither Python nor the package needs, such as push_off"
                raise BadConfig(f"{kind} = {cut(name)}; give a word of {LONGEST} letters at most, {what}")
        if self.task in task_files.tasks():
            raise BadConfig(f"task = {self.task}; there is a task of that name already, see scengen tasks")
        if self.package in sys.stdlib_module_names or self.package in packages_distributions():
            raise BadConfig(f"package = {self.package}; a package of that name is installed already, give another name")


def command(arguments: Arguments) -> int:
    settings = read("new", arguments, NewSettings)
    settings.check()
    folder = Path(settings.to or settings.package)
    try_folder(folder)
    if folder.is_dir() and any(folder.iterdir()):
        raise BadConfig(f"{cut(str(folder))} is not empty; name a new folder with to=FOLDER")
    names = _names(settings.task, settings.package)
    example = shipped("example")
    for path in sorted(example.rglob("*")):
        if path.is_file() and path.suffix in SUFFIXES:
            write(folder / _renamed(str(path.relative_to(example)), names), _renamed(path.read_text(), names))
    say(f"wrote the package {settings.package} with the task {settings.task}; go on with {folder / 'README.md'}")
    return OK


SUFFIXES = (".md", ".py", ".toml", ".yaml")
"""Of the files of the example; what Python and test tools leave beside them is not copied."""


def _names(task: str, package: str) -> dict[str, str]:
    """What takes the place of the example's names, in each of the spellings in which they stand there."""
    return {
        TASK: task,
        _spoken(TASK): _spoken(task),
        _class(TASK): _class(task),
        PACKAGE: package,
        _spoken(PACKAGE): _spoken(package),
    }


def _spoken(name: str) -> str:
    return name.replace("_", "-")


def _class(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def _renamed(text: str, names: dict[str, str]) -> str:
    """All names replaced at once, so that a new one is not taken for another old one."""
    return re.sub("|".join(map(re.escape, names)), lambda found: names[found[0]], text)
