"""Completion of command lines in bash: `eval "$(scengen --completion bash)"`."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from itertools import islice

from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.plugins.completion_plugin import DefaultCompletionPlugin

from .. import compose, task_files
from ..errors import ScengenError
from ..pool import Pool

BASH = r"""
_scengen() {
    local line=${COMP_LINE:0:COMP_POINT} IFS=$'\n'
    local word=${line##* }
    local kept=${word%"${word##*[$COMP_WORDBREAKS]}"}  # bash replaces what comes after this alone
    COMPREPLY=($(scengen --complete "$line" 2>/dev/null))
    COMPREPLY=("${COMPREPLY[@]#"$kept"}")
    [[ ${#COMPREPLY[@]} == 1 && ${COMPREPLY[0]} == *[=./@+] ]] && compopt -o nospace
}
complete -o default -F _scengen scengen
""".lstrip()
"""What bash evaluates. Where nothing is found it completes names of files."""
OFFERED = 1000
"""Scenarios of a pool that are offered: the first ones by their names, or those whose ids begin so."""


def completions(line: str, verbs: Sequence[str]) -> list[str]:
    """What the last word of a command line may become: commands, settings, tasks, splits, ids of a pool.

    Args:
        line: from its beginning to the cursor.
        verbs: names of all commands.
    """
    *before, word = line.split(" ")
    words = [text for text in before[1:] if text]
    if not words:
        return [verb for verb in verbs if verb.startswith(word)]
    verb, *others = words
    if verb not in verbs:
        return []
    key, equals, _ = word.partition("=")
    with suppress(ScengenError):  # a line that is not right yet
        if equals and key == "split":
            return _last(word, "+,", task_files.splits(_task(others), task_files.search_path(others)))
        if equals and key == "axis":
            return _last(word, "", task_files.splits(_task(others), task_files.search_path(others))[1:])
        if equals and key == "task":
            return _last(word, ",", task_files.tasks(task_files.search_path(others))) if verb != "new" else []
        if equals and key == "id":
            pools = [Pool.open(folder) for folder in _pools(others)]
            names = [str(name) for pool in pools for name in islice(pool.names(), OFFERED)]
            return _last(word, "", names) or _last(word, "", (id_ for pool in pools for id_ in _ids(pool, word)))
        return _settings(verb, others, word)
    return []


def _task(words: Sequence[str]) -> str:
    """The task that has been chosen, for a command that wants one."""
    return next((word.removeprefix("task=") for word in words if word.startswith("task=")), "")


def _pools(words: Sequence[str]) -> list[str]:
    return [folder for word in words if word.startswith("pool=") for folder in word.removeprefix("pool=").split(",")]


def _ids(pool: Pool, word: str) -> list[str]:
    """Ids that begin as the word asks for."""
    places = pool.directory.beginning(word.removeprefix("id="))
    return [pool.directory.id(place) for place in places[:OFFERED]]


def _last(word: str, separators: str, known: Iterable[str]) -> list[str]:
    """Words that end in one of the known ones, after the last of the separators or the first `=`."""
    start = max(word.rfind(one) for one in "=" + separators) + 1
    return [word[:start] + one for one in known if one.startswith(word[start:])]


def _settings(verb: str, words: Sequence[str], word: str) -> list[str]:
    """Hydra's own: keys of the composed configuration, and files of groups."""
    groups = task_files.groups(verb)
    if "task" in groups and not _task(words):
        words = [*words, f"task={task_files.tasks()[0]}"]  # its keys are those of all tasks, but for the parameters
    with initialize_config_dir(str(compose.config_dir(verb)), version_base="1.3", job_name="scengen"):
        plugin = DefaultCompletionPlugin(GlobalHydra.instance().config_loader())
        found = plugin._query(compose.config_name(verb), " ".join([*words, word]))
    return [text for text in found if _offered(text, groups)]


def _offered(text: str, groups: Sequence[str]) -> bool:
    """Whether a key is a setting of the command: Hydra also knows its own, and every folder of conf/."""
    first = text.lstrip("+~").split("=")[0].split(".")[0].split("/")[0]
    return first not in ("hydra", "command", "limits", "certify", "task") or first in groups
