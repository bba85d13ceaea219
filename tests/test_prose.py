"""Checks of prose and names: no fragments as docstrings, no sentences without a subject, no words of a private dialect.

The checks are simple on purpose. CONTRIBUTING.md states the style.
"""

import ast
import io
import re
import tokenize
from itertools import pairwise
from pathlib import Path

import pytest
from commit_subject import faults

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "scengen").rglob("*.py"))
TEXTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *(path for path in sorted((ROOT / "conf").rglob("*.yaml")) if path.parent.name != "language"),
]
PAGES = [
    *(path for path in TEXTS if not {"task", "facts", "language", "limits", "editions"} & {path.parent.name}),
    *(path for path in sorted((ROOT / "examples").iterdir()) if path.suffix in (".py", ".md")),
    *sorted((ROOT / "integrations").glob("*/README.md")),
]
"""Texts for users whose words are checked. Task files, facts and wordings of instructions are stored data."""
PREPOSITIONS = (
    "about above across after against along among around at before behind below beneath beside between beyond by from "
    "in into of off on onto out over past through to toward towards under until up upon with within without when where"
).split()
"""First words of an attribute docstring that cannot be understood without the line above it."""
HEADLESS = re.compile(r"(?:^|[.:;]\s+)(Whoever|Nobody|Who|Whatever|What is left)\b(?![^.\n]*\?)", re.M)
"""Beginnings of sentences without a subject that acts. Questions are allowed."""
VOCABULARY = {
    r"tell|tells|telling|told": "report, show, reveal, store or distinguish",
    r"anew": "again",
    r"mend|mends|mended|mending": "fix",
    r"begun|began|begins": "started, starts",
    r"whoever|nobody|somebody|whatever|wherever": "name the subject or the condition",
    r"points of percent": "percentage points",
    r"(?<!there )(?:is|are|was|were) no (?!longer|more|such|other|one|use)\w+": "is not a",
    r"(?:is|are|was|were|be|as|if) asked for|asks for": "requested, requires",
    r"control arms?|both arms (?:play|of the)(?! first)": "conditions of a comparison, not arms",
    r"something else than|another \w+(?: of \w+)? than": "something other than, a different X than",
    r"say \w+=": "pass x=",
    r"of (?:its|their) own[.,;:]": "its own X, a separate X",
    r"in words[.,;:]": "as text",
    r"by turns|by heart|all the same[.:,]|hardly|for good": "in turn, memorised, still, almost not",
    r"strangers?": "untrusted, of unknown origin",
    r"lest|albeit|hence|thereof|thereby|upon": "a common word",
}
"""Words of a private dialect, and what to write instead in pages, docstrings, comments, error and help texts."""
SPATIAL = ("tasks", "skills", "assets", "attack", "robots", "control", "cues")
"""Packages about physical scenes, in which `beside` describes a place. Elsewhere: next to, with, in addition to."""
KEPT_WORDS = (
    "while nobody acts",  # reasons that certificates store
    "part of what is asked for",
    "hardly fits into the tray",
    "told {}",  # an answer of the rules that behaviour files store
    "rest on; beside scengen",  # the head of every scengen.lock
    "not asked for",
    "`Episode.told`",
    "told: called",
    "beside the place of the drop",  # a distance
)
"""Exceptions: texts with such a word that stored data or names of the code require."""
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


def texts(source):
    """Docstrings, comments, and literals with a space, in which braces stand for values."""
    tree = ast.parse(source)
    parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts:
            yield node.value if " " in node.value else ""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


def dialect(text):
    """Words of the vocabulary in a text, each with its replacement."""
    text = " ".join(text.split())
    for kept in KEPT_WORDS:
        text = text.replace(kept, "")
    for pattern, instead in VOCABULARY.items():
        for found in re.finditer(rf"\b(?:{pattern})(?!\w)", text, re.I):
            yield f"...{text[max(0, found.start() - 30) : found.end() + 20]}...: write {instead}"


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


@pytest.mark.parametrize("path", [*MODULES, *PAGES], ids=lambda path: str(path.relative_to(ROOT)))
def test_words_of_a_private_dialect_stay_out(path):
    source = path.read_text()
    found = [word for text in (texts(source) if path.suffix == ".py" else [source]) for word in dialect(text)]
    if path.suffix == ".py" and path.parts[-2] not in SPATIAL:
        found += [
            text[:80]
            for text in texts(source)
            if re.search(r"\bbeside\b", text) and not any(kept in text for kept in KEPT_WORDS)
        ]
    assert not found


def test_the_checks_see_what_they_are_for():
    """The negative controls."""
    assert len(list(dialect("Whoever told it began anew; it is no error, and there is no other."))) == 5
    assert not list(dialect("The file states it. A retelling of a begonia."))
    tree = ast.parse('"""Whoever reads this."""\nA = 1\nLOW, HIGH = 0, 1\nSPEED = 2\n"""When it starts to."""\n')
    assert fragments(tree) == ["SPEED: When it starts to."] and nameless(tree) == ["A", "LOW, HIGH"]
    assert [bool(HEADLESS.search(text)) for text in docstrings(tree)] == [True, False]


@pytest.mark.parametrize(
    ("subject", "says"),
    [
        ("Add a hook that checks subjects", ""),
        ("Process pools in one pass\n\nA body of any length.", ""),
        ("Speed up the control loop", ""),
        ("Merge branch 'names' of another repository into the branch that is to be released next", ""),
        ("Added a hook", "imperative"),
        ("Fixes a hook", "imperative"),
        ("The hook works", "imperative"),
        ("add a hook", "capital"),
        ("Add a hook.", "full stop"),
        ("Add a hook " * 7, "77 characters"),
    ],
)
def test_subjects_of_commits_are_short_and_imperative(subject, says):
    found = "; ".join(faults(subject))
    assert says in found and bool(says) == bool(found)
