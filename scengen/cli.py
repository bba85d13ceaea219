"""The command line: a verb, then Hydra overrides. `scengen generate task=domino_single split=diagonal n=100`."""

import inspect
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

from rich.console import Console

from . import config
from .config import conf_dir, read, search_path, tasks, typed
from .errors import BadConfig, ScengenError, nearest
from .progress import Bar
from .sim import native

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
out = Console(width=None if sys.stdout.isatty() else 160)
err = Console(stderr=True, soft_wrap=True)

Arguments = Sequence[str]


def main() -> None:
    """Run one verb and leave with its exit status."""
    sys.exit(run(sys.argv[1:]))


def run(argv: Sequence[str]) -> int:
    """Run one verb: 0 all well, 1 something did not hold, 2 bad input."""
    native.silence()  # MuJoCo's warnings are counted and reported; it would also print them and write a log file
    try:
        if not argv or argv[0] in ("-h", "--help", "help"):
            out.print(_help(), highlight=False)
            return OK
        verb, *arguments = argv
        if verb == "--version":
            from .validate.identity import versions

            out.print(" ".join(f"{k} {v}" for k, v in versions().items()), highlight=False)
            return OK
        if verb not in VERBS:
            raise BadConfig(f"no command named {verb!r}{nearest(verb, VERBS)}; known: {', '.join(VERBS)}")
        if {"-h", "--help"} & set(arguments):
            out.print((conf_dir() / f"{verb}.yaml").read_text(), highlight=False, markup=False, end="")
            return OK
        if flags := [a for a in arguments if a.startswith("-")]:
            raise BadConfig(f"{flags[0]!r} is no option; settings are key=value, see scengen {verb} --help")
        return VERBS[verb](arguments)
    except ScengenError as error:
        err.print(f"scengen: {error}", style="red", highlight=False, markup=False)
        return BAD_INPUT
    except KeyboardInterrupt:
        err.print("scengen: interrupted; what is finished is kept, the same command continues", highlight=False)
        return INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        return OK


def generate(arguments: Arguments) -> int:
    """draw scenarios, certify them, and store the first n that hold in a pool"""
    from .generate import Settings, generate
    from .report import funnel_table, summary_lines

    composed = read("generate", arguments)
    settings = typed("", Settings, composed.settings)
    assert composed.task is not None
    with Bar(err, f"{composed.task.name}/{settings.split}", settings.n) as bar:

        def progress(certified: int, finished: int, verdicts: Mapping[str, int]) -> None:
            lost = ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items()) if v != "certified")
            bar.show(min(certified, settings.n), f"{finished} tried" + (f", {lost}" if lost else ""))

        summary = generate(composed.task, composed.resolved, composed.level, settings, progress)
    out.print(funnel_table(summary.funnel, summary.reasons))
    for line in summary_lines(summary):
        out.print(line, highlight=False)
    if summary.certified < settings.n:
        err.print(
            f"scengen: only {summary.certified} of {settings.n} could be certified among {summary.indices} indices; "
            "see the reasons above, or raise limit=",
            style="red",
            highlight=False,
        )
        return FAILED
    return OK


@dataclass(frozen=True)
class VerifySettings:
    """Settings of `scengen verify`; meanings stand in conf/verify.yaml."""

    pool: str | list[str] = ""
    json: str | None = None
    workers: int = 1
    expired: str = "fail"


def verify(arguments: Arguments) -> int:
    """replay every stored witness, without any oracle"""
    from .pool import Pool
    from .validate.verify import verify

    settings = typed("", VerifySettings, read("verify", arguments).settings)
    if settings.expired not in ("fail", "report"):
        raise BadConfig(f"expired = {settings.expired}; it must be fail or report")
    if settings.workers < 1:
        raise BadConfig(f"workers = {settings.workers}; it must be at least 1")
    pool = Pool.open(_one(settings.pool))
    with Bar(err, f"verify {pool.folder}", len(pool)) as bar:
        find_task = partial(config.task, search=search_path(arguments))
        report = verify(pool, find_task, settings.workers, settings.expired == "fail", bar.show)
    result = {"pool_sha256": pool.sha256, **asdict(report)}
    if settings.json:
        _write(Path(settings.json), json.dumps(result, indent=1) + "\n")
    for failure in report.failed:
        err.print(f"FAILED {failure['id']}: {failure['reason']}", style="red", highlight=False, markup=False)
    remarks = [f"{n} {what}" for n, what in ((report.expired, "expired"), (report.drifted, "end in other bits")) if n]
    verdict = "all hold" if report.holds else f"{len(report.failed)} failed"
    out.print(f"{pool.folder}: {report.checked} checked, {', '.join([verdict, *remarks])}", highlight=False)
    return OK if report.holds else FAILED


