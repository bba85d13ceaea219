"""Findings of a verification, collected and counted."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...certificate import CHECKS
from ...errors import PoolError, contrasted, cut
from ...installation import versions
from ...pool.manifest import MANIFEST
from ...samplers.task import Task
from ...work.fingerprint import same_bits
from .. import lock
from ..settings import CertifySettings
from .claims import Claims
from .examine import Examination, Verdict
from .recheck import MADE_AGAIN


@dataclass(frozen=True)
class Report:
    """Result of the verification of a pool."""

    pool_sha256: str
    """Hash of the pool's manifest."""
    verdict: Verdict
    level: str
    checked: int
    """Number of scenarios that were looked at."""
    sound: int
    refuted: int
    declined: int
    rebuilt: int
    """Number of scenarios whose parameters, labels and scene were made again from task, seed and index."""
    replayed: int
    rechecked: int
    """Number of scenarios whose checks without an oracle were repeated."""
    certified_again: int
    left_out: int
    """Number of scenarios that the run had drawn and not certified, and that were certified again."""
    failed: list[dict[str, str]]
    """`id`, `verdict` and `reason` of everything that is not sound; a fault of the whole pool under manifest.json."""
    claimed: int
    """Number of scenarios that were certified for another version of the task or MuJoCo, and that differ here. They are
    among the declined ones."""
    versions: list[int]
    """Version of the task on which the pool was certified, and the installed one."""
    claimed_checks: list[str]
    """Checks of the certificates that were not made again at this level."""
    drifted: int
    settings: str
    """Settings of the certificates: `quick`, `full`, or `own settings` and the names of those that differ."""
    differences: list[dict[str, str]]
    """Differences between the manifest's task and the installed file: `key`, `pool` and `installed`."""
    sample: dict[str, Any] | None
    """Size and seed of the sample, and the share of false rows that it excludes at 95 %."""
    remarks: list[str]
    """Facts that a reader should know although nothing is wrong."""
    examinations: list[dict[str, Any]]
    """`id`, `verdict` and `reason` of every scenario, whether it was `simulated`, and the `seconds` that it took."""
    names: dict[str, str]
    """Names of the scenarios in `failed`, by id."""

    @property
    def holds(self) -> bool:
        return self.verdict == "sound"


