"""What a manifest says about its task and settings, as objects; of the code, only what is installed here is used."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from ..errors import PoolError, ScengenError
from ..pool.pool import Pool
from ..samplers.task import Task, load
from .settings import CertifySettings


def task_of_manifest(pool: Pool, installed: Task) -> Task:
    """The task as it was when the pool was made.

    Args:
        installed: the task of that name on this machine. Nothing is imported because a manifest names it: the family
            must be spelled as in the installed file.

    Raises:
        PoolError: the family is another one, or the task does not fit it.
    """
    node, family = pool.task_node, installed.node["family"]
    if node.get("family") != family:
        told = str(node.get("family"))[:80]
        raise PoolError(f"{pool.folder} names the family {told!r} for task {pool.task}; the installed one is {family}")
    try:
        return load(pool.task, node)
    except ScengenError as error:
        raise PoolError(f"{pool.folder}: its task cannot be drawn from: {error}") from None
    except (TypeError, ValueError, KeyError, AttributeError, ArithmeticError, RecursionError) as error:
        why = " ".join(str(error).split())[:120]
        raise PoolError(f"{pool.folder}: its task is no task file ({why})") from None


def settings_of(node: Mapping[str, Any]) -> CertifySettings:
    """The settings of a manifest's certificates.

    Raises:
        PoolError: a setting is missing, unknown or no number.
    """
    return _filled("config.certify", CertifySettings(), node)


def _filled(where: str, example: Any, node: Any) -> Any:
    """An object like `example` with the values of `node`, which must have the same names and types."""
    names = [f.name for f in fields(example)]
    if not isinstance(node, Mapping) or set(node) != set(names):
        raise PoolError(f"{where} has other settings than {', '.join(names)}")
    found = {}
    for name in names:
        now, value = getattr(example, name), node[name]
        if is_dataclass(now):
            found[name] = _filled(f"{where}.{name}", now, value)
        elif type(value) is not type(now) and not (isinstance(now, float) and type(value) is int):
            raise PoolError(f"{where}.{name} is no {type(now).__name__}")
        elif not isinstance(value, str) and not 0 <= value <= 3600:
            raise PoolError(f"{where}.{name} = {value}; it must lie in [0, 3600]")
        else:
            found[name] = type(now)(value)
    return type(example)(**found)
