"""Completion of command lines in bash: `eval "$(scengen --completion bash)"`."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import islice

from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.plugins.completion_plugin import DefaultCompletionPlugin

from .. import compose
from ..errors import ScengenError
from ..pool import Pool
from ..samplers import task_files
from .verbs import COMMANDS, FORMS, parsed

BASH = r"""
_scengen() {
    local line=${COMP_LINE:0:COMP_POINT} IFS=$'\n'
    local word=${line##* }
    local kept=${word%"${word##*[$COMP_WORDBREAKS]}"}  # bash replaces only the text after this
    COMPREPLY=($(scengen --complete "$line" 2>/dev/null))
    COMPREPLY=("${COMPREPLY[@]#"$kept"}")
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[=./@+] ]] && compopt -o nospace
}
complete -o default -F _scengen scengen
""".lstrip()
"""Script for bash. Without completions of scengen it completes names of files."""
MAX_SCENARIOS = 1000
"""Largest number of scenarios of a pool to offer: the first ones by name, or those with a matching id."""


def completions(line: str, verbs: Sequence[str]) -> list[str]:
    """Completions of the last word of a command line: commands, settings, tasks, splits, ids of a pool.

    Args:
        line: command line up to the cursor.
        verbs: names of all commands.
    """
    *before, word = line.split(" ")
    words = [text for text in before[1:] if text]
    if not words:
        return [command for command in COMMANDS if command.startswith(word)]
    verb, others = parsed(words)
    forms = [form for form in FORMS.get(words[0], ()) if form.startswith(word)] if len(words) == 1 else []
    if verb not in verbs:
        return forms
    return [*forms, *_values(verb, others, word)]


def _values(verb: str, others: Sequence[str], word: str) -> list[str]:
    """Completions of a setting of a command."""
    key, equals, _ = word.partition("=")
    with suppress(ScengenError):  # the line is not complete yet
        if equals and key == "split":
            return _completed(word, "+,", task_files.splits(_task(others), task_files.search_path(others)))
        if equals and key == "axis":
            return _completed(word, "", task_files.splits(_task(others), task_files.search_path(others))[1:])
        if equals and key in ("task", "tasks"):
            return _completed(word, ",", task_files.tasks(task_files.search_path(others))) if verb != "new" else []
        if equals and key == "id":
            pools = [Pool.open(folder) for folder in _pools(others)]
            names = [str(name) for pool in pools for name in islice(pool.names(), MAX_SCENARIOS)]
            return _completed(word, "", names) or _completed(
                word, "", (id_ for pool in pools for id_ in _ids(pool, word))
            )
        return _settings(verb, others, word)
    return []


def _task(words: Sequence[str]) -> str:
    """Name of the task on the command line; empty if there is none."""
    return next((word.removeprefix("task=") for word in words if word.startswith("task=")), "")


def _pools(words: Sequence[str]) -> list[str]:
    """Folders of the pools on the command line."""
    return [folder for word in words if word.startswith("pool=") for folder in word.removeprefix("pool=").split(",")]


def _ids(pool: Pool, word: str) -> list[str]:
    """Ids of a pool with the prefix that the word gives."""
    places = pool.directory.beginning(word.removeprefix("id="))
    return [pool.directory.id(place) for place in places[:MAX_SCENARIOS]]


def _completed(word: str, separators: str, known: Iterable[str]) -> list[str]:
    """Completions of a word by known names, after its last separator or its first `=`."""
    start = max(word.rfind(one) for one in "=" + separators) + 1
    return [word[:start] + one for one in known if one.startswith(word[start:])]


def _settings(verb: str, words: Sequence[str], word: str) -> list[str]:
    """Completions by Hydra: keys of the composed configuration, and files of groups."""
    groups = task_files.groups(verb)
    if "task" in groups and not _task(words):
        words = [*words, f"task={task_files.tasks()[0]}"]  # all tasks have the same keys, except for parameters
    with initialize_config_dir(str(compose.config_dir(verb)), version_base="1.3", job_name="scengen"):
        plugin = DefaultCompletionPlugin(GlobalHydra.instance().config_loader())
        found = plugin._query(compose.config_name(verb), " ".join([*words, word]))
    return [text for text in found if _is_setting(text, groups)]


def _is_setting(text: str, groups: Sequence[str]) -> bool:
    """Whether a key is a setting of the command: Hydra also offers its own keys, and every folder of conf/."""
    first = text.lstrip("+~").split("=")[0].split(".")[0].split("/")[0]
    return first not in ("hydra", "command", "limits", "certify", "task") or first in groups
