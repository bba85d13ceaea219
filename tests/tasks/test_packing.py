"""A packing without gaps exists, only such a packing counts, and what is no fair problem gets no certificate."""

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import config
from scengen.assets import guillotine
from scengen.params import values, with_values
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.packing import Packing, Spot
from scengen.validate.certify import certify
from scengen.validate.rollout import replay, run
from scengen.validate.settings import CertifySettings, Robust

TASK = config.task("packing")
NOMINAL = Packing()
ONE_RUN = CertifySettings(robust=Robust(runs=1, bound=0.0))
cuts = st.fixed_dictionaries(
    {
        "count": st.sampled_from([3, 4]),
        "frame": st.integers(2, 3),
        "left": st.integers(2, 4),
        "right": st.integers(2, 4),
        "low": st.integers(2, 4),
        "rise": st.integers(1, 3),
        "top": st.integers(2, 4),
        "mirror": st.integers(0, 1),
        "heading": st.floats(-90.0, 90.0),
        "unit": st.floats(0.016, 0.02),
        "clearance": st.floats(0.0002, 0.002),
    }
).map(lambda drawn: with_values(NOMINAL, drawn))


def world(scenario):
    return World.load(scene_text.emit(scenario.build())[0], TASK.embodiment)


def play(scenario, plan):
    return run(scenario, world(scenario), plan, TASK.horizon, until_settled=True)


@dataclass(frozen=True, kw_only=True)
class Packed(Packing):
    """All pieces lie as they were cut, but for a few that lie elsewhere."""

    amiss: tuple[int, ...] = ()

    def start(self, i):
        return super().start(i) if i in self.amiss else self.goal(i)

    def infeasible(self):
        return None


# --- the plan that comes with every scenario ---------------------------------------------


@given(cuts)
@settings(deadline=None, max_examples=40)
def test_every_cut_closes_exactly(scenario):
    assert guillotine.closes(scenario.slots, scenario.footprint)
    assert sum(slot.area for slot in scenario.slots) == scenario.footprint.area


@given(cuts)
@settings(deadline=None, max_examples=12)
def test_the_pieces_in_their_slots_touch_nothing_but_the_floor_and_reach_the_goal(scenario):
    tight = with_values(Packed(), values(scenario))
    w = world(tight)
    assert all(c.dist > -1e-5 for c in w.data.contact[: w.data.ncon])
    assert tight.success(w)
    assert tight.joints == pytest.approx(_joints(tight), rel=1e-9)


def _joints(scenario):
    """Area of the joints: each piece is smaller than its slot by the clearance along its outline, 4 c^2 too often."""
    outline = sum(2 * (s.bounds.width + s.bounds.height) for s in scenario.slots)
    c = scenario.clearance
    return c * scenario.unit * float(outline) - 4 * c * c * scenario.count


@given(cuts)
@settings(deadline=None, max_examples=20)
def test_the_plan_is_one_of_few_arrangements_and_with_one_piece_exchanged_there_is_none(scenario):
    i, other = scenario.misfit
    exchanged = [*scenario.slots[:i], other, *scenario.slots[i + 1 :]]
    assert 1 <= scenario.solutions <= 100
    assert other.area == scenario.slots[i].area and guillotine.solutions(exchanged, scenario.footprint) == 0


def test_the_number_of_solutions_of_the_training_scenarios_lies_between_2_and_32():
    drawn = [TASK.draw("id", 0, i).scenario for i in range(40)]
    found = {scenario.solutions for scenario in drawn if isinstance(scenario, Packing)}
    assert min(found) == 2 and max(found) <= 32


def test_whole_units_are_exact():
    for slot in Packing(count=4, left=3, rise=3).slots:
        assert all(type(side) is Fraction and side.denominator == 1 for side in slot.sides)


# --- goal --------------------------------------------------------------------------------


def test_without_one_of_its_pieces_a_packing_has_a_gap_of_the_size_of_that_piece():
    for i in range(3):
        scenario = Packed(amiss=(i,))
        w = world(scenario)
        assert not scenario.success(w)
        assert scenario.gaps(w) - scenario.joints == pytest.approx(scenario.pieces[i].area)


