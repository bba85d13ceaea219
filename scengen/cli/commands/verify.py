"""check the claims of a pool: rebuild, draw again, replay, and repeat its checks"""

import secrets
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from rich.table import Table

from ... import compose
from ...attack.campaign import wrong_hits
from ...attack.check import attacked
from ...attack.evidence import Hit, replayed
from ...demos.verify import verify_demonstrations
from ...errors import BadConfig, UnknownName, cut
from ...evaluate.audit import audit
from ...evaluate.audit_report import SAMPLE
from ...evaluate.audit_report import Options as AuditOptions
from ...evidence.reproduction import LIMITS as REPRODUCTION_LIMITS
from ...evidence.reproduction import reproduced
from ...ood.analysis.redraw import task_of
from ...pool import Pool
from ...pool.demonstrations import Demonstrations, demonstration_folders, is_demonstrations
from ...runs.progress import ProgressBar
from ...samplers.task import Task
from ...samplers.task_files import search_path
from ...samplers.task_files import tasks as list_tasks
from ...validate.verify.claims import of_another_version
from ...validate.verify.examine import Verdict
from ...validate.verify.junit import junit
from ...validate.verify.pools import LIMITS, Options, Report, verify
from ...validate.verify.recheck import LEVELS
from ...validate.verify.spot import bound
from ...validate.verify.stored import task_of_manifest as stored_task
from ...work.limits import at_least
from ...work.parallel import Limits, WorkerDied, Workers, apart
from ...work.targets import try_file
from . import DECLINED, FAILED, OK, Arguments, err, intake, out, say, several, warn, write, write_json
from .settings import read

ALL = "all"
"""Value of `task` for all tasks."""
MAX_PRINTED = 20
"""Largest number of differences and faults to print; the files hold all."""
ANY = "any"
"""Value of `mujoco` for a pool that another MuJoCo may have certified."""
SKIP = "skip"
"""Value of `others` for a run that checks only its sample."""
OTHERS = ("check", SKIP)
"""Values of `others`."""
STATUS: dict[Verdict, int] = {"sound": OK, "refuted": FAILED, "declined": DECLINED}
"""Exit status by verdict."""
WORST = {verdict: STATUS[verdict] for verdict in ("refuted", "declined", "sound")}
"""Exit status by verdict, in the order in which verdicts decide about multiple pools."""


@dataclass(frozen=True)
class VerifySettings:
    """Settings of `scengen verify`; conf/command/verify.yaml explains them."""

    pool: str | list[str] | None
    hits: str | None
    results: str | None
    task: str | None
    level: str
    sample: int | None
    others: str
    mujoco: str | None
    seed: int | None
    ycb: str | None
    apart: str | list[str] | None
    json: str | None
    junit: str | None
    workers: Workers
    limit_seconds: float
    limit_mb: int


def command(arguments: Arguments) -> int:
    arguments = without_expired(arguments)
    # Hydra would look for a file of this name in conf/task, and find none for `all`.
    tasks = [argument.partition("=")[2] for argument in arguments if argument.startswith("task=")]
    settings = read("verify", [a for a in arguments if not a.startswith("task=")], VerifySettings)
    for name, known in (("level", LEVELS), ("others", OTHERS)):
        if getattr(settings, name) not in known:
            raise BadConfig(f"{name} = {getattr(settings, name)}; it must be {' or '.join(known)}")
    if settings.mujoco not in (None, ANY):
        told = f"mujoco = {cut(settings.mujoco)}; it must be {ANY}, for this MuJoCo, whichever one certified the pool"
        raise BadConfig(f"{told}; scengen verify mujoco compares a pool under several versions")
    if tasks:
        return _reproduce(tasks[-1], settings, search_path(arguments))
    if settings.others == SKIP and settings.sample is None:
        raise BadConfig(f"others = {SKIP}; it skips the scenarios outside a sample; give sample=N, too")
    at_least(settings, workers=1, sample=1, seed=0, limit_seconds=1, limit_mb=200)
    try_file(settings.json)
    try_file(settings.junit)
    if settings.hits is not None:
        for name in ("sample", "mujoco", "ycb", "apart", "json", "junit"):
            if getattr(settings, name) is not None:
                raise BadConfig(f"{name} is not for hits: leave it out")
        return _replay_hits(settings.hits, settings.pool, search_path(arguments))
    if settings.results is not None:
        return _audit_results(Path(settings.results), settings, search_path(arguments))
    if settings.pool is None:
        raise BadConfig("verify needs pool=FOLDER, results=FOLDER, hits=FILE or task=NAME; see scengen verify --help")
    with _reported(settings) as reports:
        demonstrated = [f for f in demonstration_folders(settings.pool) if is_demonstrations(f)]
        if not demonstrated:
            return _verify_pools(several(settings.pool), settings, search_path(arguments), reports)
    return _replay_demonstrations(demonstrated, settings, search_path(arguments))


