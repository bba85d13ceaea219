"""Nodes of a Ray cluster: which are alive, and which round like this machine and run the same code."""

import hashlib
import logging
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import ScengenError, cut
from ..installation import versions
from ..samplers.task_files import conf_dir
from .fingerprint import fingerprint
from .printed import printable

START_LIMIT = 120.0
"""Time in which a node must describe itself, and in which one worker of the cluster must be ready [s]."""

log = logging.getLogger("scengen.cluster")


class ClusterError(ScengenError):
    """A cluster cannot be reached, or no work that it is given comes back."""


def about(function: bytes) -> dict[str, str]:
    """Description of a machine by what must be equal on all nodes: versions, fingerprint, code.

    Args:
        function: the pickled function of the run.

    Raises:
        Exception: a module of the function is not installed here.
    """
    pickle.loads(function)
    return {**versions(), "fingerprint": fingerprint(), "code": code_sha256()}


@cache
def code_sha256() -> str:
    """Hash of the Python and configuration files of scengen: the same in a checkout and in an installation.

    Certificates hold the hash of one family; a node may run other code, too, such as the adversary.
    """
    parts = []
    for root, pattern in ((Path(__file__).parents[1], "*.py"), (conf_dir(), "*.yaml")):
        names = {path.relative_to(root): path for path in root.rglob(pattern)}
        beside = ("conf", "task_template")  # folders that are in an installed package, and next to it in a checkout
        shipped = (name for name in names if name.parts[0] not in beside)
        parts += [f"{name} {hashlib.sha256(names[name].read_bytes()).hexdigest()}" for name in sorted(shipped)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def on_node(remote: Any, node: str) -> Callable[..., Any]:
    """The call that starts a remote function or actor on one node only."""
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    return remote.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=False)).remote


def one_line(error: BaseException) -> str:
    """The text of an error as one line."""
    return printable(" ".join(str(error).split()))


@dataclass
class Node:
    """A node of the cluster."""

    name: str
    """Host name and beginning of the id, for messages."""
    cores: int
    """Number of its cores."""
    deadline: float
    """Time at which it must have described itself [s]."""


class Nodes:
    """The nodes of a cluster during one run. A node is used if it describes itself like this machine."""

    def __init__(self, ray: ModuleType, function: bytes, reference: Any, announced: set[str]):
        """
        Args:
            function: the pickled function of the run.
            reference: Ray's reference to it.
            announced: messages about refused nodes that have been logged; new ones are added.
        """
        self._ray, self._reference, self._announced = ray, reference, announced
        self._own, self._about = about(function), ray.remote(num_cpus=0, max_retries=0)(about)
        self.alive: set[str] = set()
        """Ids of all nodes that are alive."""
        self.usable: dict[str, Node] = {}
        """Nodes that are used, by id."""
        self._refused: dict[str, str] = {}
        """Messages about nodes that are not used, by id."""
        self.asked: dict[Any, tuple[str, Node]] = {}
        """Ids and nodes that have not described themselves yet, by Ray's reference to the answer."""

    def update(self, now: float) -> None:
        """Remove nodes that are gone, ask new ones to describe themselves, and refuse those that do not answer."""
        listed = {node["NodeID"]: node for node in self._ray.nodes() if node["Alive"]}
        self.alive = set(listed)
        for id_ in self.usable.keys() - self.alive:
            log.warning("scengen: %s is lost; its work is repeated elsewhere", self.usable.pop(id_).name)
        known = {*self.usable, *self._refused, *(id_ for id_, _ in self.asked.values())}
        for id_ in self.alive - known:
            if cores := int(listed[id_]["Resources"].get("CPU", 0)):
                name = printable(f"node {listed[id_]['NodeManagerHostname']} ({id_[:8]})")
                answer = on_node(self._about, id_)(self._reference)
                self.asked[answer] = id_, Node(name, cores, now + START_LIMIT)
        for answer in [answer for answer, (_, node) in self.asked.items() if node.deadline < now]:
            self._refuse(*self.asked.pop(answer), f"it did not describe itself within {START_LIMIT:g} s")

    def answer(self, reference: Any) -> str | None:
        """Use or refuse a node that has described itself.

        Returns:
            Why it died before it could; None if it did not. A node that is alive is asked again.
        """
        id_, node = self.asked.pop(reference)
        try:
            found = self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            self._refuse(id_, node, printable(cut(str(error).strip().splitlines()[-1])))
            return None
        except self._ray.exceptions.RayError as error:
            return cut(one_line(error))
        differences = [
            f"{name} {found[name][:20]} instead of {own[:20]}" for name, own in self._own.items() if found[name] != own
        ]
        if differences:
            self._refuse(id_, node, ", ".join(differences))
        else:
            self.usable[id_] = node
        return None

    def check(self) -> None:
        """Raise `ClusterError` if all nodes are refused."""
        if self._refused and not (self.usable or self.asked):
            raise ClusterError(f"no node of the cluster can be used; {'; '.join(sorted(self._refused.values()))}")

    def _refuse(self, id_: str, node: Node, why: str) -> None:
        message = self._refused[id_] = f"{node.name} is not used: {why}"
        if message not in self._announced:
            self._announced.add(message)
            log.warning("scengen: %s", message)
