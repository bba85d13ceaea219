"""Look at a certified scenario: in MuJoCo's viewer, or without a display in a film strip. Prints where to look."""

from pathlib import Path

import scengen
from scengen.pictures.film import Take, strip
from scengen.pictures.render import encode
from scengen.pictures.view import NoDisplay, view

POOL = scengen.reference_pool("domino_single")  # scenarios that come with scengen
PICTURE = Path("generated/examples/look.png")

pool = scengen.Pool.open(POOL)
task = scengen.load_task(pool.task)
row = pool.row("8ed4")  # the beginning of an id is enough
scenario = task.scenario(row.params)
print(f"{row.name}: {row.instruction}")
try:
    view(row, scenario, replay=True)  # the robot plays the recorded solution; close the window to continue
except NoDisplay:
    PICTURE.parent.mkdir(parents=True, exist_ok=True)
    PICTURE.write_bytes(encode(strip(Take.witness(row, scenario)), "png"))
    print(f"There is no display for the viewer. A film strip is in {PICTURE}.")
