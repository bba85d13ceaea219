"""Several pools as one: a folder with a pool for each task and split, and an index of their names and hashes.

Every command that takes several pools also takes such a folder. Its index may be of unknown origin, like a pool:
it can name neighbouring folders, and nothing else.
"""

import json
import re
from collections.abc import Sequence
from pathlib import Path

from ..errors import PoolError, cut
from .files import read_json_file, replace_file
from .manifest import MANIFEST
from .pool import Pool

INDEX = "index.json"
INDEX_FORMAT = 1
MAX_POOLS = 10_000
"""Largest number of pools in an index."""


def write_index(folder: Path, pools: Sequence[Pool]) -> None:
    """Write the index of the pools below a folder. Pools that it names already stay if they are still there.

    Raises:
        PoolError: there is an index, and it is damaged.
    """
    earlier = [folder / name for name in _read_index(folder)] if (folder / INDEX).is_file() else []
    every = {pool.folder.name: pool for pool in [*(Pool.open(f) for f in earlier if (f / MANIFEST).is_file()), *pools]}
    about = {
        name: {"task": pool.task, "scenarios": len(pool), "sha256": pool.sha256} for name, pool in sorted(every.items())
    }
    text = json.dumps({"format": INDEX_FORMAT, "pools": about}, indent=1, sort_keys=True) + "\n"
    replace_file(folder / INDEX, text.encode())


def members(folder: str | Path) -> list[str]:
    """Folders of the pools that a folder stands for: those of its index, or itself if it has none.

    Raises:
        PoolError: the index is damaged, or a pool is not the one that the index names.
    """
    folder = Path(folder)
    if (folder / MANIFEST).exists() or not (folder / INDEX).exists():
        return [str(folder)]
    named = _read_index(folder)
    for name, sha256 in named.items():
        if Pool.open(folder / name).sha256 != sha256:
            message = f"{folder / name} has a different hash than {folder / INDEX} says"
            raise PoolError(f"{message}; restore it, or name the pools themselves: pool={folder / name},...")
    return [str(folder / name) for name in named]


def folders(pool: str | Sequence[str]) -> list[str]:
    """Folders of the pools that some folders stand for, see `members`."""
    return [each for folder in ([pool] if isinstance(pool, str) else pool) for each in members(folder)]


def _read_index(folder: Path) -> dict[str, str]:
    """Hashes of the pools of an index, by name."""
    path = folder / INDEX
    try:
        index = read_json_file(path)
        if index["format"] != INDEX_FORMAT:
            raise ValueError(f"format {index['format']!r:.20}, this scengen reads {INDEX_FORMAT}")
        found = {str(name): str(about["sha256"]) for name, about in index["pools"].items()}
        if not found or len(found) > MAX_POOLS:
            raise ValueError(f"{len(found)} pools; 1 to {MAX_POOLS} are read")
        if strange := [name for name in found if not re.fullmatch(r"[\w+@=,\[\]-][\w.+@=,\[\]-]*", name)]:
            raise ValueError(f"{cut(repr(strange[0]))} is not the name of a folder next to it")
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        why = " ".join(str(error).split())[:160]
        raise PoolError(f"{path} is damaged; name the pools themselves, or generate them again ({why})") from None
    return found
