"""The catalogue of all assets, found by their files."""

import inspect
import pkgutil
import re
from dataclasses import MISSING, fields
from functools import cache
from importlib import import_module

from ..errors import UnknownName
from .prop import Prop


@cache
def kits() -> dict[str, type[Prop]]:
    """Classes of all assets with nominal parameters by name, in alphabetical order.

    A name is the class name in snake_case. `MeshProp` is not among them: it has no nominal mesh.
    """
    package = __name__.rpartition(".")[0]
    found = {}
    for module in pkgutil.iter_modules(import_module(package).__path__, f"{package}."):
        for each in vars(import_module(module.name)).values():
            if inspect.isclass(each) and each.__module__ == module.name and issubclass(each, Prop):
                if not inspect.isabstract(each) and _has_nominal(each):
                    found[re.sub(r"(?<!^)(?=[A-Z])", "_", each.__name__).lower()] = each
    return dict(sorted(found.items()))


def kit(name: str) -> Prop:
    """An asset with its nominal parameters.

    Raises:
        UnknownName: there is no such asset.
    """
    if name not in kits():
        raise UnknownName("asset", name, kits())
    return kits()[name]()


def _has_nominal(kind: type[Prop]) -> bool:
    """Whether every field has a default."""
    return all(field.default is not MISSING or field.default_factory is not MISSING for field in fields(kind))
