"""docs/cluster.md tells what conf/certified.yaml says."""

import importlib.util
from pathlib import Path

from scengen import config

ROOT = Path(__file__).parents[1]


def test_the_costs_are_up_to_date():
    spec = importlib.util.spec_from_file_location("cluster_page", ROOT / "tools" / "cluster_page.py")
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    text = tool.PAGE.read_text()
    assert text == tool.page(), "docs/cluster.md is out of date; run python tools/cluster_page.py"
    assert all(f"[{name}](tasks/{name}.md)" in text for name in config.tasks())
