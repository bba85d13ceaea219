"""Every family, anywhere within the bounds of its parameters."""

import pytest
from controls import builds_or_is_refuted
from helpers import anywhere
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scengen import config


@pytest.mark.parametrize("name", config.tasks())
@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(name, data):
    builds_or_is_refuted(data.draw(anywhere(config.task(name).family)))
