"""The recipes by name, and how they are written to a folder."""

from collections.abc import Callable, Mapping
from pathlib import Path

from ...errors import UnknownName
from ...work.targets import try_folder, write
from . import lerobot, robomimic
from .settings import RecipeSettings, Scripts

RECIPES: Mapping[str, Callable[[RecipeSettings], Scripts]] = {
    **dict.fromkeys(lerobot.RECIPES, lerobot.scripts),
    robomimic.NAME: robomimic.scripts,
}
"""Functions that make the scripts of each recipe."""


def write_recipe(settings: RecipeSettings) -> Scripts:
    """Write the scripts of a recipe for a recording.

    Raises:
        ScengenError: there is no such recipe or recording, the policy cannot be trained on it, or it cannot be written.
    """
    if settings.train not in RECIPES:
        raise UnknownName("recipe", settings.train, RECIPES)
    scripts, folder = RECIPES[settings.train](settings), Path(settings.to)
    try_folder(folder)
    for name, text in scripts.files.items():
        write(folder / name, text)
    return scripts
