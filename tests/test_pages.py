"""Documentation: links hold in the repository, tables are generated, headline figures are those of the ledger."""

import importlib
import re

import build_docs
import docstrings
import pytest
import tables

from scengen import list_tasks, load_task
from scengen.site import task_page

ROOT = build_docs.ROOT
PAGES = [path for pattern in build_docs.WRITTEN for path in sorted(ROOT.glob(pattern))]
MOST_WORDS = 28_850
"""Number of words that docs/ may hold but for the generated page: people write them, and have to keep them true."""


def slugs(path):
    """Addresses of the headings of a page, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", path.read_text(), flags=re.S | re.M), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_of_the_repository_leads_somewhere(path):
    wrong = []
    for link in build_docs.LINK.findall(build_docs.FENCE.sub("", path.read_text())):
        place, _, part = link.partition("#")
        target = (path.parent / place).resolve() if place else path
        known = "://" in link or (target.exists() and (not part or target.suffix != ".md" or part in slugs(target)))
        wrong += [] if known else [link]
    assert not wrong


def test_each_word_of_the_glossary_is_linked_where_it_is_used():
    words, others = slugs(ROOT / "docs" / "glossary.md") - {"glossary"}, [p for p in PAGES if p.name != "glossary.md"]
    linked = {found for path in others for found in re.findall(r"glossary\.md#([\w-]+)", path.read_text())}
    assert words == linked
    assert len((ROOT / "docs" / "glossary.md").read_text().split()) <= 350


def test_people_keep_what_they_can_read():
    written = [path for path in (ROOT / "docs").rglob("*.md") if path != tables.RESULTS]
    assert sum(len(path.read_text().split()) for path in written) <= MOST_WORDS


@pytest.mark.each_change  # all tasks are loaded: 19 s
def test_the_page_of_results_is_that_of_the_ledger():
    text = tables.RESULTS.read_text()
    assert text == tables.results(), "docs/results.md is out of date; run make results"
    assert text.count("\n") <= 300 and all(f"[{name}](tasks/{name}.jpg)" in text for name in list_tasks())
    assert all((ROOT / "docs" / "tasks" / f"{name}.jpg").is_file() for name in list_tasks())
    axes = sum(len(load_task(name).axes) for name in list_tasks())
    assert f"along {axes} out-of-distribution" in (ROOT / "README.md").read_text()


@pytest.mark.parametrize("page", build_docs.FILLS)
def test_every_mark_of_a_page_is_filled(page):
    path = ROOT / "docs" / f"{page}.md"
    marks, fills = build_docs.MARK.findall(path.read_text()), build_docs.FILLS[page]()
    assert sorted(marks) == sorted(fills) and all(fills.values())
    text = build_docs.written(path)
    assert "<!--" not in text and len(text) > len(path.read_text())


def test_the_page_of_a_task_tells_everything_about_it():
    text = task_page.page(load_task("domino_single"), tables.of_axes("domino_single"))
    for told in ("| `gap_ratio` | tile widths |", "### wide_gaps", "| `push_the_slab` | raw | failure", "refuting"):
        assert told in text
    links = [link for link in build_docs.LINK.findall(text) if "://" not in link]
    assert len(links) > 5 and all((ROOT / "docs" / "tasks" / link).exists() for link in links)


def test_links_lead_from_stored_page_to_stored_page():
    text = "[a](docs/api.md#x) [b](docs/tasks/packing.jpg) ![c](docs/tasks/packing.jpg) [d](LICENSE) [e](https://f.g)\n"
    code = "```sh\n[h](docs/api.md)\n```"
    assert build_docs.relocated("README.md", text + code) == (
        "[a](api.md#x) [b](tasks/packing.md) ![c](tasks/packing.jpg) [d](files/LICENSE) [e](https://f.g)\n" + code
    )
    assert build_docs.relocated("docs/tasks/packing.md", "[a](../axes.md) [b](../../CONTRIBUTING.md)") == (
        "[a](../axes.md) [b](../contributing.md)"
    )
    [contents] = build_docs.navigation("docs/tasks.md", "| [`packing`](tasks/packing.jpg) | x |\n| [y](z.md) | w |\n")
    assert "packing <tasks/packing>\n```" in contents


def test_the_navigation_reaches_every_page():
    reached = {"docs/index.md"}
    for path in build_docs.CONTENTS:
        for entry in re.findall(
            r" <([^>]+)>$", "".join(build_docs.navigation(path, build_docs.written(ROOT / path))), re.M
        ):
            reached.add(entry)
    stored = {build_docs.stored(str(path.relative_to(ROOT))).removesuffix(".md") for path in PAGES} - {"index"}
    assert stored | {f"tasks/{name}" for name in list_tasks()} <= reached


def test_every_public_function_and_class_of_the_api_has_a_docstring():
    modules = re.findall(r"automodule:: (\S+)", "".join(path.read_text() for path in (ROOT / "docs/api").glob("*.md")))
    assert len(modules) == len(set(modules)) > 30
    for name in modules:
        module = importlib.import_module(name)
        own = {n: v for n, v in vars(module).items() if callable(v) and getattr(v, "__module__", "") == name}
        assert module.__doc__ and not [n for n, v in own.items() if not n.startswith("_") and not v.__doc__]


def test_docstrings_are_read_as_rest():
    text = (
        "What `a\nb` is.\n* one_ *x*\n\n    | sketch |\n    more `raw`\n\nArgs:\n    x: a [link](y.md).\n    *args: b."
    )
    assert docstrings.rest(text) == (
        "What ``a b`` is.\n\n* one\\_ \\*x\\*\n\n::\n\n    | sketch |\n    more `raw`\n\n\n"
        "Args:\n    x: a link.\n    *args: b."
    )