class Findings:
    """Collects findings."""

    def __init__(self, level: str, pool_sha256: str):
        self.level, self.pool_sha256 = level, pool_sha256
        self.task_versions: list[int] = []
        self.claimed_checks: list[str] = []
        self.failed: list[dict[str, str]] = []
        self.examinations: list[Examination] = []
        self.differences: list[dict[str, str]] = []
        self.remarks: list[str] = []
        self.settings = ""
        self.sample: dict[str, Any] | None = None
        self.left_out: dict[int, str] = {}
        """Reasons why indices without a scenario are not certified."""
        self.names: dict[str, str] = {}
        """Names of the scenarios that were looked at, by id."""

    @property
    def pool_verdict(self) -> Verdict:
        """Verdict on the pool as a whole so far."""
        verdicts = {f["verdict"] for f in self.failed} | {e.verdict for e in self.examinations}
        return "refuted" if "refuted" in verdicts else "declined" if "declined" in verdicts else "sound"

    def of_pool(self, where: str, verdict: Verdict, reason: str) -> None:
        """Note a fault of the pool as a whole, or of one of its files."""
        self.failed.append({"id": where, "verdict": verdict, "reason": reason})

    def compare_tasks(self, installed: Task, stored: Task) -> None:
        """Note the differences between the manifest's task and the installed one."""
        self.differences = task_differences(installed, stored)
        for what in wrong_names(installed, stored):
            self.of_pool(MANIFEST, "refuted", what)

    def name_settings(self, settings: CertifySettings, levels: Mapping[str, CertifySettings]) -> None:
        """Note the level whose settings the certificates have, or how they differ from it."""
        known = levels.get(settings.name)
        if known is None:
            told = f"the settings are called {settings.name[:60]!a}; known: {', '.join(levels)}"
            self.of_pool(MANIFEST, "refuted", told)
        elif settings == known:
            self.settings = settings.name
        else:
            other = ", ".join(d["key"] for d in differences(asdict(known), asdict(settings)))
            self.settings = f"own settings ({settings.name}, except for {other})"
            if settings.falls_short(known):
                bounds = f"{known.robust.bound:g}, and not {settings.robust.bound:g}"
                told = f"the settings are called {settings.name}, whose bound of the robust check is {bounds}"
                self.of_pool(MANIFEST, "refuted", told)

    def compare_versions(self, claims: Claims, any_mujoco: bool) -> None:
        """Note the differences between what the pool was made with and this installation.

        Args:
            any_mujoco: see `pools.Options`.
        """
        manifest = claims.manifest
        for package, made in manifest.versions.items():
            here = versions().get(package)
            if package == "mujoco" and made != here and not any_mujoco:
                told = f"certified with mujoco {made}, this is {here}; mujoco=any checks what holds here"
                self.of_pool(MANIFEST, "declined", told)
            elif package == "robosuite" and made != here:
                told = f"certified with robosuite {made}, this is {here}: this installation cannot judge it"
                self.of_pool(MANIFEST, "declined", told)
            elif package != "mujoco" and made != here:
                self.remarks.append(f"certified with {package} {made}, this is {here}")
        self.task_versions = [manifest.task_version, claims.task.version]
        made = [check for check in CHECKS if check != "attack" or claims.settings.attack]
        self.claimed_checks = [check for check in made if check not in MADE_AGAIN[self.level]]
        if other := claims.of_another_version:
            self.remarks.append(f"{other}: what differs between the versions cannot be checked here")
        if not same_bits(manifest):
            told = "certified with different rounding: final states and numbers are not compared"
            self.remarks.append(told)

    def compare_lock(self, folder: Path, claims: Claims) -> None:
        """Note what the file of a pool's environment says, if there is one: see `lock`."""
        try:
            locked = lock.read_lock(folder)
        except PoolError as error:
            self.of_pool(lock.LOCK_FILE, "refuted", str(error))
            return
        if locked is None:
            return
        made = claims.manifest.versions
        if wrong := lock.differing(locked, made):
            what = ", ".join(f"{package} {told}, the manifest {made[package]}" for package, told in wrong.items())
            self.of_pool(lock.LOCK_FILE, "refuted", f"it says {what}")
            return
        here = lock.needed(claims.task.family, versions())
        if unneeded := lock.unneeded(locked, here):
            what = cut(", ".join(unneeded))
            self.remarks.append(f"{lock.LOCK_FILE} names {what}, which no verdict depends on: do not install from it")
        elif other := lock.differing(locked, here):
            told = ", ".join(f"{package} {made} (here {here[package]})" for package, made in other.items())
            install = f"pip install --no-deps -r {folder / lock.LOCK_FILE}"
            self.remarks.append(f"made with {told}; in an environment with scengen, {install} installs these versions")

    def report(self) -> Report:
        verdicts = [e.verdict for e in self.examinations]
        faults = [{"id": e.id, "verdict": e.verdict, "reason": "; ".join(e.reasons)} for e in self.examinations]
        simulated = sum(e.simulated for e in self.examinations)
        failed = self.failed + [f for f in faults if f["verdict"] != "sound"]
        return Report(
            pool_sha256=self.pool_sha256,
            verdict=self.pool_verdict,
            level=self.level,
            checked=len(verdicts),
            sound=verdicts.count("sound"),
            refuted=verdicts.count("refuted"),
            declined=verdicts.count("declined"),
            rebuilt=sum(e.rebuilt for e in self.examinations),
            replayed=simulated,
            rechecked=simulated if self.level in ("recheck", "full") else 0,
            certified_again=simulated if self.level == "full" else 0,
            left_out=len(self.left_out),
            failed=failed,
            claimed=sum(e.claimed for e in self.examinations),
            versions=self.task_versions,
            claimed_checks=self.claimed_checks,
            drifted=sum(e.drifted for e in self.examinations),
            settings=self.settings,
            differences=self.differences,
            sample=self.sample,
            remarks=self.remarks,
            examinations=[
                {**fault, "simulated": e.simulated, "seconds": e.seconds}
                for fault, e in zip(faults, self.examinations, strict=True)
            ],
            names={id_: self.names[id_] for f in failed if (id_ := f["id"]) in self.names},
        )


def task_differences(installed: Task, stored: Task) -> list[dict[str, str]]:
    """Differences between the installed task and one that a manifest describes, except for scans."""
    return list(differences(_meaning(installed.node), _meaning(stored.node)))


def _meaning(node: Mapping[str, Any]) -> dict[str, Any]:
    """A task file without scans, and without the reasons and sources of axes, on which no scenario depends."""
    told = ("why", "source")
    axes = {name: {k: v for k, v in axis.items() if k not in told} for name, axis in (node.get("axes") or {}).items()}
    return {**{key: value for key, value in node.items() if key != "scans"}, **({"axes": axes} if axes else {})}


def wrong_names(installed: Task, stored: Task) -> Iterator[str]:
    """Names of a stored task that are not those of the installed one."""
    for name in ("code", "category"):
        here, there = getattr(installed, name), getattr(stored, name)
        if here != there:
            told, own = contrasted(ascii(there), ascii(here))
            yield f"the {name} is {told}, that of the task is {own}"


def differences(installed: Any, stored: Any, key: str = "") -> Iterator[dict[str, str]]:
    """Differences between two mappings: dotted key, and both values."""
    if isinstance(installed, Mapping) and isinstance(stored, Mapping):
        for name in [*installed, *(n for n in stored if n not in installed)]:
            below = f"{key}.{name}".strip(".")
            yield from differences(installed.get(name, _ABSENT), stored.get(name, _ABSENT), below)
    elif installed != stored:
        told, here = contrasted(_shown(stored), _shown(installed), 200)
        yield {"key": key, "pool": told, "installed": here}


_ABSENT: Any = object()


def _shown(value: Any) -> str:
    """A value as text. Other letters than ASCII are escaped, because some of them look alike."""
    if value is _ABSENT:
        return "(not there)"
    text = str(value)
    return text if text.isascii() and text.isprintable() else ascii(text)[1:-1]
