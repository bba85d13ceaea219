"""Builds the documentation into build/docs/html. `make docs`

    python tools/build_docs.py [html | linkcheck | results]

Hand-written pages come from docs/ and from the READMEs. Generated ones, and the tables of hand-written ones at the
marks `<!-- generated: NAME -->`, come from the code, the task files and the ledger. Both are written into
build/docs/source, from which Sphinx (docs/conf.py) makes HTML. If `scengen site` has written build/docs/extra/films,
the pages of tasks show its films. `results` writes docs/results.md, the only generated page that is committed.

Pages keep their addresses relative to the repository until they are stored: a link holds on GitHub and in the build.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path, PurePosixPath

import baselines_page
import perturb_page
import predictors
import tables

from scengen import list_tasks, load_task
from scengen.site import task_page

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build" / "docs"
SOURCE = BUILD / "source"
"""Folder of the pages from which Sphinx makes HTML."""
EXTRA = BUILD / "extra"
"""Folder of what is copied beside the HTML: `films`, if there are any."""
WRITTEN = (
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "docs/*.md", "docs/api/*.md"),
    *("examples/README.md", "task_template/README.md", "integrations/*/README.md"),
)
"""Hand-written pages of the repository."""
FILLS: Mapping[str, Callable[[], Mapping[str, str]]] = {
    "attacks": tables.attacks,
    "axes": tables.axes,
    "baselines": baselines_page.fills,
    "cluster": tables.cluster,
    "drift": tables.drift,
    "kept_cheats": tables.kept_cheats,
    "paper": tables.paper,
    "perturb": perturb_page.fills,
    "predictors": predictors.fills,
    "view": tables.warp,
}
"""Functions that return the tables of a page of docs/ by the names of their marks."""
CONTENTS = ("docs/index.md", "docs/tasks.md", "docs/api.md")
"""Pages whose tables of links are the navigation."""
MARK = re.compile(r"<!-- generated: ([a-z_]+) -->")
REPOSITORY = re.compile(r"<!-- repository -->\n.*?<!-- end -->\n", re.S)
"""Text of a page that only readers of the repository see."""
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"(^```.*?^```$)", re.S | re.M)
PICTURE = re.compile(r"^docs/tasks/(\w+)\.jpg$")
"""Picture of a task. A link to it leads to the page of the task."""


def main(builder: str = "html") -> None:
    """Write the sources, and run Sphinx. Warnings are errors."""
    if builder == "results":
        tables.RESULTS.write_text(tables.results())
        return
    write_sources(SOURCE, EXTRA / "films")
    EXTRA.mkdir(parents=True, exist_ok=True)
    options = ["--builder", builder, "--fail-on-warning", "--keep-going", "--quiet", "--conf-dir", str(ROOT / "docs")]
    target = BUILD / builder
    ended = subprocess.run([sys.executable, "-m", "sphinx", *options, str(SOURCE), str(target)], cwd=ROOT)
    if ended.returncode:
        sys.exit(ended.returncode)
    print(f"wrote {target.relative_to(ROOT)}")


def write_sources(to: Path, films: Path | None = None) -> None:
    """Write all pages and the files that they show. Unchanged files keep their times, so that Sphinx skips them."""
    known = {path for path in to.rglob("*") if path.is_file()}
    for path, content in sources(films):
        known.discard(to / path)
        _update(to / path, content)
    for path in known:
        path.unlink()


def sources(films: Path | None = None) -> Iterator[tuple[str, bytes]]:
    """Every file of the source folder, and its content."""
    files = set[str]()
    for path, text in pages(films):
        for link in _links(text):
            target = _target(path, link.partition("#")[0])
            if _is_file(target):
                files.add(target)
        if path in CONTENTS:
            text += "".join(navigation(path, text))
        yield stored(path), relocated(path, text).encode()
    yield from ((stored(path), (ROOT / path).read_bytes()) for path in sorted(files))
    yield from ((name, plot) for name, plot in baselines_page.plots().items())


def pages(films: Path | None = None) -> Iterator[tuple[str, str]]:
    """Every page with its place in the repository, and its text."""
    for pattern in WRITTEN:
        for path in sorted(ROOT.glob(pattern)):
            yield path.relative_to(ROOT).as_posix(), written(path)
    for name in list_tasks():
        text = task_page.page(load_task(name), tables.of_axes(name), films if films and films.is_dir() else None)
        yield f"docs/tasks/{name}.md", text


def written(path: Path) -> str:
    """The text of a hand-written page with its generated tables."""
    text = REPOSITORY.sub("", path.read_text())
    if not MARK.search(text):
        return text
    fills = FILLS[path.stem]()
    return MARK.sub(lambda mark: fills[mark[1]].strip("\n"), text)


def stored(path: str) -> str:
    """Place of a file of the repository in the source folder: docs/ is its top, a README is called as its folder."""
    place = PurePosixPath(path)
    if place.parts[0] == "docs":
        return "/".join(place.parts[1:])
    if place.name == "README.md" and len(place.parts) > 1:
        return f"{place.parent}.md"
    if place.suffix == ".md":
        return f"{place.with_name(place.name.lower())}"
    return f"files/{place}"


def relocated(page: str, text: str) -> str:
    """A page whose links between files of the repository are links between stored files."""
    here = PurePosixPath(stored(page)).parent

    def link(found: re.Match[str]) -> str:
        path, mark, part = found[1].partition("#")
        target = _target(page, path)
        if not path or "://" in path or not (_is_file(target) or _is_page(target)):
            return found[0]
        is_picture = text[: found.start()].rpartition("[")[0].endswith("!")
        if not is_picture:
            target = _page_of(target)
        return f"]({os.path.relpath(stored(target), here)}{mark}{part})"

    parts = FENCE.split(text)
    return "".join(part if part.startswith("```") else LINK.sub(link, part) for part in parts)


def navigation(page: str, text: str) -> Iterator[str]:
    """Hidden tables of contents: for each heading of a page, the pages to which its tables lead."""
    here = PurePosixPath(stored(page)).parent
    seen = {page}
    for section in re.split(r"^## ", text, flags=re.M):
        title = section.partition("\n")[0] if section != text and not section.startswith("#") else ""
        entries = list[str]()
        for name, path in re.findall(r"^\| \[([^\]]+)\]\(([^)#]+)(?:#[^)]*)?\) \|", section, re.M):
            target = _page_of(_target(page, path))
            if target not in seen and _is_page(target):
                seen.add(target)
                entries.append(f"{name.strip('`')} <{os.path.relpath(stored(target), here).removesuffix('.md')}>")
        if entries:
            caption = f":caption: {title}\n" if title and page == CONTENTS[0] else ""
            yield f"\n```{{toctree}}\n:hidden:\n{caption}\n" + "".join(f"{entry}\n" for entry in entries) + "```\n"


def _links(text: str) -> Iterator[str]:
    """Links of a page to other files, without those in blocks of code."""
    for part in FENCE.split(text):
        if not part.startswith("```"):
            yield from (link for link in LINK.findall(part) if "://" not in link and not link.startswith("#"))


def _target(page: str, link: str) -> str:
    """File of the repository to which a link of a page leads."""
    return os.path.normpath(os.path.join(os.path.dirname(page), link))


def _page_of(path: str) -> str:
    """The page of a task for its picture; any other path as it is."""
    return PICTURE.sub(r"docs/tasks/\1.md", path)


def _is_file(path: str) -> bool:
    """Whether a path is a file of the repository that is no page."""
    return not path.startswith("..") and not path.endswith(".md") and (ROOT / path).is_file()


def _is_page(path: str) -> bool:
    """Whether a path is a page."""
    if task := re.fullmatch(r"docs/tasks/(\w+)\.md", path):
        return task[1] in list_tasks()
    return (ROOT / path).is_file() and any(PurePosixPath(path).match(pattern) for pattern in WRITTEN)


def _update(path: Path, content: bytes) -> None:
    """Write a file unless it has this content."""
    if not path.is_file() or path.read_bytes() != content:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


if __name__ == "__main__":
    main(*sys.argv[1:])