@contextmanager
def _reported(settings: VerifySettings) -> Iterator[dict[str, Report | str]]:
    """Reports by pool, which become the files. An error is the report of the pool in which it occurred.

    A pool that is not verified yet has an empty report.
    """
    reports: dict[str, Report | str] = {}
    try:
        yield reports
    except Exception as error:
        given = settings.pool if isinstance(settings.pool, str) else ",".join(settings.pool or ())
        reports[next((pool for pool, report in reports.items() if not report), given)] = str(error)
        raise
    finally:
        if reports and all(reports.values()):
            if settings.junit:
                write(Path(settings.junit), junit(reports, settings.level))
            if settings.json:
                plain = {folder: _plain(report) for folder, report in reports.items()}
                alone = len(plain) == 1 and not isinstance(settings.pool, list)
                write_json(settings.json, next(iter(plain.values())) if alone else plain)


def _verify_pools(
    folders: Sequence[str], settings: VerifySettings, search: Sequence[str], reports: dict[str, Report | str]
) -> int:
    """Verify pools.

    Args:
        reports: gets the report on each pool, by its folder.

    Returns:
        Exit status.

    Raises:
        BadConfig: a setting is for demonstrations, or for scans that a pool does not hold.
    """
    if settings.apart is not None:
        raise BadConfig("apart is for demonstrations, which may be kept apart from pools: leave it out")
    if settings.ycb is not None:
        for folder in folders:
            if not Pool.open(folder).manifest.task_node.get("scans"):
                raise BadConfig(f"ycb = {cut(settings.ycb)}, but {folder} holds no scans; leave it out")
    limits = Limits(settings.limit_seconds, settings.limit_mb)
    options = Options(
        settings.level,
        settings.sample,
        settings.others != SKIP,
        secrets.randbelow(2**32) if settings.seed is None else settings.seed,
        settings.workers,
        limits,
        attacked,
        settings.mujoco == ANY,
    )
    found: dict[str, Report] = {}
    for folder in folders:
        reports[folder] = ""
        pool = Pool.open(folder)
        with ProgressBar(err, f"verify {folder}", len(pool), settings.workers) as progress_bar:
            report = verified(pool, options, search, progress_bar.show)
        reports[folder] = found[folder] = _with_scans(report, pool, settings.ycb)
        _print_report(pool, found[folder])
    verdicts = Counter(report.verdict for report in found.values())
    if len(folders) > 1:
        say(f"{len(folders)} pools: {', '.join(f'{verdicts[v]} {v}' for v in STATUS)}")
    return next(status for verdict, status in WORST.items() if verdicts[verdict])


def _plain(report: Report | str) -> dict[str, object]:
    """A report as plain data, or the error because of which there is none."""
    if isinstance(report, str):
        return {"error": report}
    return {key: value for key, value in vars(report).items() if key != "names"}


def without_expired(arguments: Arguments) -> Arguments:
    """Arguments without the setting `expired`, which has no meaning any more; a hint says so."""
    kept = [argument for argument in arguments if not argument.startswith("expired=")]
    if len(kept) < len(arguments):
        warn("expired= has no meaning any more: certificates belong to a version of their task, which verify compares")
    return kept


