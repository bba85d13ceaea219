"""Extent and result of the verification of an evaluation."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..validate.verify.examine import Verdict
from ..work.parallel import Workers

SAMPLE = 20
"""Number of lines that are rebuilt by default."""


@dataclass(frozen=True)
class Options:
    """Extent of a verification."""

    sample: int | None = SAMPLE
    """Number of lines to rebuild; None for all."""
    seed: int = 0
    """Seed of the sample."""
    pools: Sequence[str] = ()
    """Folders of pools that are not where the run found them."""
    workers: Workers = 1
    """Workers that rebuild lines."""
    search: Sequence[str] = ()
    """Overrides that add folders of other packages."""


@dataclass
class ResultsReport:
    """Result of the verification of the episodes of one policy."""

    folder: str
    """Folder of the episodes."""
    lines: int = 0
    """Number of lines."""
    rebuilt: int = 0
    """Number of lines that were rebuilt."""
    pictures: int = 0
    """Number of rebuilt lines whose pictures were compared."""
    replayed: int = 0
    """Number of lines whose kept actions were played to the end."""
    faults: list[str] = field(default_factory=list)
    """What is wrong."""
    declined: list[str] = field(default_factory=list)
    """What could not be decided."""
    claimed: list[str] = field(default_factory=list)
    """What is the author's word."""
    remarks: list[str] = field(default_factory=list)
    """What a reader should know."""

    @property
    def verdict(self) -> Verdict:
        """Whether everything that was checked is right."""
        return "refuted" if self.faults else "declined" if self.declined else "sound"
