"""The commands of scengen in the order of its help, their forms, and the names that they had before."""

from collections.abc import Mapping, Sequence

GROUPS: Mapping[str, tuple[str, ...]] = {
    "Generate and check": ("tasks", "try", "generate", "verify", "attack"),
    "Demonstrate and train": ("demos", "record", "curate", "train"),
    "Look and export": ("show", "studio", "site", "report", "export"),
    "Evaluate and analyse": ("evaluate", "edition", "agent", "axis", "measure", "subset", "bench"),
    "Extend": ("new", "asset"),
}
"""Commands by purpose."""
FORMS: Mapping[str, tuple[str, ...]] = {
    "verify": ("robosuite", "mujoco"),
    "demos": ("pad",),
    "curate": ("stats",),
    "show": ("film", "view", "perturb"),
    "report": ("audit", "compare"),
    "export": ("recipe", "hub"),
    "evaluate": ("power", "threshold"),
    "axis": ("card", "cues", "discover", "shrink"),
}
"""Second words that some commands take, each a form of the command with its own settings: `scengen show film`."""
ONLY_FORMS = ("axis",)
"""Commands that need a second word."""
COMMANDS = tuple(verb for verbs in GROUPS.values() for verb in verbs)
"""Names of all commands."""
VERBS = tuple(
    " ".join(words)
    for verb in COMMANDS
    for words in (*([] if verb in ONLY_FORMS else [(verb,)]), *((verb, form) for form in FORMS.get(verb, ())))
)
"""Names of all commands and forms. Each is a module of `scengen.cli.commands` and a file in conf/command, with `_` for
the space."""
RENAMED: Mapping[str, str] = {
    "crosscheck": "verify robosuite",
    "drift": "verify mujoco",
    "teleop": "demos pad",
    "stats": "curate stats",
    "recipe": "export recipe",
    "film": "show film",
    "view": "show view",
    "publish": "export hub",
    "power": "evaluate power",
    "audit": "report audit",
    "compare": "report compare",
    "shrink": "axis shrink",
    "probe": "axis card",
    "discover": "axis discover",
}
"""New names of commands by the old ones, which version 0.4 removes. Help and completion do not list the old ones."""
CONTINUING = (
    "generate",
    "demos",
    "demos pad",
    "train",
    "evaluate",
    "evaluate threshold",
    "edition",
    "agent",
    "attack",
    "axis card",
    "axis discover",
    "measure",
    "site",
)
"""Commands that keep finished work when they are interrupted, and continue from there."""


def parsed(words: Sequence[str]) -> tuple[str, list[str]]:
    """The command or form that a command line starts with, by its present name, and the rest of the line."""
    first, *rest = words
    if first in RENAMED:
        return RENAMED[first], rest
    if rest and f"{first} {rest[0]}" in VERBS:
        return f"{first} {rest[0]}", rest[1:]
    return first, rest


def file_stem(verb: str) -> str:
    """Name of the module and of the file of a command."""
    return verb.replace(" ", "_")
