"""scengen.lock in the folder of a pool: versions of the packages that its verdicts depend on, in the format of pip.

It repeats what the manifest says, which counts, and adds the packages that the manifest does not name. Like a pool it
may be of unknown origin: only its lines about packages that the code of a verdict imports are ever used.
"""

import importlib.metadata
import platform
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from llvmlite import binding

from ..errors import PoolError
from ..scenario import Scenario
from ..work.plain import why_not_plain
from ..work.targets import write
from .identity import packages

LOCK_FILE = "scengen.lock"
MAX_BYTES = 100_000
"""Size of the largest file that is read [bytes], far more than it needs."""
ROUNDING_FEATURES = ("sse4.2", "avx", "avx2", "avx512f", "fma", "fma4", "neon", "sve", "sve2")
"""Features of a processor that change how compiled code rounds: fused and wider arithmetic."""
_LINE = re.compile(r"([A-Za-z0-9][\w.-]*)==([\w.!+-]+)", re.ASCII)


def needed(family: type[Scenario], made: Mapping[str, str]) -> dict[str, str]:
    """The packages that a verdict about a family depends on, with their versions, sorted by name.

    Args:
        made: the versions of a manifest, which take precedence.
    """
    named = {name: version for name, version in made.items() if name not in ("scengen", "platform")}
    return dict(sorted({**packages(family), **named}.items(), key=lambda item: item[0].lower()))


def lock_text(
    family: type[Scenario], versions: Mapping[str, str], fingerprint: str, source_sha256: str, task_version: int
) -> str:
    """Content of the file, given the entries of the manifest."""
    cpu = binding.get_host_cpu_features()
    able = " ".join(name for name in ROUNDING_FEATURES if cpu.get(name))
    about = [
        f"What the verdicts of this pool rest on; beside scengen, pip install --no-deps -r {LOCK_FILE} gives it again.",
        f"scengen {versions['scengen']}, version {task_version} of the task, code {source_sha256}",
        f"python {platform.python_version()}",
        f"platform {versions['platform']}, {' '.join(platform.libc_ver())}",
        f"processor {binding.get_host_cpu_name()}: {able}",
        f"rounds as {fingerprint}",
    ]
    lines = [f"{name}=={version}" for name, version in needed(family, versions).items() if _installed(name)]
    return "\n".join([*(f"# {line}" for line in about), *lines]) + "\n"


def _installed(name: str) -> bool:
    """Whether a package is installed. robosuite need not be: the manifest names the release of the robot's files."""
    try:
        return bool(importlib.metadata.version(name))
    except importlib.metadata.PackageNotFoundError:
        return False


def lock_of_run(folder: Path, family: type[Scenario], made: Mapping[str, Any]) -> str:
    """Content of the file for the pool of a run, which is kept in the run's folder from its beginning on.

    Args:
        made: entries of `labels.made_with` of the run.

    Raises:
        PoolError: the run is continued with other packages than it was started with.
        BadConfig: the file cannot be written.
    """
    begun, here = read_lock(folder), needed(family, made["versions"])
    if begun is None:
        write(folder / LOCK_FILE, lock_text(family, **made))
    elif other := [f"{name} {version}" for name, version in begun.items() if here.get(name) != version]:
        install = f"pip install --no-deps -r {folder / LOCK_FILE}"
        raise PoolError(f"{folder} was started with {', '.join(other)}; {install}, or choose another pool=")
    return (folder / LOCK_FILE).read_text()


def read_lock(folder: Path) -> dict[str, str] | None:
    """Versions in the file of a pool, by package; None if there is no file, as in pools that were made otherwise.

    Raises:
        PoolError: it is not such a file.
    """
    path = folder / LOCK_FILE
    if not path.exists() and not path.is_symlink():
        return None
    why = why_not_plain(path)
    if not why and path.stat().st_size > MAX_BYTES:
        why = f"has more than {MAX_BYTES} bytes"
    if why:
        raise PoolError(f"{path} {why}; remove it")
    found = {}
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            match = _LINE.fullmatch(line)
            if match is None or match[1] in found:
                raise PoolError(f"{path}: line {number} is not `package==version` of another package; remove the file")
            found[match[1]] = match[2]
    return found


def differing(locked: Mapping[str, str], here: Mapping[str, str]) -> dict[str, str]:
    """Packages that a file names in a different version than `here` has, with the version that the file names."""
    return {name: version for name, version in locked.items() if here.get(name, version) != version}


def unneeded(locked: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Packages that a file names and that no verdict depends on: they should not be installed because of the file."""
    return [name for name in locked if name not in here]
