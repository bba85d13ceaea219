"""The worst habits of prose and naming stay out: fragments as docstrings, headless sentences, constants without a name.

These checks are crude on purpose. How scengen is written stands in CONTRIBUTING.md.
"""

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "scengen").rglob("*.py"))
TEXTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "conf").rglob("*.yaml")),
]
PREPOSITIONS = (
    "about above across after against along among around at before behind below beneath beside between beyond by from "
    "in into of off on onto out over past through to toward towards under until up upon with within without when where"
).split()
"""First words of an attribute docstring that cannot be understood without the line above it."""
HEADLESS = re.compile(r"(?:^|[.:;]\s+)(Whoever|Nobody|Who|Whatever|What is left)\b(?![^.\n]*\?)", re.M)
"""Beginnings of sentences without a subject that acts. Questions are allowed."""
ALLOWED: frozenset[tuple[str, str]] = frozenset()
"""Exceptions: file name and the constant or first words."""


def attribute_docstrings(tree):
    """Names and docstrings of module constants, class attributes and fields."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if not isinstance(body, list):
            continue
        for before, here in pairwise(body):
            text = isinstance(here, ast.Expr) and isinstance(here.value, ast.Constant) and here.value.value
            if isinstance(before, ast.Assign | ast.AnnAssign) and isinstance(text, str):
                yield ast.unparse(before.targets[0] if isinstance(before, ast.Assign) else before.target), text


def constants(tree):
    """Names in capitals that are assigned at the top of a module, statement by statement; type variables are none."""
    for node in tree.body:
        if isinstance(getattr(node, "value", None), ast.Call) and "TypeVar" in ast.unparse(node.value.func):
            continue
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        for target in targets:
            names = [n.id for n in ast.walk(target) if isinstance(n, ast.Name)]
            if any(name.lstrip("_").isupper() for name in names):
                yield names


def docstrings(tree):
    """All docstrings of a module, those of attributes included."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value


def fragments(tree):
    return [
        f"{name}: {text[:60]}"
        for name, text in attribute_docstrings(tree)
        if text.split()[0].lower().rstrip(",.:") in PREPOSITIONS
    ]


def nameless(tree):
    return [", ".join(names) for names in constants(tree) if len(names) > 1 or len(names[0].strip("_")) == 1]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_docstrings_stand_alone_and_constants_have_names(path):
    tree = ast.parse(path.read_text())
    found = [*fragments(tree), *nameless(tree)]
    found += [text[:80] for text in docstrings(tree) if HEADLESS.search(text)]
    assert not [each for each in found if (path.name, each.split(":")[0]) not in ALLOWED]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_and_task_files_have_sentences_with_subjects(path):
    assert not [found[0].strip() for found in HEADLESS.finditer(path.read_text())]


def test_the_checks_see_what_they_are_for():
    """The negative controls."""
    tree = ast.parse('"""Whoever reads this."""\nA = 1\nLOW, HIGH = 0, 1\nSPEED = 2\n"""When it starts to."""\n')
    assert fragments(tree) == ["SPEED: When it starts to."] and nameless(tree) == ["A", "LOW, HIGH"]
    assert [bool(HEADLESS.search(text)) for text in docstrings(tree)] == [True, False]
