"""write a package with a task that certifies as it is, to change into your own"""

import keyword
import re
import sys
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path

from ...conformance.rules import SNAKE_CASE
from ...errors import BadConfig, cut
from ...samplers import task_files
from ...samplers.task_files import shipped
from ...work.targets import foreign, try_folder, write
from . import OK, Arguments, say
from .settings import read

TEMPLATE = "task_template"
"""Folder that comes with scengen and is copied."""
TASK = "push_off"
"""Name of the task in the template that is copied."""
PACKAGE = "my_tasks"
"""Name of the package in the template that is copied."""
MAX_NAME = 60
"""Largest length of a name [characters]: a part of a path may have at most 255 bytes."""
RESERVED = {"task": ("all", "conf"), "package": ("conf", "scengen", "test", "tests")}
"""Names that the new package uses otherwise."""


@dataclass(frozen=True)
class NewSettings:
    """Settings of `scengen new`; conf/command/new.yaml explains them."""

    task: str
    package: str
    to: str | None

    def check(self) -> None:
        """Raise `BadConfig` for a name that Python or scengen cannot use, or that exists already."""
        for kind, name in (("task", self.task), ("package", self.package)):
            good = SNAKE_CASE.fullmatch(name) and not keyword.iskeyword(name) and len(name) <= MAX_NAME
            if not good or name in RESERVED[kind]:
                what = "in snake_case that neither Python nor the package reserves, such as push_off"
                raise BadConfig(f"{kind} = {cut(name)}; give a word of at most {MAX_NAME} letters {what}")
        if self.task in task_files.tasks():
            raise BadConfig(f"task = {self.task}; a task of that name exists; give another name, see scengen tasks")
        if self.package in sys.stdlib_module_names or self.package in packages_distributions():
            raise BadConfig(f"package = {self.package}; a package of that name is installed; give another name")


def command(arguments: Arguments) -> int:
    settings = read("new", arguments, NewSettings)
    settings.check()
    folder = Path(settings.to or settings.package)
    try_folder(folder)
    names, template = _names(settings.task, settings.package), shipped(TEMPLATE)
    copied = (path for path in sorted(template.rglob("*")) if path.is_file() and path.suffix in SUFFIXES)
    files = {
        _renamed(path.relative_to(template).as_posix(), names): _renamed(path.read_text(), names).encode()
        for path in copied
    }
    if other := foreign(folder, files):
        raise BadConfig(f"{cut(str(folder))} is not empty: it holds {cut(other)}; give a new folder as to=FOLDER")
    for name, content in files.items():
        write(folder / name, content)
    say(f"wrote the package {settings.package} with the task {settings.task}; continue with {folder / 'README.md'}")
    return OK


SUFFIXES = (".md", ".py", ".toml", ".yaml")
"""Suffixes of the files of the template. Files of Python and test tools next to them are not copied."""


def _names(task: str, package: str) -> dict[str, str]:
    """New names for those of the template, in each spelling that the template uses."""
    return {
        TASK: task,
        _hyphenated(TASK): _hyphenated(task),
        _class_name(TASK): _class_name(task),
        PACKAGE: package,
        _hyphenated(PACKAGE): _hyphenated(package),
    }


def _hyphenated(name: str) -> str:
    return name.replace("_", "-")


def _class_name(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def _renamed(text: str, names: dict[str, str]) -> str:
    """A text with all names replaced at once, so that a new name is not taken for another old one."""
    return re.sub("|".join(map(re.escape, names)), lambda found: names[found[0]], text)
