"""Pages that are written from the code and the files of the tasks are up to date, and speak of every task."""

import all_axes
import cluster_page
import paper_page
import pytest

from scengen import list_tasks


@pytest.mark.parametrize("tool", [all_axes, cluster_page, paper_page], ids=lambda tool: tool.__name__)
def test_the_page_is_up_to_date(tool):
    text = tool.PAGE.read_text()
    assert text == tool.page(), f"{tool.PAGE.name} is out of date; run python tools/{tool.__name__}.py"
    assert all(f"[{name}](tasks/{name}.md)" in text for name in list_tasks())
