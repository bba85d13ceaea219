"""Environments that differ from the running one in MuJoCo alone: made by venv and pip, and kept.

An environment has its own pip and MuJoCo. Everything else (scengen, numpy, numba, tasks of other packages) is that
of the running environment, through a .pth file. So the same code is compared under another MuJoCo.
"""

import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import venv
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

from filelock import FileLock

from ..control import native
from ..errors import BadConfig, ScengenError, cut, nearest
from ..installation import cache_folder
from ..work.targets import refused

READY = "ready"
"""Name of the file that is written last. An environment without it is unfinished and is made again."""
SHARED = "scengen_shared.pth"
"""Name of the .pth file that leads to the running environment."""
VERSION = re.compile(r"\d+\.\d+\.\d+[\w.]*", re.ASCII)
"""Pattern of a whole version."""
LISTED_VERSIONS = 12
"""Number of available versions, the newest ones, that an error lists."""


@dataclass(frozen=True)
class Environment:
    """A Python that imports another MuJoCo."""

    mujoco: str
    """Version of MuJoCo."""
    folder: Path

    @property
    def python(self) -> Path:
        """Path of the interpreter."""
        return self.folder / "bin" / "python"

    def lines(self, module: str, request: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
        """Run a module of scengen in the environment, and read its output: objects in JSON, one per line.

        Args:
            request: the module's standard input, as JSON.

        Raises:
            ScengenError: the module fails; the error is that on the module's standard error.
        """
        numba = str(self.folder / "numba")  # code compiled against another MuJoCo has the same name in the cache
        with tempfile.TemporaryFile("w+", errors="replace") as errors:
            with subprocess.Popen(
                [self.python, "-P", "-m", module],  # -P: do not import code from the working folder
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                env={**os.environ, "NUMBA_CACHE_DIR": numba},
            ) as process:
                assert process.stdin is not None and process.stdout is not None
                try:
                    process.stdin.write(json.dumps(request))
                    process.stdin.close()
                    for line in process.stdout:
                        yield json.loads(line)
                except BaseException:  # the reader stopped, or was interrupted
                    process.kill()
                    raise
            if process.returncode:
                errors.seek(0)
                why = _last_word(errors.read())
                raise ScengenError(f"under mujoco {self.mujoco}: {cut(why, 600)}")


def answer(answers: Callable[[dict[str, Any]], Iterator[Mapping[str, Any]]]) -> int:
    """Answer a request as `Environment.lines` makes it: the main function of a module that runs in an environment.

    Args:
        answers: function that makes the lines of the answer of a request.

    Returns:
        The exit status, with the error on standard error.
    """
    lines = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # so that output of a task does not mix with the answers
    native.silence()
    try:
        for content in answers(json.load(sys.stdin)):
            lines.write(json.dumps(content) + "\n")
            lines.flush()
    except ScengenError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _last_word(said: str) -> str:
    """The error of a failed program: the last line of its output that names an exception, or else its last line."""
    lines = [line.strip() for line in said.splitlines() if line.strip()] or ["it ended without a message"]
    named = [line for line in lines if re.match(r"[\w.]+(Error|Exception): ", line)]
    return (named or lines)[-1]


def versions_of(setting: str | list[str]) -> list[str]:
    """Versions in the setting `mujoco`, each once, in their order.

    Raises:
        BadConfig: it does not exist.
    """
    versions = [setting] if isinstance(setting, str) else list(dict.fromkeys(setting))
    if not versions:
        raise BadConfig("mujoco = []; give versions, such as mujoco=[3.5.0,4.0.0]")
    return versions


def environment(mujoco: str, report: Callable[[str], None] = lambda text: None) -> Environment:
    """The environment with a version of MuJoCo. It is made if it does not exist.

    Args:
        report: called with a line if the environment is made, which takes seconds and needs the package index.

    Raises:
        BadConfig: there is no such version, or the environment cannot be written.
    """
    if not VERSION.fullmatch(mujoco):
        raise BadConfig(f"mujoco = {cut(mujoco)}; give whole versions, as in mujoco=[3.5.0,4.0.0]")
    shared = _shared()
    key = hashlib.sha256("\n".join([shared, platform.python_version(), sys.executable]).encode()).hexdigest()[:12]
    folder = cache_folder() / f"mujoco-{mujoco}-{key}"
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with FileLock(folder.with_suffix(f"{folder.suffix}.lock")):
            if not (folder / READY).exists():
                report(f"making an environment with mujoco {mujoco} in {folder}")
                try:
                    _make(folder, mujoco, shared)
                except BaseException:
                    shutil.rmtree(folder, ignore_errors=True)
                    raise
    except OSError as error:
        raise refused(folder, error) from None
    return Environment(mujoco, folder)


def _shared() -> str:
    """Content of the .pth file through which an environment finds the code and packages of the running one.

    The folder of this scengen comes first because another one may be installed. `addsitedir` follows the .pth files of
    the folders in turn, so that editable packages are found.
    """
    scengen = Path(__file__).resolve().parents[2]
    packages = [path for path in dict.fromkeys(sys.path) if Path(path).name in ("site-packages", "dist-packages")]
    return f"{scengen}\nimport site; {'; '.join(f'site.addsitedir({path!r})' for path in packages)}\n"


def _make(folder: Path, mujoco: str, shared: str) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    venv.EnvBuilder(symlinks=True, with_pip=True).create(folder)
    python = folder / "bin" / "python"
    options = ["install", "--quiet", "--disable-pip-version-check", "--no-deps", "--only-binary", ":all:"]
    (packages,) = (folder / "lib").glob("python*/site-packages")
    wanted = [f"mujoco=={mujoco}"]
    while wanted:
        done = subprocess.run([python, "-m", "pip", *options, *wanted], capture_output=True, text=True)
        if done.returncode:
            raise BadConfig(_why_not(mujoco, done.stderr))
        wanted = _missing_parts(packages)
    (packages / SHARED).write_text(shared)
    (folder / READY).write_text("")


def _missing_parts(packages: Path) -> list[str]:
    """The distributions into which MuJoCo 4 is divided, `mujoco-core==4.0.0` and others, that are not installed yet."""
    found = {dist.name: dist for dist in distributions(path=[str(packages)])}
    parts = [line for line in found["mujoco"].requires or () if line.startswith("mujoco-") and ";" not in line]
    return [part for part in parts if part.partition("==")[0] not in found]


def _why_not(mujoco: str, said: str) -> str:
    """Reason why pip did not install a version, in a line."""
    listed = re.search(r"\(from versions: ([^)]*)\)", said)
    known = listed[1].split(", ") if listed and listed[1] != "none" else []
    if known:
        newest = ", ".join(known[-LISTED_VERSIONS:])
        return f"there is no mujoco {mujoco} for this Python{nearest(mujoco, known)}; the newest are {newest}"
    lines = [line for line in said.splitlines() if line.startswith("ERROR")] or [" ".join(said.split())]
    return f"pip cannot install mujoco {mujoco}: {cut(lines[0], 300)}; check whether pip install mujoco works"
