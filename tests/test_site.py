"""The site is whole: every link and picture in it leads to a file of it."""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_every_link_within_the_site_leads_somewhere(tmp_path):
    subprocess.run([sys.executable, "tools/site.py", str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    pages = list(tmp_path.rglob("*.html"))
    assert tmp_path / "index.html" in pages and tmp_path / "docs" / "tasks" / "packing.html" in pages
    links = [(page, link) for page in pages for link in re.findall(r'(?:href|src)="([^"#:]+)["#]', page.read_text())]
    assert len(links) > 100 and not [link for page, link in links if not (page.parent / link).exists()]
