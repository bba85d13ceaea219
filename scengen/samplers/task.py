"""A task: a scenario family and the distributions that it is tested on. One file each in conf/task/."""

import hashlib
import importlib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

from .. import html_tables
from ..assets.mesh_prop import MeshProp
from ..assets.ycb import Scan, Ycb, by_name
from ..errors import BadConfig, Infeasible, UnknownName, cut, nearest, place_of
from ..params import Parameter, Value, parameters, with_values
from ..scenario import Conditions, Refutation, Scenario
from ..sim.embodiment import EMBODIMENTS
from . import conditions, designs
from .axis import Axis, Proof
from .designs import Design, Independent
from .dists import Dist, Fixed, parse
from .split import ID, Part, Split
from .task_files import EMBODIMENT, paper_source

REQUIRED_KEYS = ("family", "code", "category", "instruction", "horizon", "id")
"""Keys that every task file has."""
MAX_HORIZON = 3600.0
"""Largest time limit of a task [s]: within the runtime of a certificate, and far beyond any task."""
OPTIONAL_KEYS = ("axes", "certify", "embodiment", "limits", "scans")
"""Keys that a task file may have."""


@dataclass(frozen=True)
class Proposal:
    """One try at an index, feasible or not."""

    attempt: int
    """Number of the try, from 0."""
    scenario: Scenario
    """Proposed scenario."""
    quantiles: Mapping[str, float]
    """Number in (0, 1) from the design for each parameter that varies."""
    refutation: Refutation | None
    """Reason why the scenario is infeasible, or None."""
    trained: Scenario | None
    """Training scenario of the same index; None in the training split."""


@dataclass(frozen=True, repr=False)
class Draw:
    """A scenario and its origin."""

    task: str
    """Name of the task."""
    split: Split
    """Split that it was drawn from."""
    seed: int
    """Seed of the run."""
    index: int
    """Index of the scenario in the split."""
    attempt: int
    """Number of the first feasible try."""
    scenario: Scenario
    """The scenario."""
    quantiles: Mapping[str, float]
    """Numbers from the design, see `Proposal`."""
    id_twin: str
    """Id of the training scenario with the same index. It differs only in the parameters of the split's axes."""
    shifted: Mapping[str, Value]
    """Values of the parameters that the split's axes name."""
    rejected: Mapping[str, int]
    """Number of earlier infeasible tries, by reason."""

    @property
    def _name(self) -> str:
        return f"{self.task}/{self.split}@{self.index}/{self.scenario.id}"

    def __repr__(self) -> str:
        changed = f": {html_tables.spoken(self.shifted)}" if self.shifted else ""
        return f"Draw({self._name}{changed})"

    def _repr_html_(self) -> str:
        """Its parameters that vary, in a notebook, those of the axes first."""
        every = {p.name: p for p in parameters(self.scenario)}
        varied = [every[name] for name in every if name in self.quantiles and name not in self.shifted]
        rows = [(p.name, p.nominal, p.unit, p.name in self.shifted) for p in map(every.get, self.shifted) if p]
        rows += [(p.name, p.nominal, p.unit, False) for p in varied]
        title = f"{self._name}, training twin {self.id_twin}"
        return html_tables.table(title, ("parameter", "value", "unit", "changed by the axis"), rows, len(rows))


