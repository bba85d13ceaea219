"""Settings of commands: composed by Hydra, checked, and filled into dataclasses."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from ...compose import certify_levels, certify_node, composed, task_of
from ...errors import BadConfig, cut
from ...samplers.task import Task
from ...samplers.task_files import groups
from ...validate.settings import CertifySettings
from ...work.cluster import AUTO, Cluster
from ...work.limits import MAX_SETTINGS
from ...work.machine import cores
from ...work.parallel import Workers
from ...work.typed import typed

T = TypeVar("T")

TASK_SETTINGS = re.compile(r"(\+\+|\+|~)?task\.")
"""Beginning of overrides that change the task."""


def read(verb: str, overrides: Sequence[str], kind: type[T]) -> T:
    """Read the settings of a command: conf/command/<verb>.yaml with the overrides of a command line, checked.

    Args:
        kind: dataclass with the names and types of the settings.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    return typed("", kind, _settings(verb, composed(verb, overrides)[0]))


def read_task(verb: str, overrides: Sequence[str], kind: type[T]) -> tuple[T, Task, CertifySettings]:
    """Read the settings of a command with a task, the task, and the settings of its certificates.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    settings, task, plain, choices = _read_with_task(verb, overrides, kind)
    certify_settings = typed(
        "certify", CertifySettings, certify_node(plain["certify"], task, choices["certify"], verb, overrides)
    )
    certify_settings.check()
    if certify_settings.name not in (known := certify_levels(task)):
        raise BadConfig(
            f"certify.name = {cut(certify_settings.name)}; verify knows {', '.join(known)} and prints what differs "
            "from them; let the file of a level start with `defaults: [quick]`, and leave its name out"
        )
    if certify_settings.falls_short(level := known[certify_settings.name]):
        raise BadConfig(
            f"certify.robust.bound = {certify_settings.robust.bound:g}; certificates of level {level.name} have "
            f"{level.robust.bound:g} or more, and verify refutes others; take certify=quick, whose bound may be lower"
        )
    return settings, task, certify_settings


def read_uncertified(verb: str, overrides: Sequence[str], kind: type[T]) -> tuple[T, Task]:
    """Read the settings of a command with a task that certifies nothing, and the task.

    Raises:
        ScengenError: one line that says what is wrong.
    """
    settings, task, *_ = _read_with_task(verb, overrides, kind)
    return settings, task


def _read_with_task(
    verb: str, overrides: Sequence[str], kind: type[T]
) -> tuple[T, Task, Mapping[str, Any], Mapping[str, str]]:
    """Settings, task, all that was composed, and the names of the files that were chosen."""
    plain, choices = composed(verb, overrides)
    return typed("", kind, _settings(verb, plain)), task_of(choices["task"], plain["task"], overrides), plain, choices


def task_overrides(overrides: Sequence[str]) -> list[str]:
    """Those overrides of a command line that change the task."""
    return [text for text in overrides if TASK_SETTINGS.match(text)]


def _settings(verb: str, plain: Mapping[str, Any]) -> dict[str, Any]:
    """The settings without those that are chosen from files, such as task and certify."""
    settings = {key: value for key, value in plain.items() if key not in groups(verb)}
    for key, value in settings.items():
        if value == "???":
            raise BadConfig(f"{verb} needs {key}=...; see scengen {verb} --help")
    if "workers" in settings:
        settings["workers"] = _workers(settings["workers"], plain.get("executor"))
    return settings


def _workers(count: Any, executor: Mapping[str, Any] | None) -> Workers:
    """The workers of a command. `workers=auto` means all cores, of this machine or of the cluster of executor=ray.

    Raises:
        ScengenError: the count is not a number, or there is no such cluster.
    """
    if count != AUTO and (isinstance(count, bool) or not isinstance(count, int)):
        raise BadConfig(f"workers = {cut(repr(count))}; it must be a whole number, or {AUTO}")
    if not executor and count != AUTO and not 1 <= count <= (most := MAX_SETTINGS["workers"]):
        raise BadConfig(f"workers = {cut(str(count))}; it must be at {f'most {most}' if count > 0 else 'least 1'}")
    if not executor:
        return cores() if count == AUTO else count
    cluster = typed("executor", Cluster, {**executor, "count": None if count == AUTO else count})
    cluster.connect()
    return cluster
