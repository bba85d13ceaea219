"""look at scenarios, drive the robot, or judge the episodes of a recording, on a local web page"""

import threading
import webbrowser
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from ...demos.curate.curation import decided_again
from ...demos.teleop.collect import TeleopSettings
from ...errors import BadConfig
from ...export.dataset import Recording
from ...ood.analysis.redraw import task_of
from ...pool import Pool
from ...samplers.task_files import search_path
from ...work.extras import module_of_extra
from . import OK, Arguments, one, say, several
from .demos_pad import source_of_pool
from .settings import read

LOOPBACK = ("127.0.0.1", "localhost", "::1")
"""Addresses that only this machine reaches."""


@dataclass(frozen=True)
class StudioSettings:
    """Settings of `scengen studio`; conf/command/studio.yaml explains them."""

    pool: str | list[str] | None
    data: str | list[str] | None
    to: str | None
    id: str | None
    n: int
    operator: str
    host: str
    port: int
    open: bool


def command(arguments: Arguments) -> int:
    settings = read("studio", arguments, StudioSettings)
    if (settings.pool is None) == (settings.data is None):
        raise BadConfig(
            "studio needs either pool=FOLDER, to browse or drive scenarios, or data=FOLDER, to judge a recording"
        )
    if not 0 <= settings.port < 65536:
        raise BadConfig(f"port = {settings.port}; it must lie in [0, 65535]; 0 takes any free one")
    app, search = _app(), tuple(search_path(arguments))
    if settings.to is None and settings.id is not None:
        raise BadConfig("id= chooses a scenario to drive; give to=FOLDER, too, or find it on the page")
    if settings.data is not None and settings.to is not None:
        raise BadConfig("to= is for takes that are driven; verdicts go to the folder of data=: leave it out")
    if settings.data is not None:
        content = _recordings(app, settings, search)
    else:
        content = (_pools if settings.to is None else _takes)(app, settings, search)
    studio = app.Studio(content, settings.host, settings.port)
    try:
        say(f"open {studio.address}")
        if settings.host not in LOOPBACK:
            say(f"reachable from other machines by {settings.host}; everyone who knows the address can use it")
        say("end with Ctrl-C")
        if settings.open:
            webbrowser.open(studio.address)
        threading.Event().wait()
    except KeyboardInterrupt:
        say("closed")
    finally:
        studio.close()
    return OK


def _pools(app: ModuleType, settings: StudioSettings, search: tuple[str, ...]) -> Any:
    """Pools to browse.

    Raises:
        ScengenError: one of them cannot be read, or is empty.
    """
    pools = [Pool.open(folder).check() for folder in several(settings.pool or "")]
    if empty := [pool for pool in pools if not len(pool)]:
        raise BadConfig(f"{empty[0].folder} holds no scenario; name another pool")
    tasks = {str(pool.folder): task_of(pool, search) for pool in pools}
    return app.Content(app.Shelf(pools, tasks, search))


def _takes(app: ModuleType, settings: StudioSettings, search: tuple[str, ...]) -> Any:
    """Takes to drive, in scenarios of a pool.

    Raises:
        ScengenError: the pool cannot be read, or the folder of the takes belongs to another run.
    """
    teleop = TeleopSettings(device="browser", n=settings.n, operator=settings.operator, to=settings.to)
    teleop.check()
    pool = Pool.open(one(settings.pool)).check()
    return app.Content(shelf=None, driver=app.Driver(source_of_pool(pool, search, settings.id), teleop))


def _recordings(app: ModuleType, settings: StudioSettings, search: tuple[str, ...]) -> Any:
    """Recordings to judge. They must have been curated.

    Raises:
        ScengenError: one of them cannot be read.
    """
    folders = [settings.data] if isinstance(settings.data, str) else list(settings.data or ())
    recordings = [Recording.open(folder) for folder in folders]
    for recording in recordings:
        decided_again(recording)
    return app.Content(shelf=None, desk=app.Desk(recordings, search))


def _app() -> ModuleType:
    """The module that needs viser."""
    return module_of_extra("scengen.studio.app", "the studio needs", "studio")
