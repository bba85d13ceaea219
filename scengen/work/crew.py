"""One run on a Ray cluster: items go to workers on its nodes, and results come back as they are ready.

Ray transports items and results. A lost item is repeated here and not by Ray, so that no item is worked on twice
unnoticed. Each worker is an actor that holds one core. It hands its items to a process with limits, as on a single
machine (`scengen.work.parallel`).
"""

import pickle
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, TypeVar

from ..errors import cut
from .nodes import START_LIMIT, ClusterError, Nodes, on_node, one_line
from .parallel import Limits, each, made_of_lost, portable

A = TypeVar("A")
B = TypeVar("B")

LOOK_INTERVAL = 1.0
"""Interval at which nodes and workers are checked [s]."""
NODE_DEATH_DELAY = 30.0
"""Time after which Ray has noticed that a node is gone [s]: it takes 10 to 25 s (5 missed checks, 3 s apart)."""
MAX_CRASHES = 2
"""Worker crashes after which an item is given up; deaths of whole nodes do not count."""
MAX_DEATHS = 3
"""Deaths without a result in between, per worker, after which a run is given up."""
MAX_SLOWDOWN = 10.0
"""Ratio of wall-clock time to processor time on a busy node beyond which a worker hangs."""
KEPT = "finished work is kept; repeat the command to continue"
"""Remedy after an error in the middle of a run."""


class Seat:
    """Actor of Ray on one core of a node: a worker."""

    def __init__(self) -> None:
        self._item: Any = None
        self._replies: Iterator[bytes]

    def begin(self, function: bytes, limits: Limits | None) -> None:
        """Prepare for items."""
        # Not by fork: the process of an actor has threads of Ray.
        self._replies = each(_Pickling(pickle.loads(function)), iter(lambda: self._item, _END), 1, limits, _lost, False)

    def run(self, item: bytes) -> bytes:
        """Work on an item.

        Returns:
            Pickled reply: the result of the function, the reason why the item is lost, or an error.
        """
        self._item = pickle.loads(item)
        try:
            return next(self._replies)
        except Exception as error:
            return portable(error)


_END = object()
"""Sentinel that is equal to no item."""


@dataclass(frozen=True)
class _Pickling:
    """A function whose results are replies."""

    function: Callable[[Any], Any]

    def __call__(self, item: Any) -> bytes:
        return pickle.dumps(("result", self.function(item)))


def _lost(item: Any, reason: str) -> bytes:
    return pickle.dumps(("lost", reason))


# --- items ------------------------------------------------------------------------------------


@dataclass
class _Job:
    """An item that has been given to a worker."""

    item: Any
    crashed_on: list[str] = field(default_factory=list)
    """Nodes on which a worker died while it worked on the item."""
    crashed_at: float = 0.0
    """Time of the last of these deaths [s]."""


class _Jobs:
    """The items of a run that are not finished: new ones, and those whose worker died."""

    def __init__(self, items: Iterator[Any]):
        self._items = items
        self._more = True
        """Whether there may be new items."""
        self._again: deque[_Job] = deque()
        """Items to repeat."""
        self._doubtful: list[_Job] = []
        """Items with `MAX_CRASHES` dead workers, until it is known whether their nodes have died."""

    @property
    def waiting(self) -> bool:
        """Whether there may be an item for a worker now."""
        return self._more or bool(self._again)

    @property
    def unfinished(self) -> bool:
        """Whether there may be an item for a worker now or later."""
        return self.waiting or bool(self._doubtful)

    def next(self) -> _Job | None:
        """The next item for a worker: one to repeat, or a new one; None if there is none."""
        if self._again:
            return self._again.popleft()
        if self._more and (item := next(self._items, _END)) is not _END:
            return _Job(item)
        self._more = False
        return None

    def crashed(self, job: _Job, node: str) -> None:
        """Repeat an item whose worker died, unless it may be the cause."""
        job.crashed_on.append(node)
        job.crashed_at = time.monotonic()
        (self._again if len(job.crashed_on) < MAX_CRASHES else self._doubtful).append(job)

    def given_up(self, alive: set[str]) -> Iterator[_Job]:
        """Items that crashed `MAX_CRASHES` workers on nodes that are alive. The other doubtful ones are repeated."""
        now = time.monotonic()
        for job in [job for job in self._doubtful if now - job.crashed_at > NODE_DEATH_DELAY]:
            self._doubtful.remove(job)
            if sum(node in alive for node in job.crashed_on) < MAX_CRASHES:
                self._again.append(job)
            else:
                yield job


