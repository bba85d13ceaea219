"""Templates of HTML pages, and thumbnails on them."""

import jinja2

from ..look.looks import ROOM, Look
from ..validate.playable import check_scene
from . import render
from .views import VIEWS, Directions

LARGEST_PAGE = 19_000_000
"""Largest size of the scenarios on a page [characters]. The whole page is then below 20 MB, which browsers open at
once."""


def template(name: str) -> jinja2.Template:
    """A page of scengen/pictures/templates. Inserted texts are escaped."""
    loader = jinja2.PackageLoader("scengen", "pictures/templates")
    return jinja2.Environment(loader=loader, autoescape=True).get_template(name)


def thumbnail(scene_xml: str, embodiment: str, directions: Directions = VIEWS, look: Look = ROOM) -> str:
    """A picture of the start of a scenario, as a data address for HTML.

    Args:
        directions: those of the views to choose from.
    """
    check_scene(scene_xml, embodiment)
    with render.camera(scene_xml, embodiment, look=look) as view:
        view.frame(directions=directions)
        return render.address(render.encode(view.take()), "webp")