@pytest.mark.parametrize(("lift", "tilt", "counts"), [(0.0, 0.0, True), (0.003, 0.0, False), (0.001, 0.05, False)])
def test_a_piece_above_the_floor_or_tilted_does_not_count(lift, tilt, counts):
    scenario = Packed()
    w = world(scenario)
    start = w.data.joint("piece_1_free").qpos
    start[2] += lift
    start[3:] = [np.cos(tilt / 2), np.sin(tilt / 2), 0.0, 0.0]
    w.loop.restore(w.loop.state())
    assert scenario.success(w) == counts


def test_a_piece_on_the_table_beside_the_bin_does_not_count_and_one_below_the_table_ends_the_episode():
    scenario = Packed(amiss=(0,))
    w = world(scenario)
    assert not scenario.lies(w, 0) and scenario.failure(w) is None
    w.data.joint("piece_0_free").qpos[:3] = [0.0, 0.6, 0.7]
    w.loop.restore(w.loop.state())
    assert scenario.failure(w) == "a piece fell off the table"


# --- plans -------------------------------------------------------------------------------


@pytest.mark.parametrize("split", ["id", "four_pieces"])
def test_shortcuts_are_played_to_their_end_and_leave_gaps(split):
    scenario = TASK.draw(split, 0, 0).scenario
    assert isinstance(scenario, Packing)
    w = world(scenario)
    for name, plan in scenario.shortcuts().items():
        episode = run(scenario, w, plan, TASK.horizon, until_settled=True)
        assert episode.reason == "everything came to rest without reaching the goal"
        gap = scenario.gaps(w) - scenario.joints
        assert gap > 0.9 * min(piece.area for piece in scenario.pieces)
        assert name != "all but one" or gap == pytest.approx(scenario.pieces[-1].area)


def test_with_a_piece_of_the_same_area_that_does_not_fit_the_witness_leaves_pieces_on_top_of_others():
    actions = play(NOMINAL, NOMINAL.oracle).actions
    (scene,) = NOMINAL.ablations().values()
    w = World.load(scene_text.emit(scene)[0], TASK.embodiment)
    assert not replay(NOMINAL, w, actions, TASK.horizon, until_settled=True).solved
    assert max(w.pos(f"piece_{i}")[2] for i in range(3)) > NOMINAL.floor + 0.005


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Forged(Packing):
    """One piece is the mirror image of what was cut."""

    @cached_property
    def slots(self):
        whole = super().slots
        return (guillotine.mirrored(whole[:1], whole[0].bounds)[0], *whole[1:])


@dataclass(frozen=True, kw_only=True)
class Lenient(Packing):
    """A part of the pieces will do."""

    def success(self, world):
        return sum(self.lies(world, i) for i in range(self.count)) >= 2


@dataclass(frozen=True, kw_only=True)
class Spared(Packing):
    """What is exchanged is exchanged for its like."""

    def shortcuts(self):
        return {}

    def ablations(self):
        return {"another piece": self.build()}


@dataclass(frozen=True, kw_only=True)
class Clumsy(Packing):
    """The oracle turns nothing."""

    def shortcuts(self):
        return {}

    def oracle(self, world):
        yield from super().shortcuts()["as they lie"](world)


TURNED = {f"spot_{i}": replace(getattr(NOMINAL, f"spot_{i}"), turn=20.0) for i in range(3)}


@pytest.mark.parametrize(
    ("scenario", "check", "verdict"),
    [
        (Forged(), "feasible", "refuted"),
        (Packing(unit=0.015, clearance=0.002), "feasible", "refuted"),
        (Packing(spot_0=Spot(x=-0.08, y=0.14)), "feasible", "refuted"),
        (Packing(spot_1=Spot(x=0.1, y=-0.25, turn=65.0)), "feasible", "refuted"),
        (Packing(spot_0=Spot(x=0.35, y=0.3)), "feasible", "refuted"),
        (Packing(**TURNED), "feasible", "refuted"),
        (Packed(), "unsolved", "refuted"),
        (Lenient(), "shortcuts", "refuted"),
        (Clumsy(), "solved", "unknown"),
        (Spared(), "necessity", "refuted"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Packing) else str(value),
)
def test_what_is_no_fair_problem_is_not_certified(scenario, check, verdict):
    certificate = certify(scenario, 20.0, ONE_RUN, TASK.embodiment).certificate
    failed = certificate.failed
    assert failed and (certificate.verdict, failed.name) == (verdict, check), certificate.reason
