"""Rows of the shards: scenarios of a pool, and demonstrations. A new column is a new field of a class of rows."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Annotated, Any, Self, get_args, get_type_hints

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .. import html_tables
from ..certificate import StoredCertificate
from ..control.loop import ACTION
from ..params import Value
from . import columns
from .columns import ID, matching, text
from .names import Name
from .untrusted import HASH, MAX_TEXT, SHORT_HASH, WORD

NO_WITNESS: NDArray[np.float32] = np.zeros((0, ACTION), np.float32)
"""Witness of a row that was read without its witness."""


@dataclass(frozen=True, kw_only=True, repr=False)
class SceneRow:
    """Columns of every row: a scenario with recorded actions.

    Each field is a column: its type says how Arrow stores the column, and the function next to the type reads it.
    """

    id: Annotated[str, matching(ID)]
    task: Annotated[str, matching(WORD)]
    code: Annotated[str, text(100)]
    """Number of the task in the paper."""
    category: Annotated[str, text(100)]
    split: Annotated[str, text(1000)]
    axes: Annotated[tuple[str, ...], columns.axes]
    """Axes of the split with their severities, such as `wide_gaps@3`; none in training."""
    shifted: Annotated[Mapping[str, Value], columns.numbers]
    """Values of the parameters that the axes name."""
    seed: Annotated[int, columns.whole]
    index: Annotated[int, columns.whole]
    attempt: Annotated[int, columns.whole]
    """Number of the try at the index that was the first feasible one, from 0."""
    id_twin: Annotated[str, matching(ID)]
    """Id of the training scenario of the same index."""
    instruction: Annotated[str, text(MAX_TEXT)]
    horizon: Annotated[float, columns.horizon]
    """Time limit [s]."""
    params: Annotated[Mapping[str, Value], columns.numbers]
    """Values of all parameters."""
    embodiment: Annotated[str, columns.embodiment]
    scene_xml: Annotated[str, text(columns.MAX_SCENE)] = field(repr=False)
    """The certified scene without the robot, MJCF."""
    scene_sha256: Annotated[str, matching(HASH)]
    witness: Annotated[NDArray[np.float32], columns.witness] = field(repr=False, compare=False)
    """Actions of a success as the controller received them, shape (n, 7 * arms)."""
    witness_sha256: Annotated[str, matching(HASH)]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name})"

    def _repr_html_(self) -> str:
        """Its parameters, in a notebook, those of the axes first."""
        known = {**self.shifted, **self.params}
        rows = [(name, value, name in self.shifted) for name, value in known.items()]
        return html_tables.table(str(self.name), ("parameter", "value", "changed by the axis"), rows, len(rows))

    @property
    def name(self) -> Name:
        """Name of the scenario for people."""
        return Name(self.task, self.split, self.index, self.id)

    def plain(self) -> dict[str, Any]:
        """All columns but the witness as plain data, as a shard stores them."""
        return {name: columns.plain_value(getattr(self, name)) for name in layout(type(self)).without_witness}

    @classmethod
    def of(cls, plain: Mapping[str, Any], witness: NDArray[np.float32]) -> Self:
        """The reverse of `plain`.

        Raises:
            ValueError: a column holds something that is not allowed there.
        """
        readers = layout(cls).readers
        return cls(**{name: readers[name](name, value) for name, value in plain.items()}, witness=witness)


@dataclass(frozen=True, kw_only=True, repr=False)
class PoolRow(SceneRow):
    """One scenario of a pool."""

    certificate: Annotated[StoredCertificate, columns.certificate] = field(repr=False)


@dataclass(frozen=True, kw_only=True, repr=False)
class DemonstrationRow(SceneRow):
    """One demonstration: actions that solve a scenario, or a failed attempt."""

    run: Annotated[int, columns.whole]
    """Number of the run in its scenario, from 0."""
    style: Annotated[str, matching(WORD)]
    """Style of the moves, see `scengen.demos.styles`."""
    outcome: Annotated[str, columns.outcome]
    """Result of the run; `success` for a demonstration, another one for a failed attempt."""
    reason: Annotated[str, text(MAX_TEXT)]
    """Reason why a failed attempt is one; empty for a success."""
    seconds: Annotated[float, columns.seconds]
    """Time at which the goal was reached, or at which the run ended [s]."""
    final_state: Annotated[str, matching(SHORT_HASH)]
    """Hash of the physics state at the end of the actions."""

    @property
    def key(self) -> tuple[str, str, int]:
        """Identity of the run, which its style and noise depend on: task, scenario, number of the run."""
        return self.task, self.id, self.run


@dataclass(frozen=True)
class Layout:
    """Columns of one kind of row."""

    names: tuple[str, ...]
    """Names of all columns."""
    readers: Mapping[str, columns.Reader]
    """Functions that turn stored values into values of fields, by column."""
    schemas: Mapping[int, pa.Schema]
    """Columns of a shard as Arrow stores them, by the numbers in an action of its robots."""

    @cached_property
    def without_witness(self) -> tuple[str, ...]:
        """Names of all columns but the largest."""
        return tuple(name for name in self.names if name != "witness")


@cache
def layout(kind: type[SceneRow]) -> Layout:
    """The columns of a kind of row."""
    kinds = {name: get_args(hint) for name, hint in get_type_hints(kind, include_extras=True).items()}
    schemas = {
        size: pa.schema([(name, columns.arrow_type(type_, size)) for name, (type_, _) in kinds.items()])
        for size in sorted(columns.ACTION_SIZES)
    }
    return Layout(tuple(kinds), {name: read for name, (_, read) in kinds.items()}, schemas)


SCHEMAS = layout(PoolRow).schemas
"""Columns of a shard of a pool, by the numbers in an action of its robots."""
