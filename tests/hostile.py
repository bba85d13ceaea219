"""Texts of strangers that would run a script in a careless page."""

import ast
from pathlib import Path

PAYLOADS = [
    "<script>window.hacked=1</script>",
    "<img src=x onerror='window.hacked=1'>",
    "<svg/onload=window.hacked=1>",
    "<iframe srcdoc='<script>parent.hacked=1</script>'></iframe>",
    "</div></p><style>*{display:none}</style>",
    "{{ 7*7 }}{% raw %}${window.hacked=1}",
    "[x](javascript:window.hacked=1) ![x](x onerror=hacked=1)",
    '"><a href="javascript:window.hacked=1" autofocus onfocus="window.hacked=1">x</a>',
]
"""Texts that would run a script in a careless page."""


def corpus_texts():
    """All texts with markup in the sources of the checker's corpus."""
    found = set()
    for path in (Path(__file__).parent / "checker").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and 0 < len(node.value) < 500:
                if set("<>&\x1b\u202e{}") & set(node.value):
                    found.add(node.value)
    return sorted(found)
