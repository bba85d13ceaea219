"""docs/api.md says what the code says, and says it of everything that an author of tasks calls."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("api_page", ROOT / "tools" / "api_page.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_up_to_date(tool):
    assert tool.PAGE.read_text() == tool.page(), "docs/api.md is out of date; run python tools/api_page.py"


def test_every_public_function_is_on_the_page_with_its_signature(tool):
    """By the modules themselves, not by the parser that writes the page."""
    from scengen import physics, predicates
    from scengen.assets import prop
    from scengen.envs import gym
    from scengen.skills import cubes, fitting, grip, handover, hook, insertion, jaw, keys, motion, suction, waiting

    page = tool.PAGE.read_text()
    moves = (handover, grip, hook, jaw, motion, suction, waiting, cubes, fitting, insertion, keys)
    for module in (predicates, physics, prop, gym, *moves):
        own = [n for n, v in vars(module).items() if callable(v) and getattr(v, "__module__", "") == module.__name__]
        assert own and not [n for n in own if not n.startswith("_") and not re.search(rf"### (class )?`{n}[(`]", page)]
    assert "class `Guillotine" not in page, "`scengen asset` lists the assets"


def test_addresses_of_the_index_are_headings(tool):
    page = tool.PAGE.read_text()
    addresses = set(re.findall(r"\]\(#([\w-]+)\)", page))
    headings = {re.sub(r"[^\w-]", "", name) for name in re.findall(r"^## `(.*)`$", page, re.M)}
    assert addresses == headings and len(headings) == sum(map(len, tool.MODULES.values()))


def test_sections_of_a_docstring_become_lists(tool):
    text = "What.\n\nArgs:\n    one: first\n        and more.\n    two, three: others.\n\nRaises:\n    E: when."
    node = tool.ast.parse(f"def f():\n    {text!r}").body[0]
    assert tool._text(node) == (
        "What.\n\nArgs:\n\n- `one`: first and more.\n- `two, three`: others.\n\nRaises:\n\n- `E`: when."
    )
