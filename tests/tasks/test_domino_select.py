"""Only the intact chain reaches a red slab, by physics and not by rule; what is no fair choice gets no certificate."""

import itertools
import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import config
from scengen.assets.box import Domino
from scengen.params import with_values
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.tasks.domino_select import DECOY, DRIFT, GAP, LANES, MISSING, SLAB_MOVES, Defect, DominoSelect
from scengen.validate.certify import certify
from scengen.validate.rollout import AT_REST, STILL, replay, run
from scengen.validate.settings import CertifySettings

TASK = config.task("domino_select")
SPLITS = ["id", *TASK.axes]
EVERY_KIND = DominoSelect(fourth=Defect(kind=MISSING, place=0.6), count=3)
"""One chain with each kind of defect."""


def world(scenario):
    return World.load(scene_text.emit(scenario.build())[0], TASK.embodiment)


def lane_of(scenario, kind):
    return next(k for k in scenario.wrong if scenario.defects[k].kind == kind)


def strike(scenario, k, spin):
    """Give the first tile of chain `k` a spin [rad/s], without robot, and live until all is still.

    Returns how far the red slab that went farthest has gone [m].
    """
    model = mujoco.MjModel.from_xml_string(scene_text.emit(scenario.build())[0])
    data = mujoco.MjData(model)
    data.qvel[model.joint(f"tile_{k}_0_free").dofadr[0] + 4] = spin
    still = 0
    while still < 10:
        mujoco.mj_step(model, data, 5)
        still = still + 1 if np.abs(data.qvel).max() < STILL else 0
        assert data.time < 8.0, "it does not come to rest"
    assert math.acos(data.body(f"tile_{k}_0").xmat[8]) > math.radians(45), "the first tile has not fallen"
    return max(math.dist(data.body(slab).xipos[:2], foot[:2]) for slab, foot in scenario.targets.items())


# --- the law of the task ----------------------------------------------------------------


@pytest.mark.parametrize(("split", "spin"), [("subtle", 5.5), *((split, 8.0) for split in SPLITS)])
def test_however_hard_its_first_tile_is_struck_only_the_intact_chain_reaches_a_red_slab(split, spin):
    """The hand gives 2 rad/s, and 8 if it moves as fast as it can; below 5 a tile may rock back."""
    scenario = TASK.draw(split, 0, 1).scenario
    reached = [k for k in range(LANES) if strike(scenario, k, spin) >= SLAB_MOVES]
    assert reached == [scenario.intact]


@pytest.mark.parametrize("gap_ratio", [0.9, 1.2, 1.5, 1.8])
def test_a_chain_stays_intact_as_long_as_its_spaces_are_shorter_than_a_tile_is_tall(gap_ratio):
    """The textbook's reach of a falling tile is its height: 50 mm; the widest space here is 45 mm."""
    scenario = DominoSelect(gap_ratio=gap_ratio, count=3)
    assert strike(scenario, scenario.intact, 6.0) >= SLAB_MOVES


@pytest.mark.parametrize(("stretch", "reaches"), [(1.02, True), (1.07, False), (1.15, False)])
def test_the_reach_of_a_falling_tile_is_its_height_and_the_two_millimetres_by_which_it_slides(stretch, reaches):
    scenario = DominoSelect(second=Defect(kind=DRIFT, stretch=stretch))
    assert (strike(scenario, lane_of(scenario, DRIFT), 6.0) >= SLAB_MOVES) == reaches


@pytest.mark.parametrize("kind", [GAP, DRIFT, DECOY, MISSING])
def test_a_push_at_a_wrong_chain_is_watched_until_all_is_still_and_no_rule_ends_it_before(kind):
    scenario, w = EVERY_KIND, world(EVERY_KIND)
    k = lane_of(scenario, kind)
    episode = run(scenario, w, scenario.shortcuts()[f"topple chain {k}"], TASK.horizon, until_settled=True)
    assert (episode.outcome, episode.reason) == ("timeout", AT_REST) and episode.seconds < TASK.horizon - 2.0
    assert w.tilt(f"tile_{k}_0") > math.radians(45) and np.abs(w.data.qvel).max() < STILL
    fallen = [name for name in scenario.pieces if w.tilt(name) > math.radians(45)]
    assert {name.split("_")[1] for name in fallen} == {str(k)}
    assert (f"decoy_{k}" in fallen) == (kind == DECOY)


def test_the_hand_shapes_nothing_of_the_choice_a_tape_for_one_lane_is_lost_in_another():
    trained, moved = (TASK.draw(split, 0, 0).scenario for split in ("id", "outer_lanes"))
    assert trained.intact != moved.intact
    actions = run(trained, world(trained), trained.oracle, TASK.horizon).actions
    assert not replay(moved, world(moved), actions, TASK.horizon, until_settled=True).solved


