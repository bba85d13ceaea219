"""Work on a Ray cluster: the same items and the same results, even if workers and nodes are lost."""

import ctypes
import importlib.util
import logging
import os
import pickle
import re
import secrets
import signal
import socket
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TextIO, TypeVar

from ..errors import BadConfig, cut
from ..installation import cache_folder
from .crew import Crew
from .nodes import ClusterError, code_sha256, one_line
from .parallel import Limits
from .targets import refused

log = logging.getLogger("scengen.cluster")

A = TypeVar("A")
B = TypeVar("B")

AUTO = "auto"
"""Address of the cluster that this machine is a node of; also the number of workers of one on each core."""
LOCAL = "local"
"""Address of a cluster that is started on this machine for one command."""
LOOPBACK = "127.0.0.1"
"""Address of the servers of a cluster that is started on this machine: no other machine reaches them."""
ON_LOOPBACK = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
"""Environment that lets Ray's servers listen on `LOOPBACK` only, which is its choice where it supports no clusters.
Otherwise it replaces `LOOPBACK` by the address of the machine, and listens on all interfaces."""
CONNECT_TIMEOUT = 5.0
"""Time in which an address must answer [s]."""
MAX_WORKERS = 10_000
"""Largest number of workers that can be requested."""
WRONG_TOKEN = "InvalidAuthToken"
"""Word that Ray repeats before it gives up, if a token is missing or is not that of the cluster."""
QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".*",  # messages of nodes about each other, which Ray prints among a command's results
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # otherwise Ray warns about graphics cards
}
"""Environment of Ray, unless it is set: Ray sends no statistics, and only scengen prints."""


