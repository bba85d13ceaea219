"""Settings of a certificate: the numbers of conf/certify/*.yaml, with their types."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Rest:
    """Limits of the rest check."""

    seconds: float = 2.0
    drift: float = 0.001
    turn: float = 0.5


@dataclass(frozen=True)
class Robust:
    """Jitter and least bound of the robustness check."""

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
    """Settings of all checks. Units stand beside the numbers in conf/certify/quick.yaml."""

    name: str = "quick"
    overlap: float = 0.001
    rest: Rest = field(default_factory=Rest)
    settle: float = 1.0
    robust: Robust = field(default_factory=Robust)


QUICK = CertifySettings()
"""Few repetitions: seconds per scenario."""
