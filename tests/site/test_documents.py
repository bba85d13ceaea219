"""Pages of documentation: every link and picture leads somewhere, within one folder; there is a navigation."""

import re
from pathlib import Path

import pytest

pytest.importorskip("viser", reason="no viser; it is in the extras studio and dev")

from scengen.site.build import build
from scengen.site.markdown import Documentation, html_of

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    to = tmp_path_factory.mktemp("site")
    build([], to, ROOT)
    return to


def links(page):
    """Addresses that a page names, without those of other hosts."""
    found = re.findall(r'(?:href|src|action)="([^"]*)"', page.read_text())
    return [link for link in found if not re.match(r"(https?|mailto|data):", link)]


def test_every_link_within_the_site_leads_somewhere(site):
    pages = [page for page in site.rglob("*.html") if page.name != "player.html"]
    assert site / "index.html" in pages and site / "docs/tasks/packing.html" in pages
    anchors = {page: set(re.findall(r' id="([^"]+)"', page.read_text())) for page in pages}
    wrong, count = [], 0
    for page in pages:
        for link in links(page):
            path, _, part = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            count += 1
            if not target.exists() or (part and target in anchors and part not in anchors[target]):
                wrong.append((str(page.relative_to(site)), link))
    assert count > 1000 and not wrong


def test_links_hold_wherever_the_folder_lies(site):
    """Also below a path of a host, or without one: no address begins at the host's root, and nothing is fetched."""
    for page in site.rglob("*.html"):
        text = page.read_text()
        assert not [link for link in links(page) if link.startswith("/")], page
        assert not re.findall(r'<(?:script|img|iframe|link)[^>]+(?:src|href)="(?:https?:)?//', text), page


def test_every_page_has_the_navigation_with_its_place_marked(site):
    text = (site / "docs/studio.html").read_text()
    titles = ["For users", "For policy researchers", "For authors of tasks and axes", "For reviewers"]
    assert [title for title in re.findall(r"<h2>([^<]+)</h2>", text) if title in titles] == titles
    assert '<a href="../docs/studio.html" aria-current="page">Studio</a>' in text


@pytest.fixture
def small(tmp_path):
    (tmp_path / "docs/tasks").mkdir(parents=True)
    (tmp_path / "README.md").write_text(
        "# Ours\n\n[a task](docs/tasks/push.md#x), [page](docs/page.md#b-c) [web](https://a.b)\n"
    )
    (tmp_path / "docs/tasks/push.md").write_text("# Push\n")
    (tmp_path / "docs/page.md").write_text(
        "# Page\n\n## B c!\n\n## B c!\n\n<script>alert(1)</script> [x](javascript:alert(1))\n\n"
        "| task | axis |\n|---|---|\n| push | far |\n| push | other |\n| pull | far |\n"
    )
    return tmp_path


def test_pages_of_tasks_in_the_site_take_the_place_of_documents(small):
    ours = Documentation(small, {"push": ["far"]})
    assert Path("docs/tasks/push.md") not in ours.pages
    body = ours.page(Path("README.md")).body
    assert (
        'href="tasks/push/index.html"' in body and 'href="docs/page.html#b-c"' in body and 'href="https://a.b"' in body
    )
    lines = ours.page(Path("docs/page.md")).body
    assert '<a href="../tasks/push/index.html">push</a>' in lines and "<td>pull</td>" in lines
    assert '<a href="../tasks/push/index.html#axis-far">far</a>' in lines and "<td>other</td>" in lines
    assert 'href="docs/tasks/push.html#x"' in Documentation(small, {}).page(Path("README.md")).body


def test_a_document_runs_no_script_and_its_headings_have_the_ids_of_github(small):
    page = Documentation(small, {}).page(Path("docs/page.md"))
    assert "<script" not in page.body and 'href="javascript' not in page.body
    assert 'id="b-c"' in page.body and 'id="b-c-1"' in page.body


def test_without_an_index_all_pages_are_one_group(small):
    (group,) = Documentation(small, {}).groups()
    assert [name for name, _ in group.pages] == ["Ours", "Page", "Push"]
    assert [str(html_of(page)) for _, page in group.pages] == ["about.html", "docs/page.html", "docs/tasks/push.html"]
