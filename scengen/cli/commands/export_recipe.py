"""write scripts that train and evaluate a policy of LeRobot or robomimic on a recording, with all numbers"""

from pathlib import Path

from ...export.recipes.settings import RecipeSettings
from ...export.recipes.writer import write_recipe
from . import OK, Arguments, say
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("export recipe", arguments, RecipeSettings)
    scripts = write_recipe(settings)
    say(f"wrote {settings.to}: {', '.join(scripts.files)}. {scripts.origin}")
    say(f"next, {scripts.install}")
    smoke, train, evaluate = (Path(settings.to, name) for name in ("smoke.sh", "train.sh", "evaluate.sh"))
    say(f"then: sh {smoke}; sh {train}; sh {evaluate} POOL")
    return OK
