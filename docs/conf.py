"""Settings of Sphinx. `make docs` writes the sources into build/docs/source, and runs Sphinx on them."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "docs")]

import docstrings  # noqa: E402

project = "scengen"
author = copyright = "The scengen authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "index"
html_theme = "furo"
html_title = "scengen"
html_static_path = [str(ROOT / "docs" / "static")]
html_css_files = ["docs.css"]
html_extra_path = [str(ROOT / "build" / "docs" / "extra")]
html_copy_source = False
html_show_sphinx = False
highlight_language = "text"

myst_heading_anchors = 4
"""Headings get the addresses that GitHub gives them."""

autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
maximum_signature_line_length = 100
toc_object_entries_show_parents = "hide"
add_module_names = False
napoleon_numpy_docstring = False
napoleon_use_ivar = True
linkcheck_anchors = False
linkcheck_timeout = 20


def setup(app):
    """Let docstrings, which are Markdown, be read as reStructuredText."""
    app.connect("autodoc-process-docstring", docstrings.before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", docstrings.after_napoleon, priority=600)
