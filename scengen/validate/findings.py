"""What verification has found about a pool, collected and counted."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..errors import PoolError, cut
from ..fingerprint import fingerprint
from ..versions import versions
from . import lock
from .claims import Claims
from .examine import Examination, Verdict
from .identity import source_sha256
from .settings import CertifySettings


@dataclass(frozen=True)
class Report:
    """What verification found about a pool."""

    verdict: Verdict
    level: str
    checked: int
    """Scenarios that were looked at."""
    sound: int
    refuted: int
    declined: int
    rebuilt: int
    """Scenarios whose parameters, labels and scene were made again from task, seed and index."""
    replayed: int
    rechecked: int
    """Those whose checks without an oracle were repeated."""
    certified_again: int
    left_out: int
    """Scenarios that the run had drawn and not certified, and that were certified again."""
    failed: list[dict[str, str]]
    """`id`, `verdict` and `reason` of everything that is not sound; a fault of the whole pool under manifest.json."""
    expired: int
    drifted: int
    settings: str
    """Whose settings the certificates have: `quick`, `full`, or `own settings` and in what they differ."""
    differences: list[dict[str, str]]
    """Where the manifest's task differs from the installed file: `key`, `pool` and `installed`."""
    sample: dict[str, Any] | None
    """Size and seed of the sample, and which share of false rows it excludes at 95 %."""
    remarks: list[str]
    """What holds and yet should be known."""
    examinations: list[dict[str, Any]]
    """`id`, `verdict` and `reason` of every scenario."""
    names: dict[str, str]
    """What people call the scenarios in `failed`, by id."""

    @property
    def holds(self) -> bool:
        return self.verdict == "sound"


class Findings:
    """Collects what is found."""

    def __init__(self, level: str, strict: bool):
        self.level, self.strict = level, strict
        self.failed: list[dict[str, str]] = []
        self.examinations: list[Examination] = []
        self.differences: list[dict[str, str]] = []
        self.remarks: list[str] = []
        self.settings = ""
        self.sample: dict[str, Any] | None = None
        self.left_out: dict[int, str] = {}
        """Why indices without a scenario are not certified."""
        self.expired = False
        self.names: dict[str, str] = {}
        """What people call the scenarios that were looked at, by id."""

    @property
    def pool_verdict(self) -> Verdict:
        """That of the pool as a whole so far."""
        verdicts = {f["verdict"] for f in self.failed} | {e.verdict for e in self.examinations}
        return "refuted" if "refuted" in verdicts else "declined" if "declined" in verdicts else "sound"

    def of_pool(self, where: str, verdict: Verdict, reason: str) -> None:
        """Note a fault of the pool as a whole, or of one of its files."""
        self.failed.append({"id": where, "verdict": verdict, "reason": reason})

    def compare(self, installed: Mapping[str, Any], stored: Mapping[str, Any]) -> None:
        """Note where the manifest's task differs from the installed file."""
        self.differences = list(differences(installed, stored))

    def weigh(self, settings: CertifySettings, levels: Mapping[str, CertifySettings]) -> None:
        """Note whose settings the certificates have."""
        known = levels.get(settings.name)
        if known is None:
            told = f"the settings are called {settings.name[:60]!r}; known: {', '.join(levels)}"
            self.of_pool("manifest.json", "refuted", told)
        elif settings == known:
            self.settings = settings.name
        else:
            other = ", ".join(d["key"] for d in differences(asdict(known), asdict(settings)))
            self.settings = f"own settings ({settings.name}, but for {other})"
            if settings.name != "quick" and settings.robust.bound < known.robust.bound:
                bounds = f"{known.robust.bound:g}, and not {settings.robust.bound:g}"
                told = f"the settings are called {settings.name}, whose bound of the robust check is {bounds}"
                self.of_pool("manifest.json", "refuted", told)

    def age(self, claims: Claims) -> None:
        """Note what the pool was made with."""
        for package, made in claims.versions.items():
            here = versions().get(package)
            if package in ("mujoco", "robosuite") and made != here:
                told = f"certified with {package} {made}, this is {here}: unknown to this installation"
                self.of_pool("manifest.json", "declined", told)
            elif made != here:
                self.remarks.append(f"certified with {package} {made}, this is {here}")
        self.expired = claims.source_sha256 != source_sha256(claims.task.family)
        if self.expired and self.strict:
            self.of_pool(
                "manifest.json",
                "declined",
                "expired: code that it depends on has changed since; certify the pool again",
            )
        if claims.fingerprint != fingerprint():
            self.remarks.append(
                "certified on a machine that rounds otherwise: final states and numbers are not compared"
            )

    def look_up(self, folder: Path, claims: Claims) -> None:
        """Note what the file of a pool's environment says, if there is one: see `lock`."""
        try:
            locked = lock.read(folder)
        except PoolError as error:
            self.of_pool(lock.FILE, "refuted", str(error))
            return
        if locked is None:
            return
        if wrong := lock.differing(locked, claims.versions):
            what = ", ".join(
                f"{package} {told}, the manifest {claims.versions[package]}" for package, told in wrong.items()
            )
            self.of_pool(lock.FILE, "refuted", f"it says {what}")
            return
        here = lock.needed(claims.task.family, versions())
        if strange := lock.strange(locked, here):
            what = f"{lock.FILE} names {cut(', '.join(strange))}, which no verdict touches here: do not install from it"
            self.remarks.append(what)
        elif other := lock.differing(locked, here):
            told = ", ".join(f"{package} {made} (here {here[package]})" for package, made in other.items())
            install = f"pip install --no-deps -r {folder / lock.FILE}"
            self.remarks.append(
                f"made with {told}; in an environment with scengen, {install} gives what it was made with"
            )

    def report(self) -> Report:
        verdicts = [e.verdict for e in self.examinations]
        faults = [{"id": e.id, "verdict": e.verdict, "reason": "; ".join(e.reasons)} for e in self.examinations]
        simulated = sum(e.simulated for e in self.examinations)
        level, failed = self.level, self.failed + [f for f in faults if f["verdict"] != "sound"]
        return Report(
            self.pool_verdict,
            level,
            len(verdicts),
            verdicts.count("sound"),
            verdicts.count("refuted"),
            verdicts.count("declined"),
            sum(e.rebuilt for e in self.examinations),
            simulated,
            simulated if level in ("recheck", "full") else 0,
            simulated if level == "full" else 0,
            len(self.left_out),
            failed,
            sum(e.expired for e in self.examinations),
            sum(e.drifted for e in self.examinations),
            self.settings,
            self.differences,
            self.sample,
            self.remarks,
            faults,
            {id_: self.names[id_] for f in failed if (id_ := f["id"]) in self.names},
        )


def differences(installed: Any, stored: Any, key: str = "") -> Iterator[dict[str, str]]:
    """Where two mappings differ: dotted key, and both values."""
    if isinstance(installed, Mapping) and isinstance(stored, Mapping):
        for name in [*installed, *(n for n in stored if n not in installed)]:
            below = f"{key}.{name}".strip(".")
            yield from differences(installed.get(name, _NONE), stored.get(name, _NONE), below)
    elif installed != stored:
        yield {"key": key, "pool": _told(stored), "installed": _told(installed)}


_NONE: Any = object()


def _told(value: Any) -> str:
    return "(not there)" if value is _NONE else str(value)[:200]
