"""Writes docs/tasks: a film strip of a witness of each task. `make pictures`

`python tools/task_pictures.py [task ...]` writes the strips of the named tasks only. docs/scenes.webp shows the first
scene of all tasks. Pictures need OpenGL.
"""

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scengen import list_tasks, load_task
from scengen.pictures.film import Take, strip
from scengen.pictures.render import Picture, camera
from scengen.samplers.split import ID
from scengen.validate.certify import certify
from scengen.validate.rebuilt import rebuild

FOLDER = Path("docs/tasks")
SCENARIO = 0
"""Index of the training scenario that is shown."""
FRAMES = 8
"""Number of pictures in a film strip."""
WIDTH = 320
"""Width of a picture in a film strip [pixels]."""
HEIGHT = 240
"""Height of a picture in a film strip [pixels]."""
OVERVIEW = Path("docs/scenes.webp")
"""Picture that shows the first scene of all tasks."""
QUALITY = 80
"""WebP quality of the overview: a tenth of the bytes of a PNG."""
COLUMNS = 4
"""Scenes in a row of the overview."""
SMALL = (300, 225)
"""Width and height of a scene in the overview [pixels]."""
LABEL = 24
"""Height of the text under a scene in the overview [pixels]."""


def main(*names: str) -> None:
    """Write the pictures."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or list_tasks():
        task = load_task(name)
        scenario = task.draw(ID, 0, SCENARIO).scenario
        certified = certify(scenario, task.horizon, embodiment=task.embodiment)
        if certified.certificate.verdict != "certified":
            sys.exit(f"{name}: scenario {SCENARIO} is {certified.certificate.reason}")
        take = Take(scenario, certified.scene_xml, task.embodiment, certified.witness)
        _save(FOLDER / f"{name}.jpg", strip(take, FRAMES, WIDTH, HEIGHT))
        print(f"wrote {FOLDER / name}.jpg", flush=True)
    Image.fromarray(overview()).save(OVERVIEW, quality=QUALITY, method=6)


def overview() -> Picture:
    """First states of one training scenario of every task, each under its code and name, in the order of the paper."""
    scenes = []
    for task in sorted(map(load_task, list_tasks()), key=lambda task: (task.code[0] != "T", task.code)):
        scene_xml = rebuild(task.draw(ID, 0, SCENARIO).scenario)
        with camera(scene_xml, task.embodiment, *SMALL) as view:
            scenes.append(labelled(view.take(), f"{task.code} {task.name}"))
    empty = np.full_like(scenes[0], 255)
    scenes += [empty] * (-len(scenes) % COLUMNS)
    return np.vstack([np.hstack(scenes[k : k + COLUMNS]) for k in range(0, len(scenes), COLUMNS)])


def labelled(picture: Picture, text: str) -> Picture:
    """A picture above a line of text."""
    line = Image.new("RGB", (picture.shape[1], LABEL), "white")
    ImageDraw.Draw(line).text((6, LABEL // 2), text, "black", ImageFont.load_default(LABEL * 2 // 3), anchor="lm")
    return np.vstack([picture, np.asarray(line)])


def _save(path: Path, picture: Picture) -> None:
    content = io.BytesIO()
    Image.fromarray(picture).save(content, "jpeg", quality=85, optimize=True)
    path.write_bytes(content.getvalue())


if __name__ == "__main__":
    main(*sys.argv[1:])