# --- workers ----------------------------------------------------------------------------------


@dataclass
class _Worker:
    """A worker on a node."""

    actor: Any
    node: str
    job: _Job | None = None
    """Item that it works on; None while it starts or is idle."""
    deadline: float = float("inf")
    """Time at which it must have answered [s]."""


class _WorkerLost(Exception):
    """A worker has died before it answered."""

    def __init__(self, worker: _Worker, why: str):
        super().__init__(why)
        self.worker = worker


class _Workers:
    """The workers of a run: starts them, gives them items, and takes their answers."""

    def __init__(self, ray: ModuleType, function: Any, limits: Limits | None):
        """
        Args:
            function: Ray's reference to the pickled function of the run.
        """
        self._ray, self._function, self._limits = ray, function, limits
        self._seat = ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(Seat)
        self.pending: dict[Any, _Worker] = {}
        """Workers that start or work, by Ray's reference to their answer."""
        self.idle: list[_Worker] = []
        """Workers without an item."""

    def __len__(self) -> int:
        return len(self.pending) + len(self.idle)

    @property
    def working(self) -> list[_Worker]:
        """Workers with an item."""
        return [worker for worker in self.pending.values() if worker.job]

    @property
    def ready(self) -> list[_Worker]:
        """Workers that have started."""
        return [*self.idle, *self.working]

    def start(self, nodes: Nodes, count: int | None) -> None:
        """Start workers, each on the node with most free cores, until the requested number is reached.

        Args:
            count: number of workers; None for one on each core.
        """
        taken = Counter(worker.node for worker in [*self.pending.values(), *self.idle])
        free = {id_: node.cores - taken[id_] for id_, node in nodes.usable.items()}
        missing = sum(free.values())
        if count is not None:
            missing = min(missing, count - taken.total())
        for _ in range(missing):
            id_ = max(free, key=free.__getitem__)
            free[id_] -= 1
            worker = _Worker(on_node(self._seat, id_)(), id_)
            self.pending[worker.actor.begin.remote(self._function, self._limits)] = worker

    def give(self, job: _Job) -> None:
        """Give an item to an idle worker."""
        worker = self.idle.pop()
        worker.job = job
        if self._limits:  # it may try twice, and may have to start a process before
            worker.deadline = time.monotonic() + 2 * MAX_SLOWDOWN * self._limits.seconds + START_LIMIT
        self.pending[worker.actor.run.remote(pickle.dumps(job.item))] = worker

    def take(self, reference: Any) -> tuple[_Job | None, Any]:
        """Take the answer of a worker, which is idle after it.

        Returns:
            Item and reply of the worker; None if it has just started.

        Raises:
            _WorkerLost: it has died.
            Exception: the function cannot be run at all.
        """
        worker = self.pending.pop(reference)
        try:
            reply = self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            raise _WorkerLost(worker, cut(one_line(error))) from None
        job, worker.job, worker.deadline = worker.job, None, float("inf")
        self.idle.append(worker)
        return job, reply

    def postpone(self, seconds: float) -> None:
        """Give all workers more time, because this process was suspended and could not take their answers."""
        for worker in self.pending.values():
            worker.deadline += seconds

    def overdue(self, now: float) -> list[_Worker]:
        """Remove the workers that have not answered in time."""
        return [self.pending.pop(r) for r in [r for r, worker in self.pending.items() if worker.deadline < now]]

    def kill(self, worker: _Worker) -> None:
        """End a worker, in the middle of its work if need be."""
        self._ray.kill(worker.actor)

    def end(self) -> None:
        """End all workers, in the middle of their work if need be."""
        for worker in [*self.pending.values(), *self.idle]:
            self.kill(worker)


# --- the run ----------------------------------------------------------------------------------