@dataclass(frozen=True, repr=False)
class Task:
    """One benchmark task."""

    name: str
    """Name of the task, that of its file."""
    family: type[Scenario]
    """Scenario family."""
    code: str
    """Number in the paper, such as T17."""
    category: str
    """Kind of intuition that the task probes according to the paper: P1 to P7 or M."""
    instruction: str
    """Instruction for a policy."""
    horizon: float
    """Time limit [s]."""
    embodiment: str
    """Robot of the task, one of `EMBODIMENTS`."""
    training: Mapping[str, Dist]
    """ID distribution of every parameter. A parameter that the file does not list is constant at its nominal value."""
    axes: Mapping[str, Axis]
    """OOD axes by name."""
    certify: Mapping[str, Any]
    """Settings of the certificate that differ from conf/certify for this task."""
    node: Mapping[str, Any] = field(repr=False)
    """Contents of the task file, with measured limits and the changes of the command line."""
    scans: Mapping[str, Scan] = field(default_factory=dict, repr=False)
    """Solids that replace the proxies of YCB objects, by `Ycb.called`."""

    def __repr__(self) -> str:
        return f"Task({self.name} version {self.version}: {len(self.axes)} axes)"

    @property
    def version(self) -> int:
        """Version of the task, that of its family."""
        return self.family.VERSION

    def other_version(self, made: str, version: int | None) -> str:
        """A line about something that was made for another version of the task; empty if it was made for this one.

        Args:
            made: what happened to it, such as "trained on".
            version: version of the task for which it was made; None if it is unknown.
        """
        if version == self.version:
            return ""
        message = "an unknown version" if version is None else f"version {version}"
        return f"{made} {message} of {self.name}; installed: {self.version}"

    @cached_property
    def nominal(self) -> Scenario:
        """The family with its nominal parameters, and with scans instead of proxies."""
        found: Any = self.family()
        if not self.scans:
            return found
        return replace(found, **{name: replace(thing, scans=self.scans) for name, thing in things(self.family).items()})

    @cached_property
    def known(self) -> dict[str, Parameter]:
        """The family's parameters by name."""
        return {p.name: p for p in parameters(self.nominal)}

    def scenario(self, params: Mapping[str, Value], split: Split | str = ID) -> Scenario:
        """The scenario with these parameter values, such as those of a pool's row, under the conditions of a split."""
        return with_values(self.nominal, params).under(self.conditions(split))

    def conditions(self, split: Split | str) -> Conditions | None:
        """Conditions of control that a split names; None if it names none.

        Raises:
            BadConfig: a kind of conditions has no such level, or is named twice.
        """
        parts = [part for part in Split.parse(split).parts if self.is_condition(part)]
        for part in parts:
            conditions.check(part)
        if len({part.axis for part in parts}) < len(parts):
            raise BadConfig(f"split {split}: a kind of conditions is in it twice; give each once")
        return Conditions(tuple((p.axis, p.severity or 0) for p in parts), self.embodiment) if parts else None

    def is_condition(self, part: Part) -> bool:
        """Whether a part of a split is one of the conditions that every task has; an axis of that name comes first."""
        return part.axis in conditions.KINDS and part.axis not in self.axes

    def of_paper(self, axis: Axis) -> bool:
        """Whether an axis is the one that the paper's table of OOD conditions (App. I) has for this task."""
        return axis.source == paper_source(self.name, self.category)

    @cached_property
    def proofs(self) -> dict[str, list[Proof]]:
        """Proofs that each axis lies outside the training support.

        Raises:
            BadConfig: an axis does not.
        """
        return {name: self.prove(axis) for name, axis in self.axes.items()}

    def prove(self, axis: Axis) -> list[Proof]:
        """Proofs that an axis lies outside the training support.

        Raises:
            BadConfig: it does not.
        """
        return axis.prove(self.training, self.known, self.family.SYMMETRIES)

    def axis(self, part: Part | str) -> Axis:
        """The axis of that name, or with `name@3` its third severity.

        Raises:
            UnknownName: there is no such axis.
            BadConfig: it has no such severity, or that severity does not leave training.
        """
        part = Part.parse(part) if isinstance(part, str) else part
        if part.axis not in self.axes:
            unknown = UnknownName(f"split of {self.name}", part.axis, [ID, *self.axes, *conditions.KINDS])
            if "," in part.axis:
                raise BadConfig(f"{unknown}; give several on the command line: split={cut(part.axis)}")
            raise unknown
        axis = self.axes[part.axis]
        if part.severity is None:
            return axis
        severe = axis.at(part.severity, self.training, self.known)
        self.prove(severe)
        return severe

    def shifts(self, split: Split | str) -> dict[str, Dist]:
        """The distributions that a split replaces: none for `id` and conditions of control, else those of all its axes.

        Raises:
            UnknownName: there is no such axis.
            BadConfig: an axis or a kind of conditions has no such severity, two axes move the same parameter, or
                together they lead back into training.
        """
        split = Split.parse(split)
        if split in self._composed:
            return self._composed[split]
        self.conditions(split)
        shifted, axes = dict[str, Dist](), [part for part in split.parts if not self.is_condition(part)]
        for axis in map(self.axis, axes):
            if both := shifted.keys() & axis.replace.keys():
                raise BadConfig(
                    f"split {split}: two of its axes move {', '.join(sorted(both))}; compose axes that differ"
                )
            shifted.update(axis.replace)
        if len(axes) > 1:
            self.prove(Axis(str(split), "", "", shifted))
        return self._composed.setdefault(split, shifted)

    @cached_property
    def _composed(self) -> dict[Split, dict[str, Dist]]:
        """Replaced distributions of splits that are already proved."""
        return {}

    def design(self, spelled: str) -> Design:
        """The design of that spelling: `iid`, `sobol`, `lhs:50` or `grid:3`.

        Raises:
            BadConfig: there is no such design.
        """
        return designs.parse(spelled, self.name, self.training)

    def different(self, split: Split | str, sampler: str) -> tuple[int | None, str]:
        """Number of different scenarios of a split, and what limits it; None without a limit.

        Raises:
            ScengenError: there is no such split or no such design.
        """
        replaced, design = self.shifts(split), self.design(sampler)
        if design.size is not None:
            return design.size, f"sampler={sampler} has {design.size} different ones"
        constant = all(isinstance(dist, Fixed) for dist in {**self.training, **replaced}.values())
        return (1, f"all scenarios of split {split} are equal, because no parameter varies") if constant else (None, "")

    def draw(self, split: Split | str, seed: int, index: int, design: Design | None = None) -> Draw:
        """Draw scenario `index` of a split. It depends on (task, parameter, seed, index, attempt) and nothing else.

        Every parameter has its own random stream. A split starts from the training scenario of the same index and draws
        only the parameters that its axes name. Scenario 7 of `diagonal` is therefore scenario 7 of `id`, turned.

        Args:
            split: the split or its spelling.
            seed: seed of the run.
            index: index of the scenario, from 0.
            design: source of the numbers; by default independent draws.

        Raises:
            Infeasible: no try gave a feasible scenario.
        """
        split = Split.parse(split)
        *failed, last = self.proposals(split, seed, index, design)
        rejected = Counter(p.refutation.reason for p in failed if p.refutation)
        if last.refutation:
            rejected[last.refutation.reason] += 1
            raise Infeasible(f"{self.name}/{split}/{index}", rejected.total(), rejected)
        scenario, shifts = last.scenario, self.shifts(split)
        shifted = {p.name: p.nominal for p in parameters(scenario) if p.name in shifts}
        twin = (last.trained or scenario).id
        return Draw(self.name, split, seed, index, last.attempt, scenario, last.quantiles, twin, shifted, rejected)

    def proposals(self, split: Split | str, seed: int, index: int, design: Design | None = None) -> Iterator[Proposal]:
        """Yield every try at an index. The last one is feasible, if any is.

        Raises:
            Infeasible: the index has no training scenario for an axis to start from.
        """
        split, design = Split.parse(split), design or Independent(self.name)
        if split.is_training:
            yield from self._tries(self.training, None, {}, seed, index, design)
        else:
            shifts, trained = self.shifts(split), self.draw(ID, seed, index, design)
            kept = {name: u for name, u in trained.quantiles.items() if name not in shifts}
            posed = self.conditions(split)
            for tried in self._tries(shifts, trained.scenario, kept, seed, index, design):
                yield replace(tried, scenario=tried.scenario.under(posed)) if posed else tried

    def _tries(
        self,
        space: Mapping[str, Dist],
        trained: Scenario | None,
        kept: Mapping[str, float],
        seed: int,
        index: int,
        design: Design,
    ) -> Iterator[Proposal]:
        """Yield tries at an index until one is feasible."""
        start, varied = trained or self.nominal, [n for n, d in space.items() if not isinstance(d, Fixed)]
        for attempt in range(design.tries if varied else 1):  # if nothing varies, all tries are the same
            quantiles = {name: design.number(name, seed, index, attempt) for name in varied}
            scenario = with_values(start, {n: d.quantile(quantiles.get(n, 0.5)) for n, d in space.items()})
            refutation = scenario.infeasible()
            yield Proposal(attempt, scenario, {**kept, **quantiles}, refutation, trained)
            if refutation is None:
                return


