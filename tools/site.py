"""Writes the documentation as plain HTML, with or without a web server: `make site`

`python tools/site.py [folder]`: README.md becomes index.html, every other page keeps its place. Axis cards (`make
axes`) and reports (`scengen report`) in generated/ are copied and listed.
"""

import os
import shutil
import sys
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import jinja2
from markdown_it import MarkdownIt

PAGES = (
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/*.md",
    "docs/*/*.md",
    "example/README.md",
    "integrations/*/README.md",
)
FILES = ("docs/*.png", "docs/*.webp", "docs/*/*.jpg", "docs/*/*.png", "LICENSE", "CITATION.cff", "Dockerfile")
MADE = {"Axis cards": "generated/axes/*/card.html", "Reports": "generated/*.html"}
"""Pages written by commands, by heading."""
TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{{ title }}</title>
<style>
  body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto 4rem; max-width: 1000px; padding: 0 1rem; color: #222; }
  nav { border-bottom: 1px solid #ddd; padding: .8rem 0; margin-bottom: 1.5rem; } nav a { margin-right: 1rem; }
  a { color: #2a6496; } img { max-width: 100%; } h1, h2, h3 { line-height: 1.2; }
  table { border-collapse: collapse; display: block; overflow-x: auto; font-size: 14px; }
  td, th { padding: .25rem .8rem .25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid #eee; }
  pre { background: #f6f6f4; padding: .8rem 1rem; overflow-x: auto; border-radius: 6px; font-size: 14px; }
  code { font-size: .92em; }
  blockquote { border-left: 3px solid #ccc; margin-left: 0; padding-left: 1rem; color: #555; }
</style>
</head>
<body>
<nav>{% for name, path in menu.items() %}<a href="{{ up }}{{ path }}">{{ name }}</a>{% endfor %}</nav>
{{ body }}
</body>
</html>
"""


def main(folder: str = "generated/site") -> None:
    """Write the site."""
    to = Path(folder)
    pages = [page for pattern in PAGES for page in sorted(Path().glob(pattern))]
    made = {title: sorted(Path().glob(pattern)) for title, pattern in MADE.items()}
    for path in [*(file for pattern in FILES for file in Path().glob(pattern)), *chain(*made.values())]:
        copy = to / path
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
    menu = {
        "scengen": "index.html",
        "Documentation": "docs/index.html",
        "Tasks": "docs/tasks.html",
        "Contributing": "CONTRIBUTING.html",
        "Changes": "CHANGELOG.html",
    }
    if any(made.values()):
        menu["Cards and reports"] = "made.html"
        _write(to / "made.html", "Cards and reports", "\n".join(_listed(made)), menu, "")
    for page in pages:
        up = "../" * (len(page.parts) - 1)
        _write(to / _html(page), _title(page), _rendered(page, set(pages)), menu, up)
    print(f"wrote {to / 'index.html'}: {len(pages)} pages, {sum(map(len, made.values()))} cards and reports")


def _rendered(page: Path, pages: set[Path]) -> str:
    """A page as HTML, with links to the HTML of other pages."""
    markdown = MarkdownIt("gfm-like", {"linkify": False})
    tokens = markdown.parse(page.read_text())
    for link in chain(*(token.children or [] for token in tokens)):
        path, _, part = str(link.attrs.get("href", "")).partition("#")
        target = Path(os.path.normpath(page.parent / path)) if path and "://" not in path else None
        if target in pages:
            up = "../" * (len(page.parts) - 1)
            link.attrs["href"] = f"{up}{_html(target)}" + (f"#{part}" if part else "")
    return markdown.renderer.render(tokens, markdown.options, {})


def _html(page: Path) -> Path:
    return Path("index.html") if page == Path("README.md") else page.with_suffix(".html")


def _title(page: Path) -> str:
    """First heading of a page."""
    head = next(line for line in page.read_text().splitlines() if line.startswith("# "))
    return head.removeprefix("# ").strip()


def _listed(made: dict[str, list[Path]]) -> Iterator[str]:
    """Links to the pages written by commands."""
    for title, paths in made.items():
        if paths:
            links = "".join(f'<li><a href="{path}">{path.parent.name}/{path.stem}</a></li>' for path in paths)
            yield f"<h2>{title}</h2><ul>{links}</ul>"


def _write(path: Path, title: str, body: str, menu: dict[str, str], up: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(jinja2.Template(TEMPLATE).render(title=title, body=body, menu=menu, up=up))


if __name__ == "__main__":
    main(*sys.argv[1:])
