"""Editions: frozen sets of evaluation scenarios, so that results of several laboratories are about the same scenes.

A file such as conf/editions/v1.yaml names, for each set (a task and a split), the scenarios by their index, id and hash
of the scene. A set is what `generate` certifies first from the edition's seed. It is written once and never changed: a
later version of scengen that draws or builds something else is refused, and needs another edition.
"""

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..compose import certify_levels, load_task
from ..errors import BadConfig, Infeasible, PoolError, UnknownName, cut
from ..installation import versions
from ..pool import Pool
from ..pool.manifest import MANIFEST
from ..runs.generate import GenerateSettings, generate
from ..samplers.split import ID
from ..samplers.task import Task
from ..samplers.task_files import about, conf_dir, tasks
from ..sim import scene_text
from ..validate.rebuilt import portable_sha256, rebuild
from ..work.parallel import Workers
from ..work.plain import read_yaml
from ..work.targets import write
from ..work.typed import typed

FORMAT = 2
"""Format of the file."""
SCENARIOS = 20
"""Number of scenarios of each set of a new edition, as in the paper's evaluation."""
SEED = 4500
"""Seed of a new edition: none that people take for training, so that demonstrations of the seeds 0, 1, 2 share nothing
with it."""
LEVEL = "quick"
"""Level of the certificates of a new edition."""
FOLDER = Path("generated/editions")
"""Folder of the pools of editions."""
LINE = re.compile(r"(0|[1-9][0-9]{0,8}) ([0-9a-f]{12}) ([0-9a-f]{64})")
"""A scenario in the file: its index, its id, and the hash of its scene (`portable_sha256`)."""
HEAD = """# Frozen evaluation scenarios, written by `scengen edition write=true`. A set that is released never changes.
# task_versions: version of each task when its first set was frozen.
# sets: <task>/<split>: lines of index, id, and hash of the scene, whose numbers are rounded to 9 digits. They are the
# first n indices of the seed that were certified at this level by these versions.
"""


@dataclass(frozen=True)
class Frozen:
    """A scenario of an edition."""

    index: int
    """Index of the draw."""
    id: str
    """Id of the scenario."""
    scene_sha256: str
    """Hash of the scene, see `portable_sha256`."""

    def __str__(self) -> str:
        return f"{self.index} {self.id} {self.scene_sha256}"

    @classmethod
    def parse(cls, line: str, where: str) -> "Frozen":
        """The scenario of a line.

        Raises:
            BadConfig: it is not one.
        """
        found = LINE.fullmatch(line)
        if not found:
            raise BadConfig(f"{where}: {cut(line)!r} is not a scenario; it must be an index, an id and a sha256")
        return cls(int(found[1]), found[2], found[3])


@dataclass(frozen=True)
class EditionFile:
    """Contents of the file."""

    format: int
    seed: int
    n: int
    level: str
    made_with: Mapping[str, str]
    task_versions: Mapping[str, int]
    sets: Mapping[str, list[str]]