@dataclass(frozen=True)
class ShowSettings:
    """Settings of `scengen show`; meanings stand in conf/show.yaml."""

    pool: str | list[str] = ""
    id: str | None = None
    to: str | None = None
    images: int = 60


def show(arguments: Arguments) -> int:
    """what is in a pool, or one scenario of it; pictures on request"""
    from . import render, report
    from .pool import Pool

    settings = typed("", ShowSettings, read("show", arguments).settings)
    folders = settings.pool if isinstance(settings.pool, list) else [settings.pool]
    pools = [Pool.open(folder).check() for folder in folders]
    target = Path(settings.to) if settings.to else None
    if settings.id is None:
        if target and target.suffix != ".html":
            raise BadConfig(f"to = {target}; a contact sheet is an .html file (a single scenario, id=, gives a .png)")
        for pool in pools:
            out.print(report.pool_table(pool))
            out.print(report.funnel_table(pool.manifest["funnel"], pool.manifest["reasons"]))
            out.print(f"pool sha256: {pool.sha256}", highlight=False)
        if target and (remark := report.contact_sheet(pools, target, settings.images)):
            err.print(f"scengen: {target} has no pictures: {remark}", highlight=False, markup=False)
    else:
        row = pools[0].row(settings.id)
        for table in report.scenario_tables(row):
            out.print(table)
        if target:
            if target.suffix != ".png":
                raise BadConfig(f"to = {target}; the film strip of a scenario is a .png file")
            _write(target, render.encode(render.strip(row["scene_xml"], row["embodiment"], row["witness"]), "png"))
    if target:
        out.print(f"wrote {target}", highlight=False)
    return OK


@dataclass(frozen=True)
class ExportSettings:
    """Settings of `scengen export`; meanings stand in conf/export.yaml."""

    pool: str | list[str] = ""
    id: str | None = None
    to: str = ""
    robot: bool = True


def export(arguments: Arguments) -> int:
    """write scenes that open in plain MuJoCo from anywhere"""
    from .export import export
    from .pool import Pool

    settings = typed("", ExportSettings, read("export", arguments).settings)
    pool = Pool.open(_one(settings.pool)).check()
    rows = [pool.row(settings.id)] if settings.id else list(pool.rows())
    with Bar(err, f"export to {settings.to}", len(rows)) as bar:
        for count, row in enumerate(rows, 1):
            export(row, Path(settings.to), settings.robot)
            bar.show(count)
    out.print(f"wrote {len(rows)} scenes to {settings.to}", highlight=False)
    return OK


@dataclass(frozen=True)
class TasksSettings:
    """Settings of `scengen tasks`; meanings stand in conf/tasks.yaml."""

    name: str | None = None


def list_tasks(arguments: Arguments) -> int:
    """what can be generated: tasks, parameters, splits and their proofs"""
    from .report import task_tables, tasks_table

    settings, search = typed("", TasksSettings, read("tasks", arguments).settings), search_path(arguments)
    if settings.name is None:
        out.print(tasks_table([config.task(name, search) for name in tasks(search)]))
        return OK
    for table in task_tables(config.task(settings.name, search)):
        out.print(table)
    return OK


@dataclass(frozen=True)
class BenchSettings:
    """Settings of `scengen bench`; meanings stand in conf/bench.yaml."""

    json: str | None = None
    repeats: int = field(default=5)


def bench(arguments: Arguments) -> int:
    """the costs that scengen promises, as ratios within one run"""
    from .bench import bench

    settings = typed("", BenchSettings, read("bench", arguments).settings)
    if settings.repeats < 1:
        raise BadConfig(f"repeats = {settings.repeats}; it must be at least 1")
    table, result = bench(settings.repeats)
    out.print(table)
    if settings.json:
        _write(Path(settings.json), json.dumps(result, indent=1) + "\n")
    return OK


VERBS: dict[str, Callable[[Arguments], int]] = {
    "generate": generate,
    "verify": verify,
    "show": show,
    "export": export,
    "tasks": list_tasks,
    "bench": bench,
}


def _help() -> str:
    lines = [f"  {verb:<10}{inspect.getdoc(function)}" for verb, function in VERBS.items()]
    return "\n".join(
        [
            "scengen: physical puzzles for robot manipulation, each proved solvable",
            "",
            "usage: scengen COMMAND [key=value ...]      settings of a command: scengen COMMAND --help",
            "",
            *lines,
            "",
            "example: scengen generate task=domino_single split=diagonal n=100 workers=2 pool=generated/diagonal",
        ]
    )


def _one(pool: str | list[str]) -> str:
    if isinstance(pool, list):
        raise BadConfig(f"pool = {','.join(map(str, pool))}; this command takes one pool")
    return pool


def _write(path: Path, content: str | bytes) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise BadConfig(f"{path} cannot be written: {error.strerror}") from None
