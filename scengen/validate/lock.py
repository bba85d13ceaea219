"""scengen.lock beside a pool: the versions of everything that its verdicts were made with, as pip reads them.

It repeats what the manifest says, which counts, and adds the packages that the manifest does not name. Like a pool it
is data from anybody: of its lines only those of packages that the code of a verdict imports are ever looked at.
"""

import platform
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from llvmlite import binding

from ..errors import PoolError
from ..pool import schema
from ..scenario import Scenario
from ..work.targets import write
from .identity import packages

FILE = "scengen.lock"
LARGEST = 100_000
"""Bytes of such a file, far more than it needs."""
ROUNDING = ("sse4.2", "avx", "avx2", "avx512f", "fma", "fma4", "neon", "sve", "sve2")
"""What a processor can do, if it can, that changes how compiled code rounds: fused and wider arithmetic."""
_LINE = re.compile(r"([A-Za-z0-9][\w.-]*)==([\w.!+-]+)", re.ASCII)


def needed(family: type[Scenario], made: Mapping[str, str]) -> dict[str, str]:
    """The packages that a verdict about a family touches, with their versions, sorted by name.

    Args:
        made: the versions of a manifest; those that it names count.
    """
    named = {name: told for name, told in made.items() if name not in ("scengen", "platform")}
    return dict(sorted({**packages(family), **named}.items(), key=lambda item: item[0].lower()))


def text(family: type[Scenario], versions: Mapping[str, str], fingerprint: str, source_sha256: str) -> str:
    """What the file says. The arguments are those of the manifest."""
    cpu = binding.get_host_cpu_features()
    able = " ".join(name for name in ROUNDING if cpu.get(name))
    about = [
        f"What the verdicts of this pool rest on; beside scengen, pip install --no-deps -r {FILE} gives it again.",
        f"scengen {versions['scengen']}, code {source_sha256}",
        f"python {platform.python_version()}",
        f"platform {versions['platform']}, {' '.join(platform.libc_ver())}",
        f"processor {binding.get_host_cpu_name()}: {able}",
        f"rounds as {fingerprint}",
    ]
    lines = [f"{name}=={told}" for name, told in needed(family, versions).items()]
    return "\n".join([*(f"# {line}" for line in about), *lines]) + "\n"


def of_run(folder: Path, family: type[Scenario], made: Mapping[str, Any]) -> str:
    """The text for the pool of a run, which is kept in the run's folder from its beginning on.

    Args:
        made: `versions`, `fingerprint` and `source_sha256` of the run.

    Raises:
        PoolError: the run is continued with other packages than it was begun with.
        BadConfig: the file cannot be written.
    """
    begun, here = read(folder), needed(family, made["versions"])
    if begun is None:
        write(folder / FILE, text(family, **made))
    elif other := [f"{name} {told}" for name, told in begun.items() if here.get(name) != told]:
        install = f"pip install --no-deps -r {folder / FILE}"
        raise PoolError(f"{folder} was begun with {', '.join(other)}; {install}, or choose another pool=")
    return (folder / FILE).read_text()


def read(folder: Path) -> dict[str, str] | None:
    """The packages and versions of a pool's file; None if it has none, as pools that were made otherwise.

    Raises:
        PoolError: it is no such file.
    """
    path = folder / FILE
    if not path.exists() and not path.is_symlink():
        return None
    why = schema.why_no_plain_file(path)
    if not why and path.stat().st_size > LARGEST:
        why = f"has more than {LARGEST} bytes"
    if why:
        raise PoolError(f"{path} {why}; remove it")
    found = {}
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            match = _LINE.fullmatch(line)
            if match is None or match[1] in found:
                raise PoolError(f"{path}: line {number} is no `package==version` of its own; remove the file")
            found[match[1]] = match[2]
    return found


def differing(locked: Mapping[str, str], here: Mapping[str, str]) -> dict[str, str]:
    """Packages that a file names in another version than `here` has, and which that is."""
    return {name: told for name, told in locked.items() if here.get(name, told) != told}


def strange(locked: Mapping[str, str], here: Mapping[str, str]) -> list[str]:
    """Packages that a file names, and that no verdict touches: nobody should install them because of it."""
    return [name for name in locked if name not in here]
