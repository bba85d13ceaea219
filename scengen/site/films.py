"""Films in three dimensions that play without a server: recordings of viser, and its player.

viser's page fetches a recording (`?playbackPath=`), which browsers refuse for pages that are opened as files. It also
plays one that a script has put into the page, as `StateSerializer.as_html` does; that works anywhere. Here the page is
stored once, and each recording is a separate script.
"""

import base64
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import viser

from ..pictures.views import clearest, view_axes
from ..sim.world import World
from ..studio.player import FRAME_TIME
from ..studio.scene import Film, SceneView
from ..studio.server import Guard, close_server, new_token, open_server
from ..work.targets import write

PLAYER = "player.html"
"""File of the player, at the top of the site. `?film=<task>/<name>` chooses the recording tasks/<task>/<name>.js."""
HOLD = 1.5
"""Time for which the last frame stands before the film starts again [s]."""
EXPOSURE = 0.7
"""Factor on colours, under which light things keep them in viser's own lights. Lights of ours would be lost when the
film starts again: the player then never removes its own ones from the scene (viser 1.1.1)."""
SCRIPT = """<script>
{
  const film = new URLSearchParams(location.search).get("film") ?? "";
  window.__VISER_EMBED_CONFIG__ = {darkMode: matchMedia("(prefers-color-scheme: dark)").matches};
  if (/^\\w+\\/[\\w-]+$/.test(film)) document.write(`<script src="tasks/${film}.js"><\\/script>`);
  else document.write("This page plays the films of the tasks; open one from the page of a task.");
}
</script>
"""
"""Script that loads the recording before viser's own script runs. Only names of recordings of this site are loaded."""


@dataclass(frozen=True)
class Recorded:
    """A recording on disk."""

    size: int
    """Size of its file [bytes]."""
    view: str
    """Camera at its start, as the end of the player's address."""


def player() -> str:
    """The page that plays all films."""
    page = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_text()
    head, end, rest = page.replace("<title>Viser</title>", "<title>scengen show film</title>").partition("</head>")
    return f"{head}{SCRIPT}{end}{rest}"


def record(world: World, film: Film, path: Path) -> Recorded:
    """Write a film as a script for the player.

    Args:
        world: the world of the film, with visual geoms.
        film: its poses.
        path: the script, in tasks/<folder> of the site.

    Raises:
        ScengenError: the scene has too many triangles, or the file cannot be written.
    """
    world.reset()
    server = open_server("127.0.0.1", 0, Guard(new_token()))  # viser records what a server would send
    try:
        view = SceneView(server.scene, "/scene")
        view.show(world, exposure=EXPOSURE, room=False)
        serializer = server.get_scene_serializer()
        for frame in film.frames:
            view.move(frame)
            serializer.insert_sleep(FRAME_TIME)
        serializer.insert_sleep(HOLD)
        content = base64.b64encode(serializer.serialize()).decode()
    finally:
        close_server(server)
    write(path, f'window.__VISER_EMBED_DATA__="{content}";\n')
    return Recorded(path.stat().st_size, _camera(world))


def _camera(world: World) -> str:
    """The clearest view of a world as parameters of viser's page."""
    mujoco.mj_forward(world.model, world.data)
    view = clearest(world, 4 / 3)
    eye = view.lookat - view.distance * view_axes(view)[0]
    spelled = (",".join(f"{number:.3f}" for number in np.asarray(point)) for point in (eye, view.lookat))
    names = ("initialCameraPosition", "initialCameraLookAt")
    fov = np.radians(world.model.vis.global_.fovy)
    return "&".join(
        [*(f"{name}={point}" for name, point in zip(names, spelled, strict=True)), f"initialCameraFov={fov:.3f}"]
    )
