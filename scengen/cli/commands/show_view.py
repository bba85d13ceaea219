"""open a scenario in MuJoCo's viewer, still or with its witness in real time"""

from dataclasses import dataclass

from ...ood.analysis.redraw import task_of
from ...pictures.view import check_display, view
from ...samplers.task_files import search_path
from ...validate.playable import check_row
from . import OK, Arguments, chosen, holder, identified
from .settings import read


@dataclass(frozen=True)
class ViewSettings:
    """Settings of `scengen show view`; conf/command/show_view.yaml explains them."""

    pool: str | list[str]
    id: str | None
    index: int | None
    replay: bool


def command(arguments: Arguments) -> int:
    settings = read("show view", arguments, ViewSettings)
    name = identified(settings.pool, settings.id, settings.index)
    pool = holder(settings.pool, name)
    row = chosen(pool, name)
    scenario = task_of(pool, search_path(arguments)).scenario(row.params)
    check_display()
    check_row(row)
    view(row, scenario, settings.replay)
    return OK
