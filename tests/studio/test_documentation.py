"""The built documentation in a real browser: pages fit a phone and a desk, pictures are there, nothing fails."""

import build_docs
import pytest

pytestmark = pytest.mark.slow  # Sphinx takes two minutes

PAGES = ("index", "results", "axes", "baselines", "tasks/domino_single", "tasks/packing", "api/moves", "contributing")


@pytest.fixture(scope="module")
def built():
    pytest.importorskip("sphinx", reason="no sphinx; it is in the extras docs and dev")
    build_docs.main()
    return build_docs.BUILD / "html"


@pytest.mark.parametrize("width", [390, 1280])
def test_pages_fit_and_show_their_pictures(opened, built, width):
    tab = opened("about:blank", size=(width, 800))
    for name in PAGES:
        tab.page.goto((built / f"{name}.html").as_uri())
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= width, name
        broken = "[...document.images].filter(one => one.complete && !one.naturalWidth).map(one => one.src)"
        assert tab.page.evaluate(broken) == [], name
    assert not tab.faults