def load(name: str, node: Mapping[str, Any]) -> Task:
    """Build a task from its file, and check the file against the scenario class and itself.

    Raises:
        ScengenError: something in the file is unknown, mistyped, out of bounds, or not outside training.
    """
    _check_keys(f"task {name}", node, REQUIRED_KEYS, OPTIONAL_KEYS)
    family = _family(name, node["family"])
    known = {p.name: p for p in parameters(family())}
    training: dict[str, Dist] = {n: Fixed(p.nominal) for n, p in known.items()}
    training.update(_space(f"{name}.id", _group(f"{name}.id", node["id"]), known))
    for symmetry in family.SYMMETRIES:
        symmetry.check(known)
    axes, limits = {}, _group(f"{name}.limits", node.get("limits"))
    for axis, inner in _group(f"{name}.axes", node.get("axes")).items():
        where = f"{name}.axes.{axis}"
        if axis == ID or not str(axis).isidentifier():
            raise BadConfig(f"{where}: {axis!r} cannot name an axis; use letters, digits and _, and not {ID!r}")
        if not isinstance(inner, Mapping):
            raise BadConfig(f"{where} = {inner!r}; expected why, source and replace")
        _check_keys(where, inner, ("replace",), ("why", "source", "severities"))
        if not isinstance(inner["replace"], Mapping):
            raise BadConfig(f"{where}.replace = {inner['replace']!r}; expected parameters and their distributions")
        axes[axis] = Axis(
            axis,
            inner.get("why", ""),
            inner.get("source", ""),
            _space(f"{where}.replace", inner["replace"], known),
            _severities(where, inner.get("severities", 0)),
            _limits(name, axis, inner["replace"], limits.get(axis, {}), known),
        )
    task = Task(
        name,
        family,
        str(node["code"]),
        str(node["category"]),
        str(node["instruction"]),
        _positive(f"{name}.horizon", node["horizon"]),
        _embodiment(name, node.get("embodiment", EMBODIMENT)),
        training,
        axes,
        _group(f"{name}.certify", node.get("certify")),
        node,
        _scans(name, family, _group(f"{name}.scans", node.get("scans"))),
    )
    _ = task.proofs
    for axis in task.axes.values():
        if not axis.limits:  # limits may have been measured with other distributions; those axes are checked on use
            for severity in range(1, axis.severities + 1):
                task.axis(Part(axis.name, severity))
    return task