@dataclass(frozen=True)
class Edition:
    """A frozen set of scenarios for evaluation."""

    name: str
    """Name of the edition, that of its file."""
    path: Path
    """The file."""
    seed: int
    """Seed of the draws."""
    n: int
    """Number of scenarios of each set."""
    level: str
    """Level of the certificates."""
    made_with: Mapping[str, str]
    """Versions with which the first set was certified."""
    task_versions: Mapping[str, int]
    """Version of each task of which the edition has a set."""
    sets: Mapping[str, tuple[Frozen, ...]]
    """Scenarios of each set, by `<task>/<split>`."""

    @classmethod
    def new(cls, path: Path) -> "Edition":
        """An edition without sets."""
        made_with = {name: version for name, version in versions().items() if name != "platform"}
        return cls(path.stem, path, SEED, SCENARIOS, LEVEL, made_with, {}, {})

    @classmethod
    def read(cls, name: str) -> "Edition":
        """The edition of that name, or of your own file.

        Raises:
            ScengenError: there is no such file, or it is not an edition.
        """
        path = path_of(name)
        if not path.exists() or path.is_dir():
            known = sorted(file.stem for file in (conf_dir() / "editions").glob("*.yaml"))
            if "," in name:
                raise BadConfig(f"edition = {cut(name)}; give one of them, and repeat the command for the others")
            raise UnknownName("edition", name, [*known, "FILE.yaml"])
        node = read_yaml("edition", path)
        if (given := node.get("format")) != FORMAT:
            given = cut(repr(given), 20)
            raise BadConfig(
                f"{path} has format {given}; this version reads format {FORMAT}; install the scengen of the other"
            )
        told = typed(str(path), EditionFile, node, exact=True)
        if told.level not in (levels := sorted(file.stem for file in (conf_dir() / "certify").glob("*.yaml"))):
            raise UnknownName(f"level of {path}", told.level, levels)
        sets = {key: tuple(Frozen.parse(line, f"{path}, {key}") for line in lines) for key, lines in told.sets.items()}
        for key, scenarios in sets.items():
            indices = [scenario.index for scenario in scenarios]
            if len(indices) != told.n or sorted(set(indices)) != indices or key.count("/") != 1:
                raise BadConfig(f"{path}: set {cut(key)} must have {told.n} scenarios with rising indices")
        if {split_of(key)[0] for key in sets} != told.task_versions.keys():
            raise BadConfig(f"{path}: task_versions must have the tasks of the sets, and no others")
        return cls(path.stem, path, told.seed, told.n, told.level, told.made_with, told.task_versions, sets)

    @property
    def text(self) -> str:
        """The text of the file."""
        head = f"format: {FORMAT}\nseed: {self.seed}\nn: {self.n}\nlevel: {self.level}\nmade_with:\n"
        made = "".join(f"  {name}: '{version}'\n" for name, version in self.made_with.items())
        told = "".join(f"  {task}: {version}\n" for task, version in sorted(self.task_versions.items()))
        versions = f"task_versions:\n{told}" if told else "task_versions: {}\n"
        order = {key: number for number, key in enumerate(wanted_sets())}
        lines = ["sets:\n" if self.sets else "sets: {}\n"]
        for key in sorted(self.sets, key=lambda key: (order.get(key, len(order)), key)):
            lines += [f"  {key}:\n", *(f"  - {scenario}\n" for scenario in self.sets[key])]
        return HEAD + head + made + versions + "".join(lines)

    @property
    def sha256(self) -> str:
        """Hash of everything in the edition."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def scenarios(self, key: str) -> tuple[Frozen, ...]:
        """The scenarios of a set.

        Raises:
            UnknownName: the edition has no such set.
        """
        if key not in self.sets:
            raise UnknownName(f"set of edition {self.name}", key, self.sets)
        return self.sets[key]

    def pool_folder(self, key: str) -> Path:
        """Folder of the pool of a set."""
        return FOLDER / self.name / key.replace("/", "-")

    def with_set(self, key: str, pool: Pool) -> "Edition":
        """The edition with one more set, that of a finished pool.

        Raises:
            BadConfig: its sets of the same task are of another version.
        """
        task = load_task(split_of(key)[0])
        for other in self.other_versions(there for there in self.sets if split_of(there)[0] == task.name):
            raise BadConfig(f"{other}; a task has one version in an edition: write another one")
        task_versions = {**self.task_versions, task.name: task.version}
        return replace(self, task_versions=task_versions, sets={**self.sets, key: tuple(frozen(pool))})

    def other_versions(self, keys: Iterable[str]) -> Iterator[str]:
        """A line for each task of some sets that was frozen at a different version than the installed one.

        Raises:
            UnknownName: there is no such task.
        """
        for name in dict.fromkeys(split_of(key)[0] for key in keys if key in self.sets):
            if other := load_task(name).other_version("frozen at", self.task_versions[name]):
                yield f"edition {self.name} is {other}"

    def save(self) -> None:
        """Write the file.

        Raises:
            ScengenError: it cannot be written.
        """
        write(self.path, self.text)


def path_of(name: str) -> Path:
    """The file of an edition: of that name in conf/editions, or your own file, whose name ends with `.yaml`."""
    return Path(name) if name.endswith(".yaml") else conf_dir() / "editions" / f"{name}.yaml"


def wanted_sets() -> list[str]:
    """The sets of a complete edition: every task in distribution, and the OOD conditions of the paper's App. I."""
    return [f"{task}/{split}" for task in tasks() for split in (ID, *about(task).paper_axes)]


def chosen_sets(chosen: str | list[str] | None) -> list[str]:
    """The sets of some tasks, given by their names, separated by commas or as a list; None for all.

    Raises:
        UnknownName: there is no such task.
    """
    names = chosen.split(",") if isinstance(chosen, str) else chosen
    for name in names or ():
        if name not in (known := tasks()):
            raise UnknownName("task", name, known)
    return [key for key in wanted_sets() if names is None or split_of(key)[0] in names]