def verified(pool: Pool, options: Options, search: Sequence[str], progress: Callable[[int], None]) -> Report:
    """Check every claim of a pool, including those about attacks on it.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.
        progress: called with the number of checked scenarios.
    """
    task = compose.load_task(pool.task, search)
    return _with_hits(
        verify(pool, task, compose.certify_levels(task), options, progress), pool, task, options.limits or LIMITS
    )


def _with_hits(report: Report, pool: Pool, task: Task, limits: Limits) -> Report:
    """The report on a pool. If the pool is sound so far, faults of the attack in its manifest are added."""
    if report.verdict != "sound" or pool.manifest.attack is None:
        return report
    verdict: Verdict = "declined" if of_another_version(pool.manifest, task) else "refuted"
    try:
        found = apart(_wrong_hits, (pool, stored_task(pool, task)), limits, "replaying the hits of its attack")
    except WorkerDied as error:
        found, verdict = [("attack", str(error))], "declined"
    wrong = [{"id": name, "verdict": verdict, "reason": why} for name, why in found]
    return replace(report, failed=[*report.failed, *wrong], verdict=verdict) if wrong else report


def _with_scans(report: Report, pool: Pool, folder: str | None) -> Report:
    """The report on a pool, with remarks and faults of the scans in its manifest.

    Raises:
        BadConfig: a folder is given but lacks one of the scans.
    """
    scans = pool.manifest.task_node.get("scans", {})
    if report.verdict != "sound" or not scans:
        return report
    solids = f"{len(scans)} solids of scans ({', '.join(scans)})"
    if folder is None:
        why = "it is not checked whether they are made of the files that the manifest names; give ycb=FOLDER for that"
        return replace(report, remarks=[*report.remarks, f"the pool holds {solids}: {why}"])
    task = task_of(pool)
    if wrong := intake("ycb").other_files(task, folder):
        failed = [{"id": "manifest.json", "verdict": "refuted", "reason": why} for why in wrong]
        return replace(report, failed=[*report.failed, *failed], verdict="refuted")
    return replace(report, remarks=[*report.remarks, f"{solids} are made of the files in {folder}"])


def _wrong_hits(of: tuple[Pool, Task]) -> list[tuple[str, str]]:
    return list(wrong_hits(*of))


def _reproduce(chosen: str, settings: VerifySettings, search: Sequence[str]) -> int:
    """Compare tasks with their stored behaviour, and print a table.

    Returns:
        Exit status: 1 if a task has another verdict, draw, scene or rule than stored, 3 if one could not be compared.

    Raises:
        BadConfig: a setting is given that is for pools.
        UnknownName: there is no such task.
    """
    for name in ("pool", "hits", "results", "sample", "mujoco", "ycb", "apart", "junit"):
        if getattr(settings, name) is not None:
            raise BadConfig(
                f"{name} is for pools; task={chosen} compares tasks with their stored behaviour: leave it out"
            )
    known = list_tasks(search)
    names = known if chosen == ALL else [name.strip() for name in chosen.strip("[]").split(",")]
    for name in names:
        if name not in known:
            raise UnknownName("task", name, [*known, ALL])
    limits = Limits(max(settings.limit_seconds, REPRODUCTION_LIMITS.seconds), settings.limit_mb)
    with ProgressBar(err, "verify tasks", len(names), settings.workers) as progress_bar:
        full = settings.level == "full"
        results = reproduced(names, settings.workers, search, limits, full, progress_bar.show)
        found = sorted(results, key=lambda r: r.task)
    table = Table("task", "version", "reproduces", "rollouts")
    for one in found:
        compared = one.compared
        table.add_row(
            one.task,
            *(
                (str(compared.version), compared.reproduces, str(compared.rollouts))
                if compared
                else ("", "unknown", "")
            ),
        )
    out.print(table)
    differences = [difference for one in found if one.compared for difference in one.compared.differences]
    for text in [*(f"{one.task}: {one.why}" for one in found if one.why), *map(str, differences)][:MAX_PRINTED]:
        warn(text)
    if (more := len(differences) - MAX_PRINTED) > 0:
        warn(f"and {more} more differences; json=FILE writes all")
    if settings.json:
        write_json(settings.json, [asdict(one) for one in found])
    counts = Counter(one.compared.reproduces if one.compared else "unknown" for one in found)
    say(f"{len(found)} tasks: {', '.join(f'{count} {what}' for what, count in counts.items())}")
    return FAILED if counts["no"] else DECLINED if counts["unknown"] else OK


