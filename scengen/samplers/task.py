"""Task: a scenario family plus the distributions that we test it on. One file each in conf/task/."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from hydra.utils import get_class

from ..errors import BadConfig, Infeasible, UnknownName, nearest
from ..ood.axis import Axis, Proof
from ..params import Parameter, Value, parameters, with_values
from ..scenario import Scenario
from ..sim.world import EMBODIMENTS, JAW
from .dists import Dist, Fixed, parse
from .keyed import unit

ID = "id"
"""Name of the split that policies train on."""
TRIES = 100
"""Draws of one index before the distribution is called infeasible."""
REQUIRED = ("family", "code", "category", "instruction", "horizon", "id")
OPTIONAL = ("axes", "certify", "embodiment")


@dataclass(frozen=True)
class Draw:
    """A scenario and where it came from."""

    task: str
    split: str
    seed: int
    index: int
    attempt: int
    """Which try was the first feasible one."""
    scenario: Scenario
    twin: str
    """Id of the training scenario with the same index: it differs in the parameters of the split's axes only."""
    moved: Mapping[str, Value]
    """Values of the parameters that the split's axes name."""
    rejected: Mapping[str, int]
    """How many earlier tries were infeasible, by reason."""


@dataclass(frozen=True)
class Task:
    """One benchmark task."""

    name: str
    family: type[Scenario]
    code: str
    """Number in the paper, e.g. T17."""
    category: str
    """P1 to P7 or M: the kind of intuition that the paper says it probes."""
    instruction: str
    horizon: float
    """Time limit [s]."""
    embodiment: str
    training: Mapping[str, Dist]
    """ID distribution of every parameter; what the file does not list is constant at its nominal value."""
    axes: Mapping[str, Axis]
    certify: Mapping[str, Any]
    """Settings of the certificate that differ from conf/certify for this task."""

    @cached_property
    def known(self) -> dict[str, Parameter]:
        """The family's parameters by name."""
        return {p.name: p for p in parameters(self.family())}

    @cached_property
    def proofs(self) -> dict[str, list[Proof]]:
        """Why each axis lies outside the training support.

        Raises:
            BadConfig: one does not.
        """
        return {name: axis.prove(self.training, self.known) for name, axis in self.axes.items()}

    def moves(self, split: str) -> dict[str, Dist]:
        """The distributions that a split replaces: none for `id`, those of all axes for `a+b`.

        Raises:
            UnknownName: there is no such axis.
            BadConfig: two of its axes move the same parameter.
        """
        moved: dict[str, Dist] = {}
        for name in [] if split == ID else split.split("+"):
            if name not in self.axes:
                raise UnknownName(f"split of {self.name}", name, [ID, *self.axes])
            if both := moved.keys() & self.axes[name].replace.keys():
                raise BadConfig(
                    f"split {split}: two of its axes move {', '.join(sorted(both))}; compose axes that differ"
                )
            moved.update(self.axes[name].replace)
        return moved

    def draw(self, split: str, seed: int, index: int) -> Draw:
        """Scenario `index` of a split. It depends on (task, parameter, seed, index, attempt) and nothing else.

        Every parameter has its own random stream. A split starts from the training scenario of the same index and
        draws only what its axes name, so that scenario 7 of `diagonal` is scenario 7 of `id`, turned.

        Raises:
            Infeasible: no try gave a feasible scenario.
        """
        attempt, trained, rejected = self._first_feasible(ID, self.training, self.family(), seed, index)
        if moves := self.moves(split):
            attempt, scenario, rejected = self._first_feasible(split, moves, trained, seed, index)
        else:
            scenario = trained
        moved = {p.name: p.nominal for p in parameters(scenario) if p.name in moves}
        return Draw(self.name, split, seed, index, attempt, scenario, trained.id, moved, rejected)

    def _first_feasible(
        self, split: str, space: Mapping[str, Dist], start: Scenario, seed: int, index: int
    ) -> tuple[int, Scenario, Counter[str]]:
        rejected: Counter[str] = Counter()
        for attempt in range(TRIES):
            values = {n: d.quantile(unit(self.name, n, seed, index, attempt)) for n, d in space.items()}
            scenario = with_values(start, values)
            refutation = scenario.infeasible()
            if refutation is None:
                return attempt, scenario, rejected
            rejected[refutation.reason] += 1
            if all(isinstance(d, Fixed) for d in space.values()):
                break  # every further try would be the same scenario
        raise Infeasible(f"{self.name}/{split}/{index}", sum(rejected.values()), rejected)


