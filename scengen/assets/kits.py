"""All assets, found by their files."""

import inspect
import pkgutil
import re
from functools import cache
from importlib import import_module

from ..errors import UnknownName
from .prop import Prop


@cache
def kits() -> dict[str, type[Prop]]:
    """Every asset of this package by its name, that of its class in snake_case, in alphabetical order."""
    package = __name__.rpartition(".")[0]
    found = {}
    for module in pkgutil.iter_modules(import_module(package).__path__, f"{package}."):
        for each in vars(import_module(module.name)).values():
            if inspect.isclass(each) and each.__module__ == module.name and issubclass(each, Prop):
                if not inspect.isabstract(each):
                    found[re.sub(r"(?<!^)(?=[A-Z])", "_", each.__name__).lower()] = each
    return dict(sorted(found.items()))


def kit(name: str) -> Prop:
    """An asset with its nominal parameters.

    Raises:
        UnknownName: there is none of that name.
    """
    if name not in kits():
        raise UnknownName("asset", name, kits())
    return kits()[name]()