class Crew:
    """One run: gives items to workers, yields results, and replaces workers that die."""

    def __init__(
        self,
        ray: ModuleType,
        function: bytes,
        limits: Limits | None,
        count: int | None,
        announced: set[str],
        report: Callable[[str], None],
    ):
        """
        Args:
            function: the pickled function.
            count: number of workers; None for one on each core.
            announced: see `Nodes`.
            report: called with the number of nodes and workers, as text.
        """
        self._ray, self._count, self._report = ray, count, report
        reference = ray.put(function)
        self._nodes = Nodes(ray, function, reference, announced)
        self._workers = _Workers(ray, reference, limits)
        self._deaths = 0
        """Deaths since the last result."""
        self._last_look = float("-inf")
        """Time of the last check of nodes and workers [s]."""
        self._last_ready = time.monotonic()
        """Time at which a worker was last ready [s]."""

    def work(self, items: Iterator[A], lost: Callable[[A, str], B] | None) -> Iterator[B]:
        """Results of all items as they are ready.

        Raises:
            ClusterError: no node can be used, or workers die one after the other without a result.
            WorkerDied: an item is lost, and there is no `lost`.
        """
        jobs = _Jobs(items)
        while True:
            self._look(jobs)
            while self._workers.idle and (job := jobs.next()):
                self._workers.give(job)
            if not (jobs.unfinished or self._workers.working):
                return
            for reference in self._answers():
                if reference in self._nodes.asked:
                    if (why := self._nodes.answer(reference)) is not None:
                        self._count_death(why)
                elif reply := self._reply(reference, jobs):
                    kind, value, item = reply
                    if kind == "error":
                        raise value
                    yield value if kind == "result" else made_of_lost(item, value, lost)
            for job in jobs.given_up(self._nodes.alive):
                yield made_of_lost(job.item, f"died: it took {MAX_CRASHES} workers with it", lost)

    def end(self) -> None:
        """End all workers, in the middle of their work if need be."""
        self._workers.end()

    def _answers(self) -> list[Any]:
        """References to answers that have come. Without any, they are awaited until the next check."""
        if not (awaited := [*self._workers.pending, *self._nodes.asked]):
            time.sleep(LOOK_INTERVAL)
            return []
        ready, rest = self._ray.wait(awaited, timeout=LOOK_INTERVAL)
        return ready + self._ray.wait(rest, num_returns=len(rest), timeout=0)[0] if rest else ready

    def _look(self, jobs: _Jobs) -> None:
        """Find nodes that have come or gone, end workers that hang, and start missing ones."""
        now = time.monotonic()
        if (passed := now - self._last_look) < LOOK_INTERVAL:
            return
        if LOOK_INTERVAL + NODE_DEATH_DELAY < passed < float("inf"):
            self._workers.postpone(passed)
            self._last_ready += passed
        self._last_look = now
        self._nodes.update(now)
        for worker in self._workers.overdue(now):
            self._replace(worker, jobs, "it gave no sign of life")
        if jobs.waiting and not self._nodes.asked:  # otherwise the first node to answer would get all workers
            self._workers.start(self._nodes, self._count)
        self._check(now)

    def _check(self, now: float) -> None:
        """Report the number of nodes and workers, and give up if there are none.

        Raises:
            ClusterError: no node can be used, or no worker starts.
        """
        ready = self._workers.ready
        counts = {"node": len({worker.node for worker in ready}), "worker": len(ready)}
        self._report(", ".join(f"{n} {what}{'s' * (n != 1)}" for what, n in counts.items()))
        if ready:
            self._last_ready = now
        self._nodes.check()
        if now - self._last_ready > START_LIMIT:
            why = "other work takes all cores, see ray status" if self._nodes.usable else "it has no node with cores"
            raise ClusterError(f"the cluster has started no worker in {START_LIMIT:g} s: {why}; {KEPT}")

    def _reply(self, reference: Any, jobs: _Jobs) -> tuple[str, Any, Any] | None:
        """Kind and value of a reply, and its item; None if the worker has just started, or has died."""
        try:
            job, reply = self._workers.take(reference)
        except _WorkerLost as lost:
            self._replace(lost.worker, jobs, str(lost))
            return None
        if job is None:
            return None
        self._deaths = 0
        return (*pickle.loads(reply), job.item)

    def _replace(self, worker: _Worker, jobs: _Jobs, why: str) -> None:
        """End a worker that has died or hangs, and repeat its item."""
        self._workers.kill(worker)
        if worker.job:
            jobs.crashed(worker.job, worker.node)
        self._count_death(why)

    def _count_death(self, why: str) -> None:
        """Count the death of a worker or node.

        Raises:
            ClusterError: there were too many since the last result.
        """
        self._deaths += 1
        if self._deaths > MAX_DEATHS * max(len(self._workers), MAX_CRASHES):
            raise ClusterError(f"{self._deaths} workers died in a row without a result; the last: {why}; {KEPT}")
