"""What several tests need."""

from hypothesis import strategies as st

from scengen.params import parameters, with_values


def anywhere(cls):
    """Any instance within its own bounds."""
    values = {p.name: (st.integers if p.integer else st.floats)(p.low, p.high) for p in parameters(cls())}
    return st.fixed_dictionaries(values).map(lambda drawn: with_values(cls(), drawn))
