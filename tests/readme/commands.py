"""The commands of README.md, as they are written there, and which of them are not run as a matter of course."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

APART = {
    "make demo": "continuous integration runs it by itself",
    "make test": "continuous integration runs it by itself",
    "scengen generate task=domino_single split=diagonal+wide_gaps certify=full": "certifies at level full: 5 minutes",
    "scengen generate task=seesaw_balance": "64 scenarios: 10 minutes",
    "scengen generate task=domino_single split=slick": "20 scenarios more: 2 minutes",
    "scengen generate task=domino_single n=100 attack=500": "100 scenarios, and 500 rollouts: 15 minutes",
    "scengen verify pool=generated/id level=full": "certifies 20 scenarios again at level full: 3 minutes",
    "scengen view": "needs a display",
    "scengen attack pool=generated/id": "200 rollouts like those before, on scenarios of a pool: 2 minutes",
    "scengen film hit=": "the name is that of a hit, which differs from machine to machine",
    "scengen record": "20 scenarios before four cameras: half an hour without a graphics card",
    "scengen axis": "an hour",
    "scengen discover": "an hour",
    "scengen shrink": "certifies some hundred scenarios: 10 minutes",
}
"""Beginnings of commands that `make readme` leaves out, and why; `make readme ALL=all` runs them too."""


def commands(page: Path = ROOT / "README.md") -> list[str]:
    """Every command in the `sh` blocks of a page, in order; a line that ends in a backslash goes on in the next."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.M | re.S)
    return [line for block in blocks for line in block.replace("\\\n", " ").splitlines() if line.strip()]


def why_apart(command: str) -> str:
    """Why a command is not run as a matter of course; empty for one that is."""
    return next((why for start, why in APART.items() if command.startswith(start)), "")
