"""The commands of scengen in the order of its help, and the names that they had before."""

from collections.abc import Mapping

GROUPS: Mapping[str, tuple[str, ...]] = {
    "Generate and check": ("tasks", "try", "generate", "verify", "crosscheck", "drift", "attack"),
    "Demonstrate and train": ("demos", "teleop", "curate", "stats", "train", "recipe"),
    "View and export": ("studio", "show", "film", "view", "report", "export", "record", "publish", "site"),
    "Evaluate and analyse": ("evaluate", "edition", "agent", "power", "audit", "compare", "subset", "shrink", "bench"),
    "Extend": ("new", "asset", "probe", "discover"),
}
"""Commands by purpose. Each is a module of `scengen.cli.commands` and a file in conf/command."""
VERBS = tuple(verb for verbs in GROUPS.values() for verb in verbs)
"""Names of all commands."""
RENAMED: Mapping[str, str] = {"axis": "probe", "bias": "audit", "card": "publish", "robosuite": "crosscheck"}
"""New names of commands by the old ones, which version 0.3 removes. Help and completion do not list the old ones."""
CONTINUING = (
    "generate",
    "demos",
    "teleop",
    "train",
    "evaluate",
    "edition",
    "agent",
    "attack",
    "probe",
    "discover",
    "site",
)
"""Commands that keep finished work when they are interrupted, and continue from there."""
