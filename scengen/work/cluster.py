"""Work on a Ray cluster: the same items, the same results, whatever becomes of its workers and nodes.

Ray brings items to the nodes and results back. What is lost is tried again here and not by Ray, so that an item is
never worked on twice unnoticed; results come to one process, which writes them. Every worker is an actor that holds
one core and hands its items to a process with limits, as on a single machine (`scengen.parallel`).
"""

import hashlib
import importlib.util
import logging
import os
import pickle
import re
import signal
import socket
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO, TypeVar

from ..errors import BadConfig, ScengenError, cut
from ..fingerprint import fingerprint
from ..task_files import conf_dir
from ..versions import versions
from .parallel import Limits, each, made_of_lost, portable
from .printed import printable

A = TypeVar("A")
B = TypeVar("B")

AUTO, LOCAL = "auto", "local"
"""Addresses: of a cluster that this machine is a node of, and of one that is started here for this command alone."""
LOOK = 1.0
"""Nodes that come and go are looked for this often [s]."""
START = 120.0
"""How long a node may take to tell about itself, and how long all may be without a worker that is ready [s]."""
NOTICED = 30.0
"""Ray notices after 10 to 25 s that a node is gone (5 missed checks, 3 s apart): who looks later knows [s]."""
TRIES = 2
"""Workers that an item may take with it; deaths of whole nodes do not count."""
DEATHS = 3
"""So many times as many workers as there are may die one after the other, if no item comes to its end meanwhile."""
REACHED = 5.0
"""How long an address may take to answer [s]."""
MOST_WORKERS = 10_000
WRONG_TOKEN = "InvalidAuthToken"
"""What Ray writes again and again, before it gives up, where a token is missing or another one than the cluster's."""

log = logging.getLogger("scengen.cluster")


class ClusterError(ScengenError):
    """A cluster cannot be reached, or nothing that it is given comes back."""


@dataclass
class Cluster:
    """Workers on the nodes of a Ray cluster: an executor, see `scengen.parallel.Executor`."""

    address: str = AUTO
    """`auto`, `local`, `HOST:PORT` from a node of the cluster, or `ray://HOST:PORT` from elsewhere."""
    token: str | None = None
    """File that holds the cluster's token; by default where Ray looks for it."""
    count: int | None = None
    """How many workers; as many as the nodes have cores if None."""

    def __post_init__(self) -> None:
        self.status = ""
        self.told: set[str] = set()
        """What has been said of nodes that are not used, once for all that is done."""

    def connect(self) -> ModuleType:
        """Join the cluster, unless this process has joined one.

        Returns:
            Ray.

        Raises:
            ScengenError: Ray is not installed, the address or the token is wrong, or nobody answers there.
        """
        if self.count is not None and not 1 <= self.count <= MOST_WORKERS:
            raise BadConfig(f"workers = {self.count}; of a cluster they must be from 1 to {MOST_WORKERS}, or auto")
        ray = self._ray()
        if ray.is_initialized():
            return ray
        if ":" in self.address:
            self._answers()
        code_sha256()  # of the code that this process has imported: soon after, before anybody changes it
        given = f"executor.address = {cut(self.address)}"
        settings = {"include_dashboard": False} if self.address == LOCAL else {}
        with _sigterm_kept(), tempfile.TemporaryFile("w+") as said:
            try:
                with _redirected(said):
                    ray.init(self.address, log_to_driver=False, logging_level=logging.CRITICAL, **settings)
                return ray
            except ray.exceptions.AuthenticationError as error:
                why = _line(error).partition(". ")[0]
            except ConnectionError as error:
                why = _line(error).partition(". ")[0]
                said.seek(0)
                if WRONG_TOKEN not in said.read():
                    remedy = f"start one with ray start --head, or say executor.address=HOST:PORT or {LOCAL}"
                    raise ClusterError(f"{given}: {why}; {remedy}") from None
                why = "the token is missing or wrong"
            except (RuntimeError, ValueError, OSError, ray.exceptions.RayError) as error:
                raise ClusterError(f"{given}: Ray cannot join: {cut(_line(error), 400)}") from None
        raise ClusterError(f"{given}: {why}; name the file of the cluster's token with executor.token=")

    def each(
        self,
        function: Callable[[A], B],
        items: Iterable[A],
        limits: Limits | None,
        lost: Callable[[A, str], B] | None,
    ) -> Iterator[B]:
        """What `scengen.parallel.each` does, on nodes that round like this machine and run the same code.

        Raises:
            ClusterError: no node can be used, or workers die one after the other without any result.
            WorkerDied: an item has taken `TRIES` workers with it, or has reached a limit, and there is no `lost`.
        """
        crew = _Crew(self.connect(), self, pickle.dumps(function), limits)
        try:
            yield from crew.work(iter(items), lost)
        finally:
            crew.end()
            self.status = ""

    def _ray(self) -> ModuleType:
        """Ray, which is imported when it is needed, and told to be quiet before."""
        if importlib.util.find_spec("ray") is None:
            raise ClusterError("executor=ray needs Ray, which is not installed; pip install 'scengen[ray]'")
        if not re.fullmatch(rf"{AUTO}|{LOCAL}|(ray://)?[\w.-]+:\d{{1,5}}", self.address, re.ASCII):
            accepted = f"{AUTO}, {LOCAL}, HOST:PORT or ray://HOST:PORT"
            raise BadConfig(f"executor.address = {cut(repr(self.address))}; it must be {accepted}")
        if self.token is not None:
            if not Path(self.token).is_file():
                raise BadConfig(
                    f"executor.token = {cut(self.token)}; there is no such file; it holds the cluster's token"
                )
            os.environ.update(RAY_AUTH_MODE="token", RAY_AUTH_TOKEN_PATH=self.token)
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        import ray

        return ray

    def _answers(self) -> None:
        """Raise `ClusterError` where nobody listens: Ray would wait for minutes, and end the process."""
        host, _, port = self.address.rpartition("/")[2].rpartition(":")
        try:
            socket.create_connection((host, int(port)), REACHED).close()
        except (OSError, OverflowError, UnicodeError) as error:
            why = f"nobody answers there ({_line(error)}); see that the cluster runs, and say its HOST:PORT"
            raise ClusterError(f"executor.address = {cut(self.address)}: {why}") from None


QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".*",  # what nodes tell of each other, which Ray prints among a command's results
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # else a warning about graphics cards that nobody asks for
}
"""Environment of Ray, unless it is set: no statistics are sent, and nothing is printed but by scengen."""


def about(function: bytes) -> dict[str, str]:
    """What has to be alike on all nodes, by name: versions, how the machine rounds, the code.

    Args:
        function: pickled.

    Raises:
        Exception: what the function is made of is not installed here.
    """
    pickle.loads(function)
    return {**versions(), "fingerprint": fingerprint(), "code": code_sha256()}


@cache
def code_sha256() -> str:
    """Hash of the Python and configuration files of scengen, by name: the same in a checkout and where it is installed.

    That of one family is in every certificate; what else a node may run, such as an adversary, is in none.
    """
    parts = []
    for root, pattern in ((Path(__file__).parents[1], "*.py"), (conf_dir(), "*.yaml")):
        names = {path.relative_to(root): path for path in root.rglob(pattern)}
        shipped = (name for name in names if name.parts[0] not in ("conf", "example"))  # beside it in a checkout
        parts += [f"{name} {hashlib.sha256(names[name].read_bytes()).hexdigest()}" for name in sorted(shipped)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@contextmanager
def _sigterm_kept() -> Iterator[None]:
    """Ray takes SIGTERM for itself, which the command line needs to put things in order."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


@contextmanager
def _redirected(file: TextIO) -> Iterator[None]:
    """What Ray's own processes and libraries write on standard error meanwhile goes to a file."""
    kept = os.dup(2)
    os.dup2(file.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _line(error: BaseException) -> str:
    return printable(" ".join(str(error).split()))


class Seat:
    """One worker, which Ray keeps on one core of a node as an actor."""

    def __init__(self) -> None:
        self._item: Any = None
        self._replies: Iterator[bytes]

    def begin(self, function: bytes, limits: Limits | None) -> None:
        """Get ready for items."""
        # Not by fork: the process of an actor has threads of Ray's.
        self._replies = each(_Pickling(pickle.loads(function)), iter(lambda: self._item, _END), 1, limits, _lost, False)

    def run(self, item: bytes) -> bytes:
        """The reply to an item, pickled: what the function made of it, why it is lost, or an error."""
        self._item = pickle.loads(item)
        try:
            return next(self._replies)
        except Exception as error:
            return portable(error)


_END = object()
"""What no item is."""


@dataclass(frozen=True)
class _Pickling:
    """A function whose results are replies."""

    function: Callable[[Any], Any]

    def __call__(self, item: Any) -> bytes:
        return pickle.dumps(("result", self.function(item)))


def _lost(item: Any, reason: str) -> bytes:
    return pickle.dumps(("lost", reason))


@dataclass
class _Task:
    """An item on its way."""

    item: Any
    fallen: list[str] = field(default_factory=list)
    """Nodes on which a worker has died over it."""
    since: float = 0.0
    """When the last of them did."""


@dataclass
class _Worker:
    """A worker as it is seen from here."""

    actor: Any
    node: str
    task: _Task | None = None
    """None while it starts, or has nothing to do."""
    deadline: float = float("inf")


@dataclass
class _Node:
    """A node of the cluster."""

    name: str
    cores: int
    deadline: float
    """When it must have told about itself."""


class _Crew:
    """The workers of one run."""

    def __init__(self, ray: ModuleType, cluster: Cluster, function: bytes, limits: Limits | None):
        self.ray, self.cluster, self.limits = ray, cluster, limits
        self._own, self._function = about(function), ray.put(function)
        self._about = ray.remote(num_cpus=0, max_retries=0)(about)
        self._seat = ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(Seat)
        self._alive: set[str] = set()
        self._asked: dict[Any, tuple[str, _Node]] = {}
        """Nodes that are telling about themselves, by what will hold that."""
        self._nodes: dict[str, _Node] = {}
        """Those that are used."""
        self._refused: dict[str, str] = {}
        """Those that are not, and why."""
        self._pending: dict[Any, _Worker] = {}
        """Workers that start or work, by what will hold their answer."""
        self._idle: list[_Worker] = []
        self._again: deque[_Task] = deque()
        self._doubtful: list[_Task] = []
        """Those that have taken workers with them, until it is known whether it was the nodes that died."""
        self._deaths = 0
        """Workers that have died since the last result."""
        self._looked, self._useful = float("-inf"), time.monotonic()

    def work(self, items: Iterator[A], lost: Callable[[A, str], B] | None) -> Iterator[B]:
        """Results, as they come."""
        more = True
        while True:
            self._look(more)
            while self._idle and (self._again or more):
                if self._again:
                    self._give(self._idle.pop(), self._again.popleft())
                elif (item := next(items, _END)) is not _END:
                    self._give(self._idle.pop(), _Task(item))
                else:
                    more = False
            if not (more or self._again or self._doubtful or self._working()):
                return
            for ref in self._ready():
                if ref in self._asked:
                    self._answered(ref)
                elif reply := self._reply(ref):
                    kind, value, item = reply
                    if kind == "error":
                        raise value
                    yield value if kind == "result" else made_of_lost(item, value, lost)
            for task in self._judged():
                yield made_of_lost(task.item, f"died: it took {TRIES} workers with it", lost)

    def end(self) -> None:
        """End all workers, in the middle of their work if need be."""
        for worker in self._workers():
            self.ray.kill(worker.actor)

    def _workers(self) -> list[_Worker]:
        return [*self._pending.values(), *self._idle]

    def _working(self) -> bool:
        return any(worker.task for worker in self._pending.values())

    def _ready(self) -> list[Any]:
        """Answers that have come; if there are none, they are waited for until the next look."""
        if not (waiting := [*self._pending, *self._asked]):
            time.sleep(LOOK)
            return []
        ready, rest = self.ray.wait(waiting, timeout=LOOK)
        return ready + self.ray.wait(rest, num_returns=len(rest), timeout=0)[0] if rest else ready

    # --- nodes ----------------------------------------------------------------------------------

    def _look(self, more: bool) -> None:
        """Find nodes that have come or gone, start workers where some are missing, end those that hang.

        Args:
            more: whether there may be items that nobody has begun.
        """
        now = time.monotonic()
        if now - self._looked < LOOK:
            return
        self._looked = now
        told = {node["NodeID"]: node for node in self.ray.nodes() if node["Alive"]}
        self._alive = set(told)
        for id_ in self._nodes.keys() - self._alive:
            log.warning("scengen: %s is lost; what was under way there is tried elsewhere", self._nodes.pop(id_).name)
        known = {*self._nodes, *self._refused, *(id_ for id_, _ in self._asked.values())}
        for id_ in self._alive - known:
            if cores := int(told[id_]["Resources"].get("CPU", 0)):
                name = printable(f"node {told[id_]['NodeManagerHostname']} ({id_[:8]})")
                self._asked[self._on(self._about, id_)(self._function)] = id_, _Node(name, cores, now + START)
        for ref in [ref for ref, (_, node) in self._asked.items() if node.deadline < now]:
            self._refuse(*self._asked.pop(ref), f"it did not tell about itself in {START:g} s")
        for ref in [ref for ref, worker in self._pending.items() if worker.deadline < now]:
            self._fallen(self._pending.pop(ref), "it gave no sign of life")
        if (more or self._again) and not self._asked:  # else the first node to answer would get all workers
            self._start_missing()
        self._check(now)

    def _on(self, what: Any, node: str) -> Callable[..., Any]:
        """What starts a function or an actor on a node and nowhere else."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        return what.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=False)).remote

    def _answered(self, ref: Any) -> None:
        """A node has told about itself: it is used if it is like this machine."""
        id_, node = self._asked.pop(ref)
        try:
            found = self.ray.get(ref)
        except self.ray.exceptions.RayTaskError as error:
            self._refuse(id_, node, printable(cut(str(error).strip().splitlines()[-1])))
            return
        except self.ray.exceptions.RayError as error:
            self._died(cut(_line(error)))  # if the node lives, it is asked again
            return
        differs = [
            f"{name} {found[name][:20]} instead of {own[:20]}" for name, own in self._own.items() if found[name] != own
        ]
        if differs:
            self._refuse(id_, node, ", ".join(differs))
        else:
            self._nodes[id_] = node

    def _refuse(self, id_: str, node: _Node, why: str) -> None:
        self._refused[id_] = f"{node.name} is not used: {why}"
        if self._refused[id_] not in self.cluster.told:
            self.cluster.told.add(self._refused[id_])
            log.warning("scengen: %s", self._refused[id_])

    def _start_missing(self) -> None:
        """Start workers, each on the node with most cores that have none, until there are as many as asked for."""
        taken = Counter(worker.node for worker in self._workers())
        free = {id_: node.cores - taken[id_] for id_, node in self._nodes.items()}
        wanted = sum(free.values())
        if self.cluster.count is not None:
            wanted = min(wanted, self.cluster.count - taken.total())
        for _ in range(wanted):
            id_ = max(free, key=free.__getitem__)
            free[id_] -= 1
            worker = _Worker(self._on(self._seat, id_)(), id_)
            self._pending[worker.actor.begin.remote(self._function, self.limits)] = worker

    def _check(self, now: float) -> None:
        """Tell how many workers there are, and give up where there are none.

        Raises:
            ClusterError: no node can be used, or no worker starts.
        """
        ready = [*self._idle, *(worker for worker in self._pending.values() if worker.task)]
        counts = {"node": len({worker.node for worker in ready}), "worker": len(ready)}
        self.cluster.status = ", ".join(f"{n} {what}{'s' * (n != 1)}" for what, n in counts.items())
        if ready:
            self._useful = now
        if self._refused and not (self._nodes or self._asked):
            raise ClusterError(f"no node of the cluster can be used; {'; '.join(sorted(self._refused.values()))}")
        if now - self._useful > START:
            why = "other work takes all cores, see ray status" if self._nodes else "it has no node with cores left"
            raise ClusterError(f"the cluster has started no worker in {START:g} s: {why}; {_KEPT}")

    # --- workers --------------------------------------------------------------------------------

    def _give(self, worker: _Worker, task: _Task) -> None:
        worker.task = task
        if self.limits:  # it may try twice, and may have to start a process before
            worker.deadline = time.monotonic() + 2 * self.limits.seconds + START
        self._pending[worker.actor.run.remote(pickle.dumps(task.item))] = worker

    def _reply(self, ref: Any) -> tuple[str, Any, Any] | None:
        """What has become of a worker's item, and that item; nothing if the worker has just started, or has died."""
        worker = self._pending.pop(ref)
        try:
            reply = self.ray.get(ref)
        except self.ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self.ray.exceptions.RayError as error:
            self._fallen(worker, cut(_line(error)))
            return None
        task, worker.task, worker.deadline = worker.task, None, float("inf")
        self._idle.append(worker)
        if task is None:
            return None
        self._deaths = 0
        return (*pickle.loads(reply), task.item)

    def _fallen(self, worker: _Worker, why: str) -> None:
        """A worker has died, or hangs: its item is tried again."""
        self.ray.kill(worker.actor)
        if worker.task:
            worker.task.fallen.append(worker.node)
            worker.task.since = time.monotonic()
            (self._again if len(worker.task.fallen) < TRIES else self._doubtful).append(worker.task)
        self._died(why)

    def _died(self, why: str) -> None:
        """Count what has died.

        Raises:
            ClusterError: so have many before it, and none has done anything.
        """
        self._deaths += 1
        if self._deaths > DEATHS * max(len(self._workers()), TRIES):
            raise ClusterError(
                f"{self._deaths} workers died one after the other without a result; the last: {why}; {_KEPT}"
            )

    def _judged(self) -> Iterator[_Task]:
        """Items that have taken `TRIES` workers with them; those whose nodes have died are tried again."""
        now = time.monotonic()
        due = [task for task in self._doubtful if now - task.since > NOTICED]
        for task in due:
            self._doubtful.remove(task)
            if sum(node in self._alive for node in task.fallen) < TRIES:
                self._again.append(task)
            else:
                yield task


_KEPT = "what is finished is kept, repeat the command to continue"
