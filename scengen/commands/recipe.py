"""write scripts that train and evaluate a policy of LeRobot on a recording, with every number written out"""

from pathlib import Path

from ..export.recipe import LEROBOT, RecipeSettings, write_recipe
from . import OK, Arguments, say
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("recipe", arguments, RecipeSettings)
    recipe, names = write_recipe(settings)
    say(f"wrote {settings.to}: {', '.join(names)}. {recipe.origin}")
    install, smoke, train, evaluate = (Path(settings.to, name) for name in names)
    say(f"next, with Python 3.12 in an environment of its own: pip install -r {install} (LeRobot {LEROBOT})")
    say(f"then: sh {smoke}; sh {train}; sh {evaluate} POOL")
    return OK
