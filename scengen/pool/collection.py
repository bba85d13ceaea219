"""Several pools as one: a folder with a pool for each task and split, and an index that names them and their hashes.

Every command that takes several pools takes such a folder in their place. Like a pool it is data from anybody: its
index names folders beside it, and nothing else.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import PoolError, cut
from . import schema, shards
from .pool import MANIFEST, Pool

INDEX = "index.json"
FORMAT = 1
MOST = 10_000
"""How many pools an index may name."""


def write(folder: Path, pools: Sequence[Pool]) -> None:
    """Write the index of the pools below a folder; those that it names already, and that are still there, stay.

    Raises:
        PoolError: there is an index, and it is damaged.
    """
    earlier = [folder / name for name in _read(folder)] if (folder / INDEX).is_file() else []
    every = {pool.folder.name: pool for pool in [*(Pool.open(f) for f in earlier if (f / MANIFEST).is_file()), *pools]}
    about = {
        name: {"task": pool.task, "scenarios": len(pool), "sha256": pool.sha256} for name, pool in sorted(every.items())
    }
    text = json.dumps({"format": FORMAT, "pools": about}, indent=1, sort_keys=True) + "\n"
    shards.replace(folder / INDEX, text.encode())


def members(folder: str | Path) -> list[str]:
    """The pools that a folder stands for: those of its index, or itself if it has none.

    Raises:
        PoolError: the index is damaged, or a pool is not the one that it names.
    """
    folder = Path(folder)
    if (folder / MANIFEST).exists() or not (folder / INDEX).exists():
        return [str(folder)]
    named = _read(folder)
    for name, sha256 in named.items():
        if Pool.open(folder / name).sha256 != sha256:
            told = f"{folder / name} is not the pool of which {folder / INDEX} tells"
            raise PoolError(f"{told}; restore it, or name the pools themselves: pool={folder / name},...")
    return [str(folder / name) for name in named]


def folders(pool: str | Sequence[str]) -> list[str]:
    """The pools that some folders stand for, see `members`."""
    return [each for folder in ([pool] if isinstance(pool, str) else pool) for each in members(folder)]


def _read(folder: Path) -> dict[str, str]:
    """Names and hashes of the pools of an index."""
    path = folder / INDEX
    try:
        index = schema.read_file(path)
        if index["format"] != FORMAT:
            raise ValueError(f"format {index['format']!r:.20}, this scengen reads {FORMAT}")
        found = {str(name): str(about["sha256"]) for name, about in index["pools"].items()}
        if not found or len(found) > MOST:
            raise ValueError(f"{len(found)} pools")
        if strange := [name for name in found if not re.fullmatch(r"[\w+@=,\[\]-][\w.+@=,\[\]-]*", name)]:
            raise ValueError(f"{cut(repr(strange[0]))} is no name of a folder beside it")
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        why = " ".join(str(error).split())[:160]
        raise PoolError(f"{path} is damaged; name the pools themselves, or generate them again ({why})") from None
    return found