# --- defects ----------------------------------------------------------------------------


@given(place=st.floats(0.0, 1.0), count=st.integers(3, 8), side=st.sampled_from([0, 1]), offset=st.floats(1.02, 2.5))
@settings(max_examples=50, deadline=None)
def test_place_and_offset_say_which_tile_stands_beside_the_chain_and_by_how_much(place, count, side, offset):
    scenario = DominoSelect(count=count, first=Defect(kind=GAP, place=place, side=side, offset=offset), order=0)
    k = scenario.wrong[0]
    lane = (k - LANES // 2) * scenario.lane
    aside = {i: scenario.pieces[f"tile_{k}_{i}"].across - lane for i in range(count)}
    out = [i for i, by in aside.items() if abs(by) > 1e-9]
    assert out == [1 + min(int(place * (count - 1)), count - 2)]
    assert aside[out[0]] == pytest.approx((1 if side else -1) * offset * scenario.tile.width)
    assert abs(aside[out[0]]) > scenario.tile.width, "it would still be struck"


@given(stretch=st.floats(1.02, 1.6), count=st.integers(3, 8), gap_ratio=st.floats(1.15, 1.9))
@settings(max_examples=50, deadline=None)
def test_a_drifting_chain_is_as_long_as_an_intact_one_and_each_space_wider_than_the_last(stretch, count, gap_ratio):
    scenario = DominoSelect(count=count, gap_ratio=gap_ratio, second=Defect(kind=DRIFT, stretch=stretch))
    refutation = scenario.infeasible()
    if refutation and "drift" in refutation.reason:
        assert stretch * scenario.tile.height >= count * scenario.gap
        return
    gaps = scenario.gaps(lane_of(scenario, DRIFT))
    assert sum(gaps) == pytest.approx(count * scenario.gap)
    assert gaps[-1] == pytest.approx(stretch * scenario.tile.height)
    assert all(wider / narrower == pytest.approx(gaps[1] / gaps[0]) for narrower, wider in itertools.pairwise(gaps))


def test_first_tiles_stand_in_one_row_and_slabs_in_another_whatever_is_wrong():
    rows = {"tile": set(), "slab": set()}
    for name, piece in EVERY_KIND.pieces.items():
        if name.endswith("_0") and name.startswith("tile"):
            rows["tile"].add(round(piece.along, 9))
        elif not name.startswith("tile"):
            rows["slab"].add(round(piece.along, 9))
    assert {kind: len(row) for kind, row in rows.items()} == {"tile": 1, "slab": 1}


def test_the_orders_deal_four_different_defects_in_24_ways():
    assert len({replace(EVERY_KIND, order=n).defects for n in range(24)}) == 24


# --- the certificate --------------------------------------------------------------------


def test_the_certificate_holds_the_end_of_every_wrong_chain_and_why_each_way_around_the_choice_fails():
    scenario = TASK.draw("id", 0, 0).scenario
    certificate = certify(scenario, TASK.horizon, CertifySettings(), TASK.embodiment).certificate
    assert certificate.verdict == "certified", certificate.reason
    ends = next(check for check in certificate.checks if check.name == "shortcuts").numbers
    assert {name: (end["outcome"], end["reason"]) for name, end in ends.items()} == {
        **{f"topple chain {k}": ("timeout", AT_REST) for k in scenario.wrong},
        "try a second chain": ("failure", "the robot touched a second chain"),
        "push a slab": ("failure", "the robot touched a slab"),
        "push the last tile": ("failure", "the robot touched a tile other than a first one"),
        "carry the first tile to the slab": ("failure", "the robot carried the first tile away"),
    }


@dataclass(frozen=True, kw_only=True)
class Mended(DominoSelect):
    """The tile that should be out of line stands in line, so that two chains work."""

    def build(self):
        scene, k = super().build(), lane_of(self, GAP)
        defect = self.defects[k]
        tile = scene.body(f"tile_{k}_{defect.broken(self.count)}")
        tile.pos = [0.0, -(2 * defect.side - 1) * defect.offset * self.tile.width, 0.0]  # in the frame of its place
        return scene


@dataclass(frozen=True, kw_only=True)
class Lawless(DominoSelect):
    """The robot may touch what it likes. A wrong chain still works as little as it should."""

    def failure(self, world):
        return None

    def shortcuts(self):
        return {name: plan for name, plan in super().shortcuts().items() if not name.startswith("topple")}


@dataclass(frozen=True, kw_only=True)
class Hidden(Mended):
    """As Mended, but a rule ends every try at a wrong chain before anybody sees that it works."""

    def failure(self, world):
        return super().failure(world) or next(
            (f"chain {k} is wrong" for k in self.wrong if world.touched("robot", f"tile_{k}_0")), None
        )


@dataclass(frozen=True, kw_only=True)
class AllBroken(DominoSelect):
    """The second tile of the intact chain is missing too: of 31, 8 and 31 mm a tile of 50 mm reaches none."""

    def build(self):
        scene = super().build()
        scene.delete(scene.body(f"tile_{self.intact}_1"))
        return scene

    def shortcuts(self):
        return {}


def test_a_wrong_chain_that_rocks_beyond_the_time_limit_is_seen_to_its_end():
    scenario = TASK.draw("narrow_lanes", 0, 48).scenario
    checks = certify(scenario, TASK.horizon, CertifySettings(), last="shortcuts").certificate.checks
    (check,) = (c for c in checks if c.name == "shortcuts")
    assert check.passed and check.numbers["topple chain 3"]["seconds"] > TASK.horizon


NEGATIVES = {
    "gap that is mended": (Mended(count=3), "shortcuts", "refuted", "'topple chain 0' reaches the goal"),
    "drift that slides across": (
        DominoSelect(second=Defect(kind=DRIFT, stretch=1.02)),
        "shortcuts",
        "refuted",
        "'topple chain 1' reaches the goal",
    ),
    "rule that hides what works": (
        Hidden(count=3),
        "shortcuts",
        "refuted",
        "was not seen to its end: chain 0 is wrong",
    ),
    "no rules": (Lawless(count=3), "shortcuts", "refuted", "'try a second chain' reaches the goal"),
    "no intact chain": (AllBroken(count=3), "solved", "unknown", "the oracle failed"),
    "gap of a tile's height": (DominoSelect(gap_ratio=2.1), "feasible", "refuted", "cannot reach its neighbour"),
    "gap that is no gap": (DominoSelect(gap_ratio=0.8), "feasible", "refuted", "reaches across the gap"),
    "drift longer than the chain": (
        DominoSelect(count=3, second=Defect(kind=DRIFT, stretch=1.9)),
        "feasible",
        "refuted",
        "more space than the chain has",
    ),
    "colour that tells": (
        DominoSelect(first=Defect(kind=DECOY), second=Defect(kind=DECOY), fourth=Defect(kind=DECOY)),
        "feasible",
        "refuted",
        "colour alone tells",
    ),
    "chains too close": (DominoSelect(lane=0.05), "feasible", "refuted", "stands in a neighbouring chain"),
    "chains over the edge": (DominoSelect(x=0.3), "feasible", "refuted", "leaves the table"),
    "first tile too far": (
        DominoSelect(count=3, x=0.28, y=0.15, heading=180.0),
        "feasible",
        "refuted",
        "out of reach",
    ),
}


@pytest.mark.parametrize("name", NEGATIVES)
def test_what_is_no_fair_choice_is_not_certified(name):
    scenario, check, verdict, says = NEGATIVES[name]
    certificate = certify(scenario, 6.0, CertifySettings(), TASK.embodiment).certificate
    assert (certificate.verdict, certificate.failed.name) == (verdict, check), certificate.reason
    assert says in certificate.reason


@pytest.mark.parametrize("plan", Lawless().shortcuts())
def test_every_way_around_the_choice_is_carried_out_well_enough_to_work_if_it_were_allowed(plan):
    scenario = Lawless(count=3)
    assert run(scenario, world(scenario), scenario.shortcuts()[plan], TASK.horizon).outcome == "success"


def test_without_the_intact_chain_the_push_that_worked_moves_no_slab():
    scenario = EVERY_KIND
    actions = run(scenario, world(scenario), scenario.oracle, TASK.horizon).actions
    (scene,) = scenario.ablations().values()
    maimed = World.load(scene_text.emit(scene)[0], TASK.embodiment)
    assert replay(scenario, maimed, actions, TASK.horizon, until_settled=True).reason == AT_REST


@given(
    count=st.integers(3, 8),
    gap_ratio=st.floats(0.2, 2.5),
    lane=st.floats(0.05, 0.15),
    heading=st.floats(-180.0, 180.0),
    intact=st.integers(0, LANES - 1),
    kinds=st.tuples(*[st.integers(GAP, MISSING)] * 4),
)
@settings(max_examples=40, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(
    count, gap_ratio, lane, heading, intact, kinds
):
    names = ("first", "second", "third", "fourth")
    scenario = with_values(
        DominoSelect(count=count, gap_ratio=gap_ratio, lane=lane, heading=heading, intact=intact),
        {f"{name}.kind": kind for name, kind in zip(names, kinds, strict=True)},
    )
    refutation = scenario.infeasible()
    if refutation is None:
        scenario.build().compile()
    else:
        assert refutation.reason and refutation.numbers


def test_a_tile_is_not_told_from_another_by_its_look():
    assert {piece.domino.rgba for name, piece in EVERY_KIND.pieces.items() if name.startswith("tile")} == {
        Domino().rgba
    }
