"""Writes the pictures of docs/, which need OpenGL. `make pictures`

python tools/pictures.py [strips] [TASK ...]   # docs/tasks: a film strip of a witness; docs/scenes.webp: all scenes
python tools/pictures.py film                  # docs/tasks.webp: witnesses of six tasks side by side
"""

import io
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scengen import list_tasks, load_task
from scengen.pictures.film import FRAMED, Take, strip
from scengen.pictures.render import Camera, Picture, camera
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
STRIP_QUALITY = 74
"""JPEG quality of the strips: grained wood takes a third more bytes than a plain table."""
OVERVIEW = Path("docs/scenes.webp")
"""Picture that shows the first scene of all tasks."""
QUALITY = 70
"""WebP quality of the overview: a tenth of the bytes of a PNG."""
COLUMNS = 4
"""Scenes in a row of the overview."""
SMALL = (300, 225)
"""Width and height of a scene in the overview [pixels]."""
LABEL = 24
"""Height of the text under a scene in the overview [pixels]."""


FILM = Path("docs/tasks.webp")
FILMED = ("domino_single", "tool_retrieve", "bowl_table", "seesaw_balance", "packing", "cube_toss")
FILM_COLUMNS = 3
"""Witnesses in a row of the film."""
FILM_SIZE = (288, 216)
"""Width and height of one witness in the film [pixels]."""
FILM_FRAMES = 90
"""Number of pictures in the film."""
FRAME_TIME = 90
"""Time for which a frame is shown [ms]."""
END_TIME = 1500
"""Time for which the last frame is shown [ms]."""
FILM_QUALITY = 55
"""WebP quality: lower values show blocks around the arm."""


def main(*words: str) -> None:
    """Write the film, or the strips and the overview."""
    if words[:1] == ("film",):
        write_film()
    else:
        write_strips(*(word for word in words if word != "strips"))


def write_strips(*names: str) -> None:
    """Write the film strips of some tasks, or of all, and the overview."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or list_tasks():
        _save(FOLDER / f"{name}.jpg", strip(witness(name), FRAMES, WIDTH, HEIGHT))
        print(f"wrote {FOLDER / name}.jpg", flush=True)
    Image.fromarray(overview()).save(OVERVIEW, quality=QUALITY, method=6)


def witness(name: str) -> Take:
    """The witness of a training scenario of a task."""
    task = load_task(name)
    scenario = task.draw(ID, 0, SCENARIO).scenario
    certified = certify(scenario, task.horizon, embodiment=task.embodiment)
    if certified.certificate.verdict != "certified":
        sys.exit(f"{name}: scenario {SCENARIO} is {certified.certificate.reason}")
    return Take(scenario, certified.scene_xml, task.embodiment, certified.witness)


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
    Image.fromarray(picture).save(content, "jpeg", quality=STRIP_QUALITY, optimize=True)
    path.write_bytes(content.getvalue())


def write_film() -> None:
    """Write the film. Each witness is played in the time of the longest one, so that all end together."""
    films = [film(task) for task in FILMED]
    rows = [films[k : k + FILM_COLUMNS] for k in range(0, len(films), FILM_COLUMNS)]
    frames = [
        Image.fromarray(np.vstack([np.hstack([one[k] for one in row]) for row in rows])) for k in range(FILM_FRAMES)
    ]
    times = [FRAME_TIME] * (FILM_FRAMES - 1) + [END_TIME]
    frames[0].save(
        FILM, save_all=True, append_images=frames[1:], duration=times, loop=0, quality=FILM_QUALITY, method=6
    )
    print(f"wrote {FILM}: {FILM.stat().st_size / 1e6:.1f} MB")


def film(name: str) -> list[Picture]:
    """Pictures of the witness of training scenario 0 of a task, at equal times."""
    take = witness(name)
    with closing(Camera(take.world(), *FILM_SIZE)) as eye:
        eye.frame([eye.world.state() for _ in take.moments(eye.world, take.even(FRAMED))])
        return [eye.take() for _ in take.moments(eye.world, take.even(FILM_FRAMES))]


if __name__ == "__main__":
    main(*sys.argv[1:])
