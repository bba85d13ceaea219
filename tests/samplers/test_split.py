"""A split has one spelling, and what cannot be one is refused."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen import load_task
from scengen.errors import BadConfig, UnknownName
from scengen.samplers.split import ID, Part, Split

names = st.from_regex(r"[a-z][a-z_0-9]{0,8}", fullmatch=True).filter(lambda name: name != ID)
parts = st.builds(Part, names, st.none() | st.integers(0, 99))


@given(st.lists(parts, max_size=4).map(lambda several: Split(tuple(several))))
def test_a_split_is_what_its_spelling_says(split):
    assert Split.parse(str(split)) == split
    assert split.is_training == (str(split) == ID) == (split.axes == ())


def test_axes_and_severities_are_taken_apart():
    split = Split.parse("diagonal+wide_gaps@03")
    assert split.parts == (Part("diagonal"), Part("wide_gaps", 3))
    assert str(split) == "diagonal+wide_gaps@3" and split.axes == ("diagonal", "wide_gaps@3")
    assert Split.parse(split) is split and Split.parse("id") == Split()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("wide_gaps@high", "the severity after @ must be a whole number, as in wide_gaps@1"),
        ("wide_gaps@", "the severity after @ must be a whole number"),
        ("wide_gaps@-1", "the severity after @ must be a whole number"),
        ("wide_gaps@²", "the severity after @ must be a whole number"),
        ("id+diagonal", "id is training itself; leave it out"),
    ],
)
def test_what_is_no_split_is_refused(text, says):
    with pytest.raises(BadConfig, match=says):
        Split.parse(text)


@pytest.mark.parametrize("text", ["", "diagonal+", "+", "diagnal", "id@2"])
def test_a_split_of_no_axis_of_the_task_is_refused(text):
    with pytest.raises(UnknownName, match="no split of domino_single named"):
        load_task("domino_single").draw(text, 0, 0)


def test_a_task_travels_to_workers_as_it_is():
    task = load_task("domino_single")
    again = pickle.loads(pickle.dumps(task))
    assert again == task and again.node == task.node
    assert again.draw("wide_gaps@2", 0, 3) == task.draw(Split.parse("wide_gaps@2"), 0, 3)
