"""What it takes to be outside: open and closed ends, mixtures, periods, symmetries, features, severities."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scengen import list_tasks, load_task
from scengen.cli.commands.settings import read_task
from scengen.errors import BadConfig, OutOfBounds
from scengen.ood.features import at_most, departure, sampled, unseen
from scengen.params import Parameter, parameters, values
from scengen.runs.generate import GenerateSettings
from scengen.samplers import task_files
from scengen.samplers.axis import Axis, spell
from scengen.samplers.dists import Choice, Fixed, Mixture, Uniform, parse
from scengen.samplers.split import ID
from scengen.samplers.support import Interval, distance, meet, nearest
from scengen.samplers.task import leaves, load
from scengen.symmetry import Symmetry, images
from scengen.tasks.domino_single import DominoSingle

NODE = {k: v for k, v in load_task("domino_single").node.items() if k != "limits"}
KNOWN = {p.name: p for p in parameters(DominoSingle())}


def with_axis(replace, **others):
    return load("domino_single", {**NODE, "axes": {"mine": {"replace": replace, **others}}})


# --- ends and mixtures ----------------------------------------------------------------------


def test_open_ends_that_meet_share_nothing_and_yet_leave_no_gap():
    below, above = Interval(0.0, 1.0, open_high=True), Interval(1.0, 2.0)
    assert not meet((below,), (above,)) and meet((Interval(0.0, 1.0),), (above,))
    assert distance((below,), (above,)) == 0.0


def test_the_refusal_says_whether_values_are_shared():
    half_open = {**NODE, "id": {**NODE["id"], "gap_ratio": ["uniform", 0.6, 1.2, "[)"]}}
    with pytest.raises(BadConfig, match="0.6 to 1.2 without 1.2 .*no value in common, but no gap either"):
        load("domino_single", {**half_open, "axes": {"mine": {"replace": {"gap_ratio": ["uniform", 1.2, 1.4]}}}})
    with pytest.raises(BadConfig, match="both have values in common.*move it outside"):
        with_axis({"gap_ratio": ["uniform", 1.2, 1.4]})


def test_a_mixture_with_one_part_inside_training_is_refused_and_names_all_its_parts():
    outside = ["mixture", ["uniform", 1.3, 1.4], ["uniform", 0.3, 0.5], 1.6]
    (proof,) = with_axis({"gap_ratio": outside}).proofs["mine"]
    assert proof.gap == pytest.approx(0.1)
    assert spell(parse("x", outside)) == "1.3 to 1.4 or 0.3 to 0.5 or {1.6}"
    with pytest.raises(BadConfig, match="touches or overlaps"):
        with_axis({"gap_ratio": ["mixture", ["uniform", 1.3, 1.4], 0.9]})


@given(st.floats(0, 1, exclude_max=True))
def test_no_draw_takes_an_open_end_or_leaves_a_mixture(u):
    assert Uniform(0.1, 0.3, ends="()").quantile(u) in Interval(0.1, 0.3, True, True)
    mixed = Mixture((Uniform(0.0, 1.0), Fixed(5.0), Mixture((Fixed(7.0), Uniform(8.0, 9.0)))))
    assert any(mixed.quantile(u) in part for part in mixed.support)


def test_the_parts_of_a_mixture_are_equally_likely():
    mixed = parse("x", ["mixture", ["uniform", 0.0, 1.0], 5.0, 5.0])
    draws = [mixed.quantile((i + 0.5) / 300) for i in range(300)]
    assert draws.count(5.0) == 200 and max(d for d in draws if d < 5.0) > 0.99


@pytest.mark.parametrize(
    "node",
    [
        ["uniform", 0.1, 0.3, "[["],
        ["uniform", 0.1, 0.3, 0.5],
        ["uniform", 0.1, 0.1, "()"],
        ["mixture"],
        ["mixture", "a"],
    ],
)
def test_ends_and_mixtures_that_make_no_sense_are_refused(node):
    with pytest.raises(BadConfig):
        parse("task.id.x", node)


@given(st.floats(-400, 400), st.floats(-400, 400))
def test_the_nearest_value_on_a_circle_is_as_far_as_the_distance_says(value, low):
    support = (Interval(low, low + 20.0),)
    edge = nearest(support, value, 180.0)
    assert abs(edge - value) == pytest.approx(distance(support, (Interval(value, value),), 180.0), abs=1e-6)
    assert abs(edge - value) <= 80.0 + 1e-6


# --- symmetries -----------------------------------------------------------------------------

CUBES = {n: Parameter(n, 0.0, "m", -1.0, 1.0, None, False, False) for n in ("a.x", "a.y", "b.x", "b.y")}
IDENTICAL = Symmetry("identical cubes", swap=("a", "b"))
MIRROR = Symmetry("mirror", reflect={"a.y": 0.0, "b.y": 0.0})
AT = {"a.x": Uniform(-0.2, -0.1), "a.y": Uniform(0.1, 0.2), "b.x": Uniform(0.1, 0.2), "b.y": Uniform(0.3, 0.4)}


def prove(symmetries, **replace):
    return Axis("mine", "", "", {n.replace("_", "."): d for n, d in replace.items()}).prove(AT, CUBES, symmetries)


def test_two_identical_cubes_that_have_changed_places_are_the_same_scene():
    places = {n.replace(".", "_"): AT[o] for n, o in (("a.x", "b.x"), ("a.y", "b.y"), ("b.x", "a.x"), ("b.y", "a.y"))}
    assert len(prove((), **places)) == 4
    with pytest.raises(BadConfig, match="training scenes again under .*identical cubes"):
        prove((IDENTICAL,), **places)
    assert prove((IDENTICAL,), a_x=AT["b.x"])  # both cubes on one side is new, swapped or not


def test_a_mirror_image_of_training_is_no_departure_unless_something_else_moves_too():
    flipped = {"a_y": Uniform(-0.2, -0.1), "b_y": Uniform(-0.4, -0.3)}
    assert prove((IDENTICAL,), **flipped)
    with pytest.raises(BadConfig, match="mirror"):
        prove((IDENTICAL, MIRROR), **flipped)
    assert prove((IDENTICAL, MIRROR), **flipped, a_x=Uniform(-0.5, -0.4))


def test_symmetries_combine_and_end():
    point = {"a.x": 0.1, "a.y": 0.2, "b.x": 0.3, "b.y": 0.4}
    both = list(images(point, (IDENTICAL, MIRROR), lambda v, about: 2 * about - v))
    assert len(both) == 4 and {"a.x": 0.3, "a.y": -0.4, "b.x": 0.1, "b.y": -0.2} in both
    sliding = (Symmetry("one", reflect={"a.x": 0.0}), Symmetry("other", reflect={"a.x": 1.0}))
    with pytest.raises(BadConfig, match="more than"):
        list(images(point, sliding, lambda v, about: 2 * about - v))


def test_a_symmetry_of_unknown_parameters_is_refused():
    for symmetry in (Symmetry("s", swap=("a", "c")), Symmetry("s", swap=("c", "d")), Symmetry("s", reflect={"c": 0.0})):
        with pytest.raises(BadConfig, match="do not exist"):
            symmetry.check(CUBES)
    IDENTICAL.check(CUBES)


# --- features -------------------------------------------------------------------------------


def test_bounds_of_sampled_proofs_are_those_of_the_textbook():
    assert at_most(0, 300) == pytest.approx(1 - 0.05 ** (1 / 300))  # Clopper-Pearson for no hit; about 3 / n
    assert at_most(0, 300) == pytest.approx(3 / 300, rel=0.01)
    assert at_most(5, 5) == 1.0
    n, p = 93, 1 - unseen(93)  # Wilks: 93 draws reach 95 % of a distribution with 95 % confidence
    assert p == pytest.approx(0.95, abs=5e-4)
    assert 1 - n * p ** (n - 1) + (n - 1) * p**n == pytest.approx(0.95)


def test_an_axis_moves_the_features_that_follow_from_what_it_moves():
    task = load_task("domino_single")
    by_name = {d.feature: d for d in sampled(task, "wide_gaps", draws=60).departures}
    gap = by_name["gap_over_height"]
    assert gap.leaves and gap.inside == 0 and gap.bound == pytest.approx(at_most(0, 60)) and "60 draws" in gap.kind
    low, high = (ratio * DominoSingle().tile.width / DominoSingle().tile.height for ratio in (0.6, 1.2))
    assert low <= gap.training[0] and gap.training[1] <= high < gap.here[0]
    assert not by_name["slab_over_tile_mass"].leaves


def test_other_numbers_with_the_same_features_are_told_apart_from_new_physics():
    assert sampled(load_task("domino_single"), "diagonal", draws=20).features_stay
    assert not sampled(load_task("domino_single"), "light_tiles", draws=20).features_stay


def test_overlap_of_a_feature_is_counted():
    found = departure("ratio", [0.0, 1.0, 0.5], [0.9, 1.5, 2.0, 3.0])
    assert found.inside == 1 and not found.leaves and found.gap == 0.0
    assert departure("ratio", [0.0, 1.0], [1.5, 2.0]).gap == pytest.approx(0.5)


# --- severities -----------------------------------------------------------------------------


def test_severities_go_in_equal_steps_from_the_edge_of_training_to_the_far_end():
    task = with_axis({"gap_ratio": ["uniform", 1.25, 1.4]}, severities=4)
    assert [task.shifts(f"mine@{k}")["gap_ratio"].value for k in (1, 2, 3, 4)] == pytest.approx([1.25, 1.30, 1.35, 1.4])


def test_severities_of_several_values_go_towards_each_from_its_own_side_also_over_the_seam():
    task = with_axis({"heading": ["choice", -45.0, 135.0]}, severities=3)
    assert task.shifts("mine@1")["heading"].options == pytest.approx((-15.0, 105.0))
    over = {
        **NODE,
        "id": {**NODE["id"], "heading": 170.0},
        "axes": {"mine": {"replace": {"heading": -150.0}, "severities": 4}},
    }
    assert [load("x", over).shifts(f"mine@{k}")["heading"].value % 360 for k in (1, 4)] == pytest.approx([180, 210])


def test_a_measured_limit_becomes_the_far_end():
    node = {**NODE, "axes": {"mine": {"replace": {"gap_ratio": ["uniform", 1.25, 1.4]}, "severities": 2}}}
    task = load("domino_single", {**node, "limits": {"mine": {"gap_ratio": 1.6}}})
    assert [task.shifts(f"mine@{k}")["gap_ratio"].value for k in (1, 2)] == pytest.approx([1.4, 1.6])


def test_a_severity_is_a_split_like_any_other_and_its_twins_differ_in_nothing_else():
    task = with_axis({"gap_ratio": ["uniform", 1.25, 1.4]}, severities=5)
    for index in range(5):
        trained, shifted = (values(task.draw(split, 0, index).scenario) for split in (ID, "mine@3"))
        assert {n for n in trained if trained[n] != shifted[n]} == {"gap_ratio"}


@pytest.mark.parametrize(
    ("split", "severities", "says"),
    [
        ("mine@1", 0, "the axis has none: give it `severities: N`"),
        ("mine@6", 5, "the axis has severities 1 to 5"),
        ("mine@0", 5, "the axis has severities 1 to 5"),
        ("mine@high", 5, "the severity after @ must be a whole number"),
        ("mine@2+mine@3", 5, "two of its axes move gap_ratio"),
    ],
)
def test_a_severity_that_does_not_exist_is_refused(split, severities, says):
    task = with_axis({"gap_ratio": ["uniform", 1.25, 1.4]}, severities=severities)
    with pytest.raises(BadConfig, match=says):
        task.draw(split, 0, 0)


def test_severities_of_whole_numbers_are_whole_or_refused():
    assert with_axis({"count": ["integer", 7, 8]}, severities=2).shifts("mine@1")["count"] == Fixed(7)
    with pytest.raises(BadConfig, match="there are 2 steps"):
        with_axis({"count": ["integer", 7, 8]}, severities=5)


@pytest.mark.parametrize(
    ("limits", "error"),
    [
        ({"mine": {"gap_ratio": 99.0}}, OutOfBounds),
        ({"mine": 1.6}, BadConfig),
    ],
)
def test_a_limit_that_makes_no_sense_is_refused(limits, error):
    axes = {"mine": {"replace": {"gap_ratio": ["uniform", 1.25, 1.4]}, "severities": 2}}
    with pytest.raises(error):
        load("domino_single", {**NODE, "axes": axes, "limits": limits})


def test_a_limit_inside_training_is_refused_when_the_severity_is_asked_for_and_only_then():
    axes = {"mine": {"replace": {"gap_ratio": ["uniform", 1.25, 1.4]}, "severities": 2}}
    task = load("domino_single", {**NODE, "axes": axes, "limits": {"mine": {"gap_ratio": 1.0}}})
    assert task.draw("mine", 0, 0)
    with pytest.raises(BadConfig, match=r"axis mine@1: .*drop the axis .*~task.axes.mine"):
        task.draw("mine@1", 0, 0)


def test_limits_of_an_axis_that_was_dropped_or_changed_do_not_stand_in_the_way():
    limits = {"gone": {"gap_ratio": 1.6}, "mine": {"count": 9}}
    axes = {"mine": {"replace": {"gap_ratio": ["uniform", 1.25, 1.4]}, "severities": 2}}
    assert load("domino_single", {**NODE, "axes": axes, "limits": limits}).axes["mine"].limits == {}


@pytest.mark.parametrize("name", list_tasks())
def test_every_recorded_limit_belongs_to_a_parameter_of_an_axis_with_one_path_to_go(name):
    task, recorded = load_task(name), load_task(name).node.get("limits", {})
    for axis, measured in recorded.items():
        assert {n for n, _ in leaves(measured)} == set(task.axes[axis].limits), "a name in conf/limits is wrong"
        assert not any(isinstance(task.axes[axis].replace[n], Choice) for n in task.axes[axis].limits)


def test_recorded_limits_are_found_beside_the_task_files_of_any_package(tmp_path):
    for group, text in (
        ("task", (task_files.conf_dir() / "task" / "domino_single.yaml").read_text()),
        ("limits", "wide_gaps:\n  gap_ratio: 1.55\n"),
    ):
        (tmp_path / group).mkdir()
        (tmp_path / group / "theirs.yaml").write_text(text)
    asked = ["task=theirs", "++task.axes.wide_gaps.severities=5", f"hydra.searchpath=[file://{tmp_path}]"]
    _, task, _ = read_task("generate", asked, GenerateSettings)
    assert task.shifts("wide_gaps@5") == {"gap_ratio": Fixed(1.55)}
    assert task.node["limits"] == {"wide_gaps": {"gap_ratio": 1.55}}, "and so the manifest records it"