def load(name: str, node: Mapping[str, Any]) -> Task:
    """Build a task from its file, and check the file against the scenario class and itself.

    Raises:
        ScengenError: something in the file is unknown, mistyped, out of bounds, or not outside training.
    """
    _check_keys(f"task {name}", node, REQUIRED, OPTIONAL)
    family = _family(name, node["family"])
    known = {p.name: p for p in parameters(family())}
    training: dict[str, Dist] = {n: Fixed(p.nominal) for n, p in known.items()}
    training.update(_space(f"{name}.id", node["id"] or {}, known))
    axes = {}
    for axis, inner in (node.get("axes") or {}).items():
        where = f"{name}.axes.{axis}"
        if axis == ID or not str(axis).isidentifier():
            raise BadConfig(f"{where}: {axis!r} cannot name an axis; use letters, digits and _, and not {ID!r}")
        if not isinstance(inner, Mapping):
            raise BadConfig(f"{where} = {inner!r}; expected why, source and replace")
        _check_keys(where, inner, ("replace",), ("why", "source"))
        if not isinstance(inner["replace"], Mapping):
            raise BadConfig(f"{where}.replace = {inner['replace']!r}; expected parameters and their distributions")
        axes[axis] = Axis(
            axis,
            inner.get("why", ""),
            inner.get("source", ""),
            _space(f"{where}.replace", inner["replace"], known),
        )
    task = Task(
        name,
        family,
        str(node["code"]),
        str(node["category"]),
        str(node["instruction"]),
        _positive(f"{name}.horizon", node["horizon"]),
        _embodiment(name, node.get("embodiment", JAW)),
        training,
        axes,
        node.get("certify") or {},
    )
    _ = task.proofs
    return task


def _family(name: str, path: str) -> type[Scenario]:
    try:
        family = get_class(path)
    except Exception as error:
        raise BadConfig(f"{name}.family = {path!r} cannot be imported: {' '.join(str(error).split())}") from None
    if not issubclass(family, Scenario):
        raise BadConfig(f"{name}.family = {path!r} is no Scenario")
    return family


def _check_keys(where: str, node: Mapping[str, Any], required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    for key in node:
        if key not in required + optional:
            raise UnknownName(f"key of {where}", str(key), required + optional)
    if missing := [key for key in required if key not in node]:
        raise BadConfig(f"{where} lacks {', '.join(missing)}")


def _leaves(nodes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Flatten `{tile: {mass: [uniform, ..]}}` to `tile.mass, [uniform, ..]`."""
    for key, node in nodes.items():
        if isinstance(node, Mapping):
            yield from _leaves(node, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", node


def _space(where: str, nodes: Mapping[str, Any], known: Mapping[str, Parameter]) -> dict[str, Dist]:
    space: dict[str, Dist] = {}
    for name, node in _leaves(nodes):
        if name not in known:
            raise UnknownName(f"parameter in {where}", name, known)
        dist = parse(f"{where}.{name}", node)
        for end in {v for i in dist.support for v in (i.low, i.high)}:
            known[name].check(f"{where}.{name}", end)
        space[name] = dist
    return space


def _positive(where: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0:
        raise BadConfig(f"{where} = {value!r}; it must be a positive number of seconds")
    return float(value)


def _embodiment(name: str, value: str) -> str:
    if value not in EMBODIMENTS:
        raise BadConfig(f"{name}.embodiment = {value!r}{nearest(value, EMBODIMENTS)}; known: {', '.join(EMBODIMENTS)}")
    return value