@dataclass
class Cluster:
    """Workers on the nodes of a Ray cluster: an executor, see `scengen.work.parallel.Executor`."""

    address: str = AUTO
    """Address: `auto`, `local`, `HOST:PORT` from a node of the cluster, or `ray://HOST:PORT` from elsewhere."""
    token: str | None = None
    """File with the token of the cluster; Ray's own by default."""
    count: int | None = None
    """Number of workers; None for one on each core of the nodes."""

    def __post_init__(self) -> None:
        self.status = ""
        self._announced: set[str] = set()
        """Messages about nodes that are not used, each of which is logged once."""

    def connect(self) -> ModuleType:
        """Join the cluster, unless this process has joined one.

        Returns:
            Ray.

        Raises:
            ScengenError: Ray is not installed, the address or the token is wrong, or there is no answer.
        """
        if self.count is not None and not 1 <= self.count <= MAX_WORKERS:
            raise BadConfig(f"workers = {self.count}; on a cluster it must be {AUTO} or lie in [1, {MAX_WORKERS}]")
        ray = self._ray()
        if ray.is_initialized():
            return ray
        if ":" in self.address:
            self._check_answer()
        code_sha256()  # soon after this process has imported the code, before the files can change
        given = f"executor.address = {cut(self.address)}"
        settings = {"include_dashboard": False, "_node_ip_address": LOOPBACK} if self.address == LOCAL else {}
        with _sigterm_restored(), tempfile.TemporaryFile("w+") as output:
            try:
                with _stderr_to(output):
                    if self.address == LOCAL:
                        _adopt_orphans()
                    ray.init(self.address, log_to_driver=False, logging_level=logging.CRITICAL, **settings)
                if self.address == LOCAL:
                    self._check_loopback(ray)
                return ray
            except ray.exceptions.AuthenticationError as error:
                why = one_line(error).partition(". ")[0]
            except ConnectionError as error:
                why = one_line(error).partition(". ")[0]
                output.seek(0)
                if WRONG_TOKEN not in output.read():
                    remedy = f"start one with ray start --head, or give executor.address=HOST:PORT or {LOCAL}"
                    raise ClusterError(f"{given}: {why}; {remedy}") from None
                why = "the token is missing or wrong"
            except ClusterError:
                raise
            except Exception as error:  # Ray raises a bare Exception if its processes do not start in time
                remedy = "repeat the command, on a machine that is less busy"
                raise ClusterError(f"{given}: Ray cannot join: {cut(one_line(error), 400)}; {remedy}") from None
        raise ClusterError(f"{given}: {why}; give the file with the cluster's token as executor.token=")

    def each(
        self,
        function: Callable[[A], B],
        items: Iterable[A],
        limits: Limits | None,
        lost: Callable[[A, str], B] | None,
    ) -> Iterator[B]:
        """The function `scengen.work.parallel.each`, on nodes that round like this machine and run the same code.

        Raises:
            ClusterError: no node can be used, or workers die one after the other without a result.
            WorkerDied: an item has crashed too many workers, or has reached a limit, and there is no `lost`.
        """
        crew = Crew(self.connect(), pickle.dumps(function), limits, self.count, self._announced, self._report)
        try:
            yield from crew.work(iter(items), lost)
        finally:
            crew.end()
            self.status = ""

    def _report(self, status: str) -> None:
        self.status = status

    def _ray(self) -> ModuleType:
        """Import Ray, with an environment that keeps it quiet."""
        if importlib.util.find_spec("ray") is None:
            raise ClusterError("executor=ray needs Ray, which is not installed; pip install 'scengen[ray]'")
        if not re.fullmatch(rf"{AUTO}|{LOCAL}|(ray://)?[\w.-]+:\d{{1,5}}", self.address, re.ASCII):
            accepted = f"{AUTO}, {LOCAL}, HOST:PORT or ray://HOST:PORT"
            raise BadConfig(f"executor.address = {cut(repr(self.address))}; it must be {accepted}")
        if self.token is not None:
            if not Path(self.token).is_file():
                raise BadConfig(f"executor.token = {cut(self.token)}; there is no such file; give that with the token")
            os.environ.update(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN_PATH=self.token)
        elif self.address == LOCAL:
            _use_own_token()
        if self.address == LOCAL:
            os.environ.update(ON_LOOPBACK)
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        import ray

        return ray

    def _check_loopback(self, ray: ModuleType) -> None:
        """End the cluster of this machine, and raise `ClusterError`, if other machines can reach its servers."""
        addresses = sorted({str(node["NodeManagerAddress"]) for node in ray.nodes()})
        if addresses != [LOOPBACK]:
            ray.shutdown()
            why = f"Ray's servers are on {', '.join(addresses)} and not on {LOOPBACK}"
            raise ClusterError(f"executor.address = {LOCAL}: {why}; import scengen before ray, or give HOST:PORT")

    def _check_answer(self) -> None:
        """Raise `ClusterError` if the address does not answer: Ray would wait for minutes and end the process."""
        host, _, port = self.address.rpartition("/")[2].rpartition(":")
        try:
            socket.create_connection((host, int(port)), CONNECT_TIMEOUT).close()
        except (OSError, OverflowError, UnicodeError) as error:
            why = f"no answer ({one_line(error)}); check that the cluster runs, and give its HOST:PORT"
            raise ClusterError(f"executor.address = {cut(self.address)}: {why}") from None


def _adopt_orphans() -> None:
    """Become the parent of processes whose parents die. Agents of Ray outlive the server that has started them, and an
    interrupted command ends its children."""
    ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1)


_PR_SET_CHILD_SUBREAPER = 36
"""Option of prctl: descendants without a parent become children of this process (linux/prctl.h)."""


def _use_own_token() -> None:
    """Let the cluster of this machine use a token that scengen keeps, unless the environment names one.

    Ray would write one into the home folder that every user can read.

    Raises:
        BadConfig: the token cannot be written.
    """
    if os.environ.get("RAY_AUTH_MODE") or os.environ.get("RAY_AUTH_TOKEN_PATH"):
        return
    path = cache_folder() / "ray" / "token"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.parent.chmod(0o700)
        if not path.exists():
            with tempfile.NamedTemporaryFile("w", dir=path.parent, delete=False) as part:  # readable by its owner only
                part.write(secrets.token_hex(32))
            os.replace(part.name, path)
    except OSError as error:
        raise refused(path, error) from None
    os.environ.update(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN_PATH=str(path))
    log.warning("scengen: a Ray cluster of this machine, on %s; its token is in %s", LOOPBACK, path)


@contextmanager
def _sigterm_restored() -> Iterator[None]:
    """Restore the handler of SIGTERM, which Ray replaces and the command line needs to clean up."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


@contextmanager
def _stderr_to(file: TextIO) -> Iterator[None]:
    """Send standard error to a file, with the output of Ray's processes and libraries."""
    kept = os.dup(2)
    os.dup2(file.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