def _replay_hits(hits: str, pool: str | list[str] | None, search: Sequence[str]) -> int:
    """Replay a hit of the adversary, or all hits in a folder.

    Returns:
        Exit status.
    """
    paths = sorted(Path(hits).glob("*.npz")) if Path(hits).is_dir() else [Path(hits)]
    if not paths:
        raise BadConfig(f"hits = {hits}; the folder holds no hits (*.npz); give one that scengen attack wrote")
    attacked_task = None if pool is None else task_of(Pool.open(str(pool)).check(), search)
    wrong = 0
    for path in paths:
        hit = Hit.load(path)
        task = attacked_task or compose.load_task(hit.task, search)
        again = replayed(hit, task)
        wrong += bool(again.fault)
        say(f"{path.name}: {again.fault or f'reaches the goal of {hit.scenario} after {hit.seconds:g} s, {hit}'}")
        if not again.exact and not again.fault:
            say(f"{path.name}: ends in other bits than it says: it was found on another machine, or edited")
        if other := task.other_version("found on", hit.task_version):
            say(f"{path.name}: {other}")
    say("claimed, and not checked: how hits were found (tier, plan, filter), that every solution makes what they lack")
    say(f"{len(paths) - wrong} of {len(paths)} hits replay")
    return FAILED if wrong else OK


def _audit_results(folder: Path, settings: VerifySettings, search: Sequence[str]) -> int:
    """Verify the results of an evaluation.

    Returns:
        Exit status.

    Raises:
        BadConfig: a setting is for pools alone, or the folder holds no results.
    """
    for name in ("hits", "mujoco", "ycb", "apart", "junit"):
        if getattr(settings, name) is not None:
            raise BadConfig(f"{name} is not for results: leave it out")
    sample = None if settings.level == "full" else settings.sample or SAMPLE
    seed = secrets.randbelow(2**32) if settings.seed is None else settings.seed
    pools = several(settings.pool) if settings.pool else ()
    with ProgressBar(err, f"verify {folder}", 1, settings.workers) as progress_bar:
        options = AuditOptions(sample, seed, pools, settings.workers, search)
        reports = audit(folder, options, progress_bar.of)
    for report in reports:
        _print_faults(report.faults, report.declined)
        for remark in report.remarks:
            say(remark)
        say(f"claimed, and not checked: {'; '.join(report.claimed)}")
        done = f"{report.rebuilt} of {report.lines} lines rebuilt, {report.pictures} with pictures"
        say(f"{report.folder}: {report.verdict}: {done}, {report.replayed} replayed to the end")
    if settings.json:
        write_json(settings.json, [{**vars(report), "verdict": report.verdict} for report in reports])
    verdicts = Counter(report.verdict for report in reports)
    return next(status for verdict, status in WORST.items() if verdicts[verdict])


def _print_faults(faults: Sequence[str], declined: Sequence[str]) -> None:
    """Print the first faults, and what could not be decided."""
    for fault in faults[:MAX_PRINTED]:
        warn(f"REFUTED {fault[:2000]}")
    for why in declined[:MAX_PRINTED]:
        warn(f"DECLINED {why[:2000]}")
    if (more := len(faults) + len(declined) - MAX_PRINTED) > 0:
        warn(f"and {more} more; json=FILE writes all")