def things(family: type[Scenario]) -> dict[str, Ycb]:
    """YCB objects of a family, by field."""
    found: Any = family()
    every = {field.name: getattr(found, field.name) for field in fields(found)}
    return {name: value for name, value in every.items() if isinstance(value, Ycb)}


def _scans(name: str, family: type[Scenario], node: Mapping[str, Any]) -> dict[str, Scan]:
    """Scans of a task: each with the file that it was made of, and the solid itself.

    Raises:
        BadConfig: the family has no YCB object, or a scan is not a solid.
    """
    if node and not things(family):
        raise BadConfig(f"{name}.scans: {family.__name__} has no YCB object; leave them out")
    every, found = by_name(), {}
    for called, entry in node.items():
        where = f"{name}.scans.{cut(str(called))}"
        if called not in every:
            raise UnknownName(f"scan of {name}", cut(str(called)), every)
        _check_keys(where, _group(where, entry), ("file", "sha256", "settings", "solid"), ())
        try:
            prop = MeshProp.read(entry["solid"])
        except (ValueError, TypeError) as error:
            raise BadConfig(f"{where}.solid is not a solid: {cut(str(error))}") from None
        text = json.dumps(entry["solid"], sort_keys=True)
        sha256 = hashlib.sha256(text.encode()).hexdigest()
        found[called] = Scan(sha256, replace(prop, rgba=getattr(every[called].prop, "rgba", prop.rgba)))
    return found


