import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen.assets.box import Domino
from scengen.errors import BadConfig, OutOfBounds, UnknownName
from scengen.params import canonical, parameters, values, with_values
from scengen.tasks.domino_single import DominoSingle


def test_a_value_outside_its_bounds_is_refused_with_both_ends_and_the_unit():
    with pytest.raises(OutOfBounds, match=r"Domino.mass = 9.0 kg; it must lie in \[0.005, 0.5\] kg"):
        Domino(mass=9.0)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_no_number_that_is_none_gets_in(value):
    with pytest.raises(OutOfBounds):
        Domino(mass=value)


@pytest.mark.parametrize(("name", "value"), [("count", 4.0), ("count", True), ("gap_ratio", "wide"), ("x", None)])
def test_a_value_of_the_wrong_kind_is_refused(name, value):
    with pytest.raises(BadConfig, match="must be a"):
        DominoSingle(**{name: value})


def test_nested_parameters_have_dotted_names():
    assert "tile.mass" in values(DominoSingle())
    assert with_values(DominoSingle(), {"tile.mass": 0.03, "count": 4}).tile.mass == 0.03


def test_an_unknown_parameter_is_answered_with_the_nearest():
    with pytest.raises(UnknownName, match="did you mean 'tile.mass'"):
        with_values(DominoSingle(), {"tile.mas": 0.03})


def test_whole_numbers_and_reals_of_the_same_value_are_one_scenario():
    assert with_values(DominoSingle(), {"heading": 45}).id == with_values(DominoSingle(), {"heading": 45.0}).id


@given(st.data())
def test_every_value_within_bounds_is_accepted_and_none_beyond(data):
    p = data.draw(st.sampled_from(list(parameters(DominoSingle()))))
    inside = data.draw((st.integers if p.integer else st.floats)(p.low, p.high))
    assert values(with_values(DominoSingle(), {p.name: inside}))[p.name] == inside
    with pytest.raises(OutOfBounds):
        with_values(DominoSingle(), {p.name: type(p.nominal)(p.high + 1)})


def test_the_canonical_text_orders_its_keys():
    assert (
        canonical(Domino()).index("friction") < canonical(Domino()).index("height") < canonical(Domino()).index("mass")
    )
