"""Settings of a certificate: the numbers of conf/certify/*.yaml, with their types."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from scipy.special import betaincinv

from ..errors import BadConfig, cut


@dataclass(frozen=True)
class Rest:
    """Limits of the rest check."""

    seconds: float = 2.0
    drift: float = 0.001
    turn: float = 0.5


@dataclass(frozen=True)
class Robust:
    """Jitter and lower bound of the robustness check."""

    runs: int = 4
    bound: float = 0.45
    position: float = 0.002
    turn: float = 1.0
    mass: float = 0.05
    friction: float = 0.10
    noise: float = 0.03
    latency: int = 1


@dataclass(frozen=True)
class CertifySettings:
    """Settings of all checks. Units are given next to the numbers in conf/certify/quick.yaml."""

    name: str = "quick"
    overlap: float = 0.001
    rest: Rest = field(default_factory=Rest)
    settle: float = 1.0
    robust: Robust = field(default_factory=Robust)
    attack: int = 0

    def check(self) -> None:
        """Raise `BadConfig` for a number with which a check would be meaningless or never end."""
        for name, value in leaves(asdict(self)):
            low, high, unit = BOUNDS[name]
            if not low <= value <= high:
                raise BadConfig(f"certify.{name} = {cut(str(value))}; it must lie in [{low:g}, {high:g}]{unit}")
        runs, best = self.robust.runs, lower_bound(self.robust.runs, self.robust.runs)
        if best < self.robust.bound:
            what = f"certify.robust.bound = {self.robust.bound:g} cannot be shown by certify.robust.runs = {runs}"
            remedy = f"lower the bound, or ask for more runs ({QUICK.robust.runs} show {QUICK.robust.bound:g})"
            raise BadConfig(f"{what}: if all succeed, it is {best:.3g}; {remedy}")


CONFIDENCE = 0.95
"""Confidence of the one-sided bound on the oracle's success rate."""


def lower_bound(successes: int, runs: int) -> float:
    """One-sided Clopper-Pearson lower bound of a success rate at 95 % confidence."""
    return float(betaincinv(successes, runs - successes + 1, 1 - CONFIDENCE)) if successes else 0.0


BOUNDS: dict[str, tuple[float, float, str]] = {
    "overlap": (0.0, 0.01, " m"),
    "rest.seconds": (0.1, 60.0, " s"),
    "rest.drift": (0.0, 0.1, " m"),
    "rest.turn": (0.0, 90.0, " deg"),
    "settle": (0.01, 10.0, " s"),  # one control period at least
    "robust.runs": (1, 1000, ""),
    "robust.bound": (0.0, 1.0, ""),
    "robust.position": (0.0, 0.1, " m"),
    "robust.turn": (0.0, 180.0, " deg"),
    "robust.mass": (0.0, 0.9, ""),  # relative: a body keeps a tenth of its mass
    "robust.friction": (0.0, 0.9, ""),
    "robust.noise": (0.0, 1.0, ""),  # the whole range of a channel on one side
    "robust.latency": (0, 100, " control periods"),  # one second
    "attack": (0, 10_000, " rollouts"),
}
"""Smallest and largest value of every setting, and its unit."""


def leaves(node: Mapping[str, Any], prefix: str = "") -> list[tuple[str, float]]:
    """The numbers of nested settings by dotted name."""
    found = []
    for key, value in node.items():
        if isinstance(value, Mapping):
            found += leaves(value, f"{prefix}{key}.")
        elif f"{prefix}{key}" != "name":
            found.append((f"{prefix}{key}", value))
    return found


QUICK = CertifySettings()
"""Settings with few repetitions, which take seconds per scenario."""
