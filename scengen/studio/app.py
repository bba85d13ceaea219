"""The studio: its server, and one page for each browser that opens it."""

import threading
from dataclasses import dataclass

import viser

from .browse import CAMERA, FIELD_OF_VIEW, LOOK_AT, Browser, Shelf
from .driving import DrivePage, Driver
from .judge import Desk, Judge
from .scene import light
from .server import Guard, close_server, new_token, open_server

STYLES = "studio.css"
"""File that lays out the page."""
PAD = "pad.js"
"""File that reads pads and keys in the browser."""
PANEL_WIDTH = 400
"""Width of the panel to the right of the scene [pixels]."""


@dataclass(frozen=True)
class Content:
    """Content of the studio."""

    shelf: Shelf | None
    """Pools to browse; None without pools."""
    desk: Desk | None = None
    """Recordings to judge; None without recordings."""
    driver: Driver | None = None
    """Takes to drive; None without takes."""


class Studio:
    """A running studio. `address` holds the token; `close` ends it."""

    def __init__(self, content: Content, host: str, port: int, token: str | None = None):
        """Open the studio.

        Args:
            port: the next free one is taken if it is in use.
            token: by default a new one.
        """
        self.content, self.token = content, token or new_token()
        self._pages: dict[int, Page] = {}
        self._lock = threading.Lock()
        driver = content.driver
        sockets = {} if driver is None else {"/pad": driver.pad.serve}
        self.server = open_server(host, port, Guard(self.token, sockets, [STYLES] if driver is None else [STYLES, PAD]))
        self.server.gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.gui.main_panel.set_width(PANEL_WIDTH)
        light(self.server.scene)
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._left)
        if driver is not None:
            driver.start()

    @property
    def address(self) -> str:
        """Address of the page, with the token."""
        host = self.server.get_host()
        shown = "127.0.0.1" if host == "0.0.0.0" else host
        return f"http://{shown}:{self.server.get_port()}/{self.token}/"

    def close(self) -> None:
        """Close all pages and the server."""
        with self._lock:
            pages, self._pages = list(self._pages.values()), {}
        for page in pages:
            page.close()
        if self.content.driver is not None:
            self.content.driver.close()
        close_server(self.server)

    def _connected(self, client: viser.ClientHandle) -> None:
        page = Page(client, self.content)
        with self._lock:
            self._pages[client.client_id] = page

    def _left(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.close()


class Page:
    """Page of one browser. Two browsers look at different things."""

    def __init__(self, client: viser.ClientHandle, content: Content):
        client.camera.position, client.camera.look_at, client.camera.fov = CAMERA, LOOK_AT, FIELD_OF_VIEW
        gui, tabs = client.gui, client.gui.add_tab_group()
        self.browser: Browser | None = None
        self.judge: Judge | None = None
        if content.shelf is not None:
            with tabs.add_tab("browse"):
                self.browser = browser = Browser(client, content.shelf)
            gui.add_command("next scenario", hotkey="N").on_trigger(lambda _: browser.step(1))
            gui.add_command("previous scenario", hotkey="P").on_trigger(lambda _: browser.step(-1))
        if content.desk is not None:
            with tabs.add_tab("judge"):
                self.judge = judge = Judge(client, content.desk)
            for score in ("1", "2", "3", "4", "5"):
                command = gui.add_command(f"score {score}", hotkey=score)
                command.on_trigger(lambda _, given=int(score): judge.score(given))
            gui.add_command("accept", hotkey="A").on_trigger(lambda _: judge.decide("accept"))
            gui.add_command("reject", hotkey="R").on_trigger(lambda _: judge.decide("reject"))
            gui.add_command("next episode", hotkey="J").on_trigger(lambda _: judge.step("next episode"))
            gui.add_command("previous episode", hotkey="K").on_trigger(lambda _: judge.step("previous episode"))
            gui.add_command("next undecided episode", hotkey="U").on_trigger(lambda _: judge.step("next undecided"))
        self._number, self._driver = client.client_id, content.driver
        self.drive: DrivePage | None = None
        if content.driver is not None:
            with tabs.add_tab("drive"):
                self.drive = DrivePage(client, content.driver)
            content.driver.add(self._number, self.drive)
        shown = self.judge or self.browser
        if shown is not None:
            gui.add_command("play or pause", hotkey="space").on_trigger(lambda _: shown.player.toggle())

    def close(self) -> None:
        """End the threads of the page."""
        if self._driver is not None:
            self._driver.remove(self._number)
        for part in (self.browser, self.judge, self.drive):
            if part is not None:
                part.close()