def _family(name: str, path: Any) -> type[Scenario]:
    """Scenario class of a dotted path."""
    if not isinstance(path, str) or not re.fullmatch(r"\w+(\.\w+)+", path):
        raise BadConfig(f"{name}.family = {cut(repr(path))}; expected package.module.Class")
    module, _, inner = path.rpartition(".")
    try:
        found = importlib.import_module(module)
    except Exception as error:
        why = f"{type(error).__name__}: {cut(' '.join(str(error).split()))}"
        if isinstance(error, ModuleNotFoundError) and error.name == module.partition(".")[0]:
            why += "; install the package, as with pip install --editable FOLDER"
        elif place := place_of(error):
            why += f", {place}"
        raise BadConfig(f"{name}.family = {cut(repr(path))} cannot be imported ({why})") from None
    classes = [each for each, what in vars(found).items() if isinstance(what, type) and issubclass(what, Scenario)]
    if (family := getattr(found, inner, None)) is None:
        raise UnknownName(f"class in {module} ({name}.family)", inner, classes)
    if not (isinstance(family, type) and issubclass(family, Scenario)):
        raise BadConfig(f"{name}.family = {cut(repr(path))} is not a Scenario")
    version: object = family.VERSION
    if type(version) is not int or version < 1:
        raise BadConfig(f"{path}.VERSION = {cut(repr(version))}; it must be a whole number, 1 or more")
    return family


def _group(where: str, node: Any) -> Mapping[str, Any]:
    """A group of settings; an empty one if nothing is given."""
    if node is not None and not isinstance(node, Mapping):
        raise BadConfig(f"{where} = {cut(repr(node))}; expected a group of settings, {{name: value}}")
    return node or {}


def _check_keys(where: str, node: Mapping[str, Any], required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    """Raise for an unknown or missing key."""
    for key in node:
        if key not in required + optional:
            raise UnknownName(f"key of {where}", str(key), required + optional)
    if missing := [key for key in required if key not in node]:
        raise BadConfig(f"{where} lacks {', '.join(missing)}; give it")


def leaves(nodes: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Flatten `{tile: {mass: [uniform, ..]}}` to `tile.mass, [uniform, ..]`."""
    for key, node in nodes.items():
        if isinstance(node, Mapping):
            yield from leaves(node, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", node


def _space(where: str, nodes: Mapping[str, Any], known: Mapping[str, Parameter]) -> dict[str, Dist]:
    """Distributions of a group of parameters."""
    space: dict[str, Dist] = {}
    for name, node in leaves(nodes):
        if name not in known:
            raise UnknownName(f"parameter in {where}", name, known)
        dist = parse(f"{where}.{name}", node)
        for end in {v for i in dist.support for v in (i.low, i.high)}:
            known[name].check(f"{where}.{name}", end)
        space[name] = dist
    return space


def _severities(where: str, count: Any) -> int:
    """Number of severities of an axis."""
    if isinstance(count, bool) or not isinstance(count, int) or count < 0:
        raise BadConfig(f"{where}.severities = {count!r}; it must be a whole number, 0 for none")
    return count


def _limits(
    task: str, axis: str, replaced: Mapping[str, Any], nodes: Any, known: Mapping[str, Parameter]
) -> dict[str, float]:
    """Measured limits of the parameters of one axis, from conf/limits/<task>.yaml.

    Limits of other parameters are ignored: a command line may change or drop axes that were measured.
    """
    where, names = f"{task}.limits.{axis}", dict(leaves(replaced))
    if not isinstance(nodes, Mapping):
        raise BadConfig(f"{where} = {nodes!r}; expected parameters and where the oracle fails")
    limits = {name: value for name, value in leaves(nodes) if name in names}
    for name, value in limits.items():
        known[name].check(f"{where}.{name}", value)
    return limits


def _positive(where: str, value: Any) -> float:
    """A positive number of seconds."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value <= MAX_HORIZON:
        shown = cut(repr(value))
        raise BadConfig(f"{where} = {shown}; it must be a positive number of seconds, at most {MAX_HORIZON:g}")
    return float(value)


def _embodiment(name: str, value: Any) -> str:
    """Name of a robot."""
    if not isinstance(value, str) or value not in EMBODIMENTS:
        close, known = nearest(str(value), EMBODIMENTS), ", ".join(EMBODIMENTS)
        raise BadConfig(f"{name}.embodiment = {cut(repr(value))}{close}; known: {known}")
    return value
