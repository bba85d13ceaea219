"""The settings with which property tests run."""

import time

from hypothesis import given, settings
from hypothesis import strategies as st


def test_no_property_has_a_deadline_by_default():
    assert settings().deadline is None and settings(max_examples=3).deadline is None


@settings(max_examples=2)
@given(st.integers(0, 1))
def test_an_example_may_take_longer_than_the_200_ms_of_hypothesis(number):
    time.sleep(0.25)