def split_of(key: str) -> tuple[str, str]:
    """Task and split of a set."""
    task, _, split = key.partition("/")
    return task, split


def frozen(pool: Pool) -> Iterator[Frozen]:
    """The scenarios of a pool as an edition names them.

    Raises:
        BadConfig: the text of a scene is not MJCF.
    """
    for index, id_, scene in pool.columns("index", "id", "scene_xml"):
        scene_text.check(scene)
        yield Frozen(index, id_, portable_sha256(scene))


def differences(edition: Edition, key: str) -> Iterator[str]:
    """Differences of the draws or scenes of this version from a set, as text; certificates are not made again.

    Raises:
        ScengenError: there is no such task or split.
    """
    name, split = split_of(key)
    task = load_task(name)
    for scenario in edition.scenarios(key):
        where = f"{key}, index {scenario.index}"
        try:
            drawn = task.draw(split, edition.seed, scenario.index).scenario
        except Infeasible as error:
            yield f"{where}: {scenario.id} in the edition, nothing feasible here ({error})"
            continue
        if drawn.id != scenario.id:
            yield f"{where}: {scenario.id} in the edition, {drawn.id} is drawn here"
        elif portable_sha256(rebuild(drawn)) != scenario.scene_sha256:
            yield f"{where}: the scene of {scenario.id} is built otherwise here"


def check_pool(edition: Edition, pool: Pool) -> str:
    """The set of a pool, which must hold the scenarios of the edition and no other ones.

    Raises:
        PoolError: it does not.
    """
    keys = sorted({f"{task}/{split}" for task, split in pool.columns("task", "split")})
    if len(keys) != 1:
        raise PoolError(
            f"{pool.folder} holds {', '.join(keys) or 'nothing'}; a set of an edition is one task and split"
        )
    (key,) = keys
    here, there = list(frozen(pool)), list(edition.scenarios(key))
    if here == there:
        return key
    other = next((pair for pair in zip(here, there, strict=False) if pair[0] != pair[1]), None)
    what = f"it has {len(here)} scenarios, the edition {len(there)}"
    if other:
        a, b = other
        what = f"index {a.index} is {a.id}, the edition has index {b.index}, {b.id}"
        if (a.index, a.id) == (b.index, b.id):
            what = f"the scene of index {a.index}, {a.id}, is another one"
    remedy = (
        "scengen edition shows whether this version draws something else; if not, move the pool aside to make it "
        "again, or take the pools of the edition's authors: certificates can differ between machines"
    )
    raise PoolError(f"{pool.folder} is not set {key} of edition {edition.name}: {what}; {remedy}")


def make_pool(
    edition: Edition, key: str, workers: Workers, progress: Callable[[int, int], None] = lambda done, total: None
) -> Pool:
    """The pool of a set: the finished one, or a new one, continuing an interrupted run.

    Raises:
        ScengenError: not enough scenarios can be certified, or the pool cannot be written.
    """
    folder = edition.pool_folder(key)
    if (folder / MANIFEST).is_file():
        return Pool.open(folder).check()
    name, split = split_of(key)
    task: Task = load_task(name)
    settings = GenerateSettings(split=split, n=edition.n, seed=edition.seed, workers=workers, pool=str(folder))
    made = generate(
        task, certify_levels(task)[edition.level], settings, lambda done, *_: progress(min(done, edition.n), edition.n)
    )
    if made.certified < edition.n:
        reasons = "; ".join(f"{count}x {reason}" for reason, count in made.reasons.items())
        raise PoolError(f"{folder}: only {made.certified} of {edition.n} scenarios could be certified ({cut(reasons)})")
    return made.pool


def evaluation_pools(
    edition: Edition, keys: Iterable[str], workers: Workers, progress: Callable[[str, int, int], None]
) -> list[str]:
    """Folders of the pools of some sets, made where they are missing and equal to the edition.

    Args:
        progress: called with the set, the number of its scenarios that are certified, and their total.

    Raises:
        ScengenError: a pool is missing and cannot be made, or differs from the edition.
    """
    folders = []
    for key in keys:
        edition.scenarios(key)

        def told(done: int, total: int, key: str = key) -> None:
            progress(key, done, total)

        pool = make_pool(edition, key, workers, told)
        check_pool(edition, pool)
        folders.append(str(pool.folder))
    return folders
