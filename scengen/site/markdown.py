"""Pages of documentation: Markdown as HTML, with links between pages that hold wherever the site lies."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/*/*.md",
    "examples/README.md",
    "task_template/README.md",
    "integrations/*/README.md",
)
"""Pages of a repository."""
FILES = (
    "docs/*.png",
    "docs/*.webp",
    "docs/*.svg",
    "docs/*/*.jpg",
    "docs/*/*.png",
    "examples/*.py",
    "examples/*.ipynb",
    "LICENSE",
    "CITATION.cff",
    "Dockerfile",
)
"""Files that pages show or link to."""
INDEX = Path("docs/index.md")
"""Page whose headings and links are the navigation."""
TASKS = Path("docs/tasks")
"""Folder of the pages of tasks; docs/tasks.md lists them."""
CONTENTS = 4
"""Smallest number of headings with which a page has a table of contents."""
CONTENTS_LEVELS = ("h2", "h3")
"""Headings in a table of contents."""
LONGEST_CONTENTS = 40
"""Largest number of lines of a table of contents; a longer one has headings of the first level alone."""


@dataclass(frozen=True)
class Heading:
    """A heading of a page."""

    level: str
    text: str
    slug: str
    """Its id, which links name after `#`."""


@dataclass(frozen=True)
class Page:
    """A page as HTML."""

    title: str
    body: Markup
    contents: list[Heading]
    """Headings for a table of contents; none for a short page."""


@dataclass(frozen=True)
class Group:
    """Pages under one heading of the navigation."""

    title: str
    pages: list[tuple[str, Path]]
    """Titles of pages, and their sources."""


def html_of(page: Path) -> Path:
    """File of a page in the site: `docs/index.md` is `docs/index.html`, and README.md of the top `about.html`."""
    return Path("about.html") if page == Path("README.md") else page.with_suffix(".html")


class Documentation:
    """The pages of a repository."""

    def __init__(self, root: Path, tasks: Mapping[str, Iterable[str]]):
        """
        Args:
            root: folder with README.md and docs/.
            tasks: names of the axes of each task that has a page in the site. Links to docs/tasks/<task>.md go there.
        """
        self.root, self._tasks = root, {name: frozenset(axes) for name, axes in tasks.items()}
        found = [path.relative_to(root) for pattern in PAGES for path in sorted(root.glob(pattern))]
        self._listed = bool(tasks) and all(page.stem in tasks for page in found if page.parent == TASKS)
        """Whether the list of tasks of the site takes the place of docs/tasks.md."""
        self.pages = [page for page in found if self._task_of(page) is None]
        """Sources of the pages, relative to the folder."""
        self.files = [path.relative_to(root) for pattern in FILES for path in sorted(root.glob(pattern))]
        """Files that go into the site as they are."""
        self._parser = MarkdownIt("gfm-like", {"linkify": False, "html": False})

    def groups(self) -> list[Group]:
        """The navigation: the links of docs/index.md below its headings. Without it, all pages in one group."""
        if INDEX not in self.pages:
            return [Group("Documentation", [(title_of((self.root / page).read_text()), page) for page in self.pages])]
        groups: list[Group] = []
        seen = set[Path]()
        for line in (self.root / INDEX).read_text().splitlines():
            if line.startswith("## "):
                groups.append(Group(line.removeprefix("## ").strip(), []))
            link = re.match(r"\| \[([^\]]+)\]\(([^)#]+)(#[^)]*)?\) \|", line)
            target = Path(os.path.normpath(INDEX.parent / link[2])) if link else None
            if link and groups and target in self.pages and target not in seen:
                groups[-1].pages.append((link[1], target))
                seen.add(target)
        return [group for group in groups if group.pages]

    def page(self, page: Path) -> Page:
        """A page as HTML."""
        text = (self.root / page).read_text()
        tokens = self._parser.parse(text)
        up = PurePosixPath(*[".."] * (len(page.parts) - 1))
        headings = [*_anchored(tokens)]
        for token in tokens:
            for link in token.children or []:
                self._relink(page, up, link)
        self._link_tables(tokens, up)
        body = Markup(self._parser.renderer.render(tokens, self._parser.options, {}))
        listed = [heading for heading in headings if heading.level in CONTENTS_LEVELS]
        if len(listed) > LONGEST_CONTENTS:
            listed = [heading for heading in listed if heading.level == CONTENTS_LEVELS[0]]
        return Page(title_of(text), body, listed if len(listed) >= CONTENTS else [])

    def _task_of(self, page: Path) -> str | None:
        """The task whose page in the site takes the place of a page; an empty text for the list of tasks."""
        if page == TASKS.with_suffix(".md") and self._listed:
            return ""
        return page.stem if page.parent == TASKS and page.stem in self._tasks else None

    def _relink(self, page: Path, up: PurePosixPath, link: Token) -> None:
        """Let a link to a page lead to its HTML."""
        path, _, part = str(link.attrs.get("href", "")).partition("#")
        if link.type != "link_open" or not path or "://" in path:
            return
        target = Path(os.path.normpath(page.parent / unquote(path)))
        task = self._task_of(target)
        if task is not None:
            link.attrs["href"] = str(up / (f"tasks/{task}/index.html" if task else "index.html"))
        elif target in self.pages:
            link.attrs["href"] = str(up / html_of(target).as_posix()) + (f"#{part}" if part else "")

    def _link_tables(self, tokens: list[Token], up: PurePosixPath) -> None:
        """Let the names of tasks and axes that begin a line of a table lead to the page of the task."""
        for number, token in enumerate(tokens):
            if token.type != "tr_open":
                continue
            cells = [each for each in tokens[number + 1 : number + 6] if each.type == "inline"]
            task = cells[0].content.partition("](")[0].strip("[`") if cells else ""
            if task not in self._tasks:
                continue
            page = str(up / f"tasks/{task}/index.html")
            if len(cells[0].children or []) == 1:
                _wrap(cells[0], page)
            if len(cells) > 1 and cells[1].content in self._tasks[task]:
                _wrap(cells[1], f"{page}#axis-{cells[1].content}")


def title_of(text: str) -> str:
    """First heading of a page."""
    return next((line.removeprefix("# ").strip() for line in text.splitlines() if line.startswith("# ")), "untitled")


def story(text: str) -> Markup:
    """A docstring as HTML. Its indented sketches keep their form."""
    return Markup(MarkdownIt("commonmark", {"html": False}).render(text))


def _anchored(tokens: list[Token]) -> Iterator[Heading]:
    """Give every heading the id that GitHub gives it."""
    seen: dict[str, int] = {}
    for token, inline in pairwise(tokens):
        if token.type != "heading_open":
            continue
        text = "".join(child.content for child in inline.children or [])
        slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        seen[slug] = seen.get(slug, -1) + 1
        slug = f"{slug}-{seen[slug]}" if seen[slug] else slug
        token.attrs["id"] = slug
        yield Heading(token.tag, text, slug)


def _wrap(cell: Token, address: str) -> None:
    """Make a link of a cell."""
    link = Token("link_open", "a", 1, {"href": address})
    cell.children = [link, *(cell.children or []), Token("link_close", "a", -1)]
