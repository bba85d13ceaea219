"""docs/tasks.webp: witnesses of six tasks side by side, as an animated picture for the first page. `make docs`

Each witness is played in the time of the longest one, so that all end together. Pictures need OpenGL.
"""

from contextlib import closing
from pathlib import Path

import numpy as np
from PIL import Image

import scengen
from scengen.pictures.film import LOOKS, Take
from scengen.pictures.render import Camera, Picture

PAGE = Path("docs/tasks.webp")
TASKS = ("domino_single", "tool_retrieve", "bowl_table", "seesaw_balance", "packing", "cube_toss")
COLUMNS = 3
WIDTH, HEIGHT = 288, 216
"""Size of one witness [pixels]."""
FRAMES = 90
FRAME_TIME = 90
"""Time for which a frame is shown [ms]."""
END_TIME = 1500
"""Time for which the last frame is shown [ms]."""
QUALITY = 55
"""WebP quality: lower values show blocks around the arm."""


def main() -> None:
    """Write the picture."""
    films = [film(task) for task in TASKS]
    rows = [films[k : k + COLUMNS] for k in range(0, len(films), COLUMNS)]
    frames = [Image.fromarray(np.vstack([np.hstack([one[k] for one in row]) for row in rows])) for k in range(FRAMES)]
    times = [FRAME_TIME] * (FRAMES - 1) + [END_TIME]
    frames[0].save(PAGE, save_all=True, append_images=frames[1:], duration=times, loop=0, quality=QUALITY, method=6)
    print(f"wrote {PAGE}: {PAGE.stat().st_size / 1e6:.1f} MB")


def film(name: str) -> list[Picture]:
    """Pictures of the witness of training scenario 0 of a task, at equal times."""
    task = scengen.load_task(name)
    scenario = task.draw("id", seed=0, index=0).scenario
    certified = scengen.certify(scenario, task.horizon, embodiment=task.embodiment)
    take = Take(scenario, certified.scene_xml, task.embodiment, certified.witness)
    with closing(Camera(take.world(), WIDTH, HEIGHT)) as eye:
        eye.look([eye.world.state() for _ in take.moments(eye.world, take.even(LOOKS))])
        return [eye.take() for _ in take.moments(eye.world, take.even(FRAMES))]


if __name__ == "__main__":
    main()
