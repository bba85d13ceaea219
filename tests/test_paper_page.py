"""docs/paper.md says what the docstrings of the families say, of every task."""

import importlib.util
from pathlib import Path

from scengen import config

ROOT = Path(__file__).parents[1]


def test_the_page_is_up_to_date():
    spec = importlib.util.spec_from_file_location("paper_page", ROOT / "tools" / "paper_page.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    text = tool.PAGE.read_text()
    assert text == tool.page(), "docs/paper.md is out of date; run python tools/paper_page.py"
    assert all(f"[{name}](tasks/{name}.md)" in text for name in config.tasks())