def _replay_demonstrations(folders: Sequence[str], settings: VerifySettings, search: Sequence[str]) -> int:
    """Verify folders of demonstrations.

    Returns:
        Exit status.

    Raises:
        BadConfig: a setting is for pools alone, or a folder is one of a pool.
    """
    if others := set(demonstration_folders(settings.pool or "")) - set(folders):
        raise BadConfig(f"{min(others)} holds no demonstrations; verify pools and demonstrations separately")
    for name in ("sample", "mujoco", "ycb", "junit"):
        if getattr(settings, name) is not None:
            raise BadConfig(f"{name} is for pools; demonstrations are all replayed: leave it out")
    every, reports = [Demonstrations.open(folder) for folder in folders], []
    pools = _kept_apart(settings.apart, every)
    for folder, found in zip(folders, every, strict=True):
        limits = Limits(settings.limit_seconds, settings.limit_mb)
        with ProgressBar(err, f"verify {folder}", len(found), settings.workers) as progress_bar:
            task, oracle = compose.load_task(found.task, search), settings.level == "full"
            named = [pool for pool in pools if pool.sha256 in found.manifest.config.apart]
            report = verify_demonstrations(found, task, settings.workers, limits, oracle, progress_bar.show, named)
        _print_differences(report.differences)
        _print_faults(report.faults, report.declined)
        for remark in report.remarks:
            say(remark)
        if report.claimed:
            say(f"claimed, and not checked: {'; '.join(report.claimed)}")
        say(f"{folder}: {report.verdict}: {report.exact} of {report.checked} replay bit for bit")
        reports.append(report)
    if settings.json:
        write_json(settings.json, [{**vars(report), "verdict": report.verdict} for report in reports])
    verdicts = Counter(report.verdict for report in reports)
    return next(status for verdict, status in WORST.items() if verdicts[verdict])


def _kept_apart(given: str | list[str] | None, found: Sequence[Demonstrations]) -> list[Pool]:
    """The pools from which demonstrations were kept apart, as far as they are given.

    Raises:
        BadConfig: no demonstrations name one of them.
    """
    pools = [Pool.open(folder).check() for folder in several(given or [])] if given else []
    named = {sha256 for each in found for sha256 in each.manifest.config.apart}
    for pool in pools:
        if pool.sha256 not in named:
            raise BadConfig(f"apart = {pool.folder}; the demonstrations name other pools (by sha256): leave it out")
    return pools


def _print_differences(differences: Sequence[Mapping[str, str]]) -> None:
    """Print differences from the installed task, if there are any."""
    if differences:
        table = Table("key", "in the pool", "installed", title="the task of this pool differs from the installed file")
        for d in differences[:MAX_PRINTED]:
            table.add_row(d["key"], d["pool"], d["installed"])
        out.print(table)
        if (more := len(differences) - MAX_PRINTED) > 0:
            say(f"and {more} more; json=FILE writes all")


def _print_report(pool: Pool, report: Report) -> None:
    """Print differences, faults, remarks and counts of a report."""
    _print_differences(report.differences)
    for failure in report.failed[:MAX_PRINTED]:
        name = report.names.get(failure["id"], failure["id"])
        warn(f"{failure['verdict'].upper()} {name}: {failure['reason'][:2000]}")
    if (more := len(report.failed) - MAX_PRINTED) > 0:
        warn(f"and {more} more faults; json=FILE writes all")
    for remark in report.remarks:
        say(remark)
    done = [
        f"{n} {what}"
        for n, what in (
            (report.rebuilt, "rebuilt and drawn again"),
            (report.replayed, "replayed"),
            (report.rechecked, "checked again without an oracle"),
            (report.certified_again, "certified again"),
            (report.left_out, "left out and certified again"),
            (report.claimed, "claimed for another version of the task or MuJoCo"),
            (report.drifted, "end in other bits"),
        )
        if n
    ]
    if report.claimed_checks:
        message = f"not made again at level {report.level}, and claimed: {', '.join(report.claimed_checks)}"
        say(f"{message}; level=full makes them again")
    say(f"settings: {report.settings or 'unknown'}")
    if pool.manifest.is_subset:
        say("a subset: its scenarios were chosen from another pool, and its rejection report is that of the other pool")
    if report.sample:
        size, of, seed = (report.sample[name] for name in ("size", "of", "seed"))
        shown = f": {bound(of, size, 'scenarios')}" if report.holds else ""
        say(f"sample: {size} of {of} scenarios simulated, seed {seed}{shown}")
    parts = ", ".join([f"{report.sound} sound, {report.refuted} refuted, {report.declined} declined", *done])
    say(f"{pool.folder}: {report.verdict} at level {report.level}: {parts}")
