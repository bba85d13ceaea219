"""Settings of a certificate: the numbers of conf/certify/*.yaml, with their types."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from scipy.special import betaincinv

from ..errors import BadConfig, cut

CONFIDENCE = 0.95
"""Confidence of the bound of the robustness check, one-sided."""
FEWEST = 2
"""Smallest number of rollouts of an attack on a scenario: one plan, filtered and raw."""
MAX_RUNS = 1000
"""Largest number of jittered runs."""


def lower_bound(successes: int, runs: int) -> float:
    """One-sided Clopper-Pearson lower bound of a success rate at 95 % confidence."""
    return float(betaincinv(successes, runs - successes + 1, 1 - CONFIDENCE)) if successes else 0.0


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
        if 0 < self.attack < FEWEST:
            raise BadConfig(
                f"certify.attack = {self.attack}; a plan is played filtered and raw; give 0, or {FEWEST} or more"
            )
        runs, bound = self.robust.runs, self.robust.bound
        if lower_bound(runs, runs) < bound:
            fewest = next((n for n in range(runs, MAX_RUNS + 1) if lower_bound(n, n) >= bound), None)
            shown = math.floor(100 * lower_bound(runs, runs)) / 100
            more = f"certify.robust.runs={fewest}, or " if fewest else ""
            raise BadConfig(
                f"certify.robust.runs = {runs} with certify.robust.bound = {bound:g} cannot be met: {runs} successes "
                f"in {runs} runs show {lower_bound(runs, runs):.3g}; give {more}certify.robust.bound={shown:g}"
            )

    def falls_short(self, level: "CertifySettings") -> bool:
        """Whether these settings have the name of a level and show less than it. Those of quick may show anything."""
        return self.name != QUICK.name and self.robust.bound < level.robust.bound


BOUNDS: dict[str, tuple[float, float, str]] = {
    "overlap": (0.0, 0.01, " m"),
    "rest.seconds": (0.1, 60.0, " s"),
    "rest.drift": (1e-5, 0.1, " m"),  # contacts of MuJoCo give way by some micrometres
    "rest.turn": (0.0, 90.0, " deg"),
    "settle": (0.01, 10.0, " s"),  # one control period at least
    "robust.runs": (1, MAX_RUNS, ""),
    "robust.bound": (0.0, 1.0, ""),  # what the number of runs can show
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
