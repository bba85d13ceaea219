"""Every family, anywhere within the bounds of its parameters."""

import numpy as np
import pytest
from controls import builds_or_is_refuted

from scengen import list_tasks, load_task
from scengen.params import parameters, with_values

DRAWS = 100


def end_or_between(parameter, random):
    """Either end, or a value between them."""
    low, high = parameter.low, parameter.high
    if parameter.integer:
        return int(random.integers(low, high, endpoint=True))
    return float(random.choice([low, high, random.uniform(low, high)]))


@pytest.mark.parametrize("name", list_tasks())
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(name):
    nominal, random = load_task(name).family(), np.random.default_rng(0)
    for k in range(DRAWS):
        share = (k + 1) / DRAWS  # few parameters moved: most of these scenes can be built; all of them: hardly any
        moved = [known for known in parameters(nominal) if random.random() < share]
        builds_or_is_refuted(with_values(nominal, {known.name: end_or_between(known, random) for known in moved}))
