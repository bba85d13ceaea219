"""Settings of `scengen export recipe`, and what a recipe gives back."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

EPISODES = 20
"""Number of evaluation episodes in each split, as in the paper."""
SMOKE_BATCHES = 20
"""Number of batches of the short run that shows whether the environment works."""


@dataclass(frozen=True)
class RecipeSettings:
    """Settings of `scengen export recipe`; conf/command/export_recipe.yaml explains them."""

    train: str = ""
    data: str = ""
    to: str = ""
    device: str = "cuda"
    seed: int = 1000

    def path(self, name: str) -> str:
        """Absolute path of something below the folder of the scripts."""
        return str(Path(self.to).resolve() / name)


@dataclass(frozen=True)
class Scripts:
    """The files of a recipe."""

    origin: str
    """Source of the numbers, as a sentence."""
    install: str
    """Instruction to install the requirements of the scripts, as a sentence."""
    files: Mapping[str, str]
    """Texts of the files, by name."""


def script(title: str, origin: str, lines: str) -> str:
    """A shell script that ends with the first error."""
    return f"#!/bin/sh\n# {title}\n# {origin}\nset -eu\n{lines}\n"
