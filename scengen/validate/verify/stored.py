"""Task and settings of a manifest as objects. Only installed code is used."""

from dataclasses import asdict

from ...errors import PoolError, ScengenError
from ...pool import Pool
from ...pool.demonstrations import Demonstrations
from ...pool.manifest import Manifest
from ...samplers.task import Task, load
from ...work.typed import typed
from ..settings import CertifySettings, leaves

MAX_SETTING = 3600
"""Largest number that is read as a setting of certificates: of the seconds, an hour."""


def task_of_manifest(pool: Pool | Demonstrations, installed: Task) -> Task:
    """The task as it was when the pool, or the demonstrations, were made.

    Args:
        installed: the task of that name on this machine. Nothing is imported because a manifest names it: the family
            must be spelled as in the installed file.

    Raises:
        PoolError: the family is another one, or the task does not fit it.
    """
    node, family = pool.manifest.task_node, installed.node["family"]
    if node.get("family") != family:
        told = str(node.get("family"))[:80]
        raise PoolError(f"{pool.folder} names the family {told!r} for task {pool.task}; the installed one is {family}")
    try:
        return load(pool.task, node)
    except ScengenError as error:
        raise PoolError(f"{pool.folder}: its task cannot be drawn from: {error}") from None
    except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError, RecursionError) as error:
        why = " ".join(str(error).split())[:120]
        raise PoolError(f"{pool.folder}: its task is not a task file ({why})") from None


def settings_of_manifest(manifest: Manifest) -> CertifySettings:
    """The settings of a manifest's certificates.

    Raises:
        ScengenError: a setting is missing, unknown, of another type, or out of bounds.
    """
    settings = typed("config.certify", CertifySettings, manifest.config.certify, exact=True)
    for name, value in leaves(asdict(settings)):
        if not 0 <= value <= MAX_SETTING:
            raise PoolError(f"config.certify.{name} = {value}; it must lie in [0, {MAX_SETTING}]")
    return settings
