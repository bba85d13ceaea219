"""Exhibits of the site that nothing was simulated for."""

import json
from dataclasses import asdict

from PIL import Image

from scengen.site import exhibit
from scengen.site.build import Shown, build
from scengen.site.exhibit import Clip, Ending, Exhibit, Pair, Step


def made(task, key, text="text"):
    """What could have been made for a task, with a text wherever one of a pool is shown."""
    return Exhibit(
        key=key,
        name=task.name,
        code=task.code,
        category=task.category,
        instruction=text,
        hands="jaw",
        axes=[*task.axes],
        words=text,
        scenario=text,
        clips=[
            Clip("witness", text, text, text, 1.0, 10**6, f"{task.name}/film-1"),
            Clip(text, text, text, text, 1, 1, ""),
        ],
        pairs=[Pair(axis, "a.webp", [Step(text, [text], "b.webp")] * 2, True) for axis in task.axes],
        shortcuts=[Ending(text, text, text, text, 1.0)],
        ablations=[Ending(text, "", text, text, 1.0)],
    )


def site_of(task, to, text="text"):
    """Write the site of a task with plain pictures, and with a text wherever one of a pool is shown."""
    folder, shown = to / "tasks" / task.name, Shown(task)
    folder.mkdir(parents=True)
    for name in ("picture", "strip", "a", "b"):
        Image.new("RGB", (40, 30), "teal").save(folder / f"{name}.webp")
    (folder / exhibit.DESCRIPTION).write_text(json.dumps(asdict(made(task, shown.key, text))))
    assert build([shown], to).kept == [task.name]
    return to
