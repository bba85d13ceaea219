"""One scenario of a pool. Its fields are the columns of the shards: a new column is a new field of `PoolRow`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_type_hints

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..certificate import StoredCertificate
from ..control.loop import ACTION
from ..params import Value
from . import columns
from .columns import ID, matching, text
from .names import Name
from .untrusted import HASH, MAX_TEXT, WORD

NO_WITNESS: NDArray[np.float32] = np.zeros((0, ACTION), np.float32)
"""Witness of a row that was read without its witness."""


@dataclass(frozen=True, kw_only=True)
class PoolRow:
    """One scenario of a pool.

    Each field is a column: its type says how Arrow stores the column, and the function beside the type reads it.
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
    certificate: Annotated[StoredCertificate, columns.certificate] = field(repr=False)

    @property
    def name(self) -> Name:
        """Name of the scenario for people."""
        return Name(self.task, self.split, self.index, self.id)

    def plain(self) -> dict[str, Any]:
        """All columns but the witness as plain data, as a shard stores them."""
        return {name: columns.plain_value(getattr(self, name)) for name in WITHOUT_WITNESS}

    @classmethod
    def of(cls, plain: Mapping[str, Any], witness: NDArray[np.float32]) -> "PoolRow":
        """The reverse of `plain`.

        Raises:
            ValueError: a column holds something that is not allowed there.
        """
        return cls(**{name: READERS[name](name, value) for name, value in plain.items()}, witness=witness)


_KINDS = {name: get_args(hint) for name, hint in get_type_hints(PoolRow, include_extras=True).items()}

NAMES = tuple(_KINDS)
"""Names of all columns."""
WITHOUT_WITNESS = tuple(name for name in NAMES if name != "witness")
"""Names of all columns but the largest."""
READERS: dict[str, columns.Reader] = {name: read for name, (_, read) in _KINDS.items()}
"""Functions that turn stored values into values of fields, by column."""
SCHEMAS = {
    size: pa.schema([(name, columns.arrow_type(kind, size)) for name, (kind, _) in _KINDS.items()])
    for size in sorted(columns.ACTION_SIZES)
}
"""Columns of a shard, by the numbers in an action of its robots."""
