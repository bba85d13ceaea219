"""Only the intact chain reaches the red slab, by physics and not by rule; an unfair choice gets no certificate."""

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from controls import (
    ablated,
    builds_or_is_refuted,
    each_refuted_for_its_own_reason,
    load,
    not_certified,
    play_shortcut,
    replayed,
)
from helpers import other_under_mujoco_4, shift
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import load_task
from scengen.assets.box import Domino
from scengen.assets.chain import DECOY, DRIFT, GAP, MISSING, Defect
from scengen.attack.priors import fit
from scengen.episode import OTHERWISE
from scengen.params import with_values
from scengen.tasks.domino_select import LANES, RED_LANES, SLAB_DISPLACEMENT, DominoSelect
from scengen.validate.rebuilt import rebuild
from scengen.validate.rollout import AT_REST, REST_TOLERANCE

TASK = load_task("domino_select")
SPLITS = ["id", *TASK.axes]
EVERY_KIND = DominoSelect(third=Defect(kind=MISSING, place=0.6), count=3)
"""One chain with each kind of defect."""


def lane_of(scenario, kind):
    return next(k for k in scenario.wrong if scenario.defects[k].kind == kind)


def strike(scenario, k, spin, rest=REST_TOLERANCE):
    """Give the first tile of chain `k` a spin [rad/s], without robot, and simulate until nothing is faster than `rest`.

    Returns how far the red slab has gone [m].
    """
    model = mujoco.MjModel.from_xml_string(rebuild(scenario))
    data = mujoco.MjData(model)
    data.qvel[model.joint(f"tile_{k}_0_free").dofadr[0] + 4] = spin
    geoms = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, f"tile_{k}_{i}/box") for i in (0, 1))
    pair, still, met = sorted(geoms), 0, False  # a tile that is missing is -1, and meets nothing
    while still < 10:
        for _ in range(5):
            mujoco.mj_step(model, data)
            met |= bool((np.sort(data.contact.geom) == pair).all(axis=1).any())
        still = still + 1 if np.abs(data.qvel).max() < rest else 0
        assert data.time < 8.0, "it does not come to rest"
    lies = data.body(f"tile_{k}_0").xmat[8] < math.cos(math.radians(45))
    low = scenario.starter.height < scenario.tile.height  # may rock back from a tall neighbour that stands near
    assert lies or (low and met), "the first tile has not fallen"
    return math.dist(data.body("slab").xipos[:2], scenario.feet["slab"][:2])


# --- the law of the task ----------------------------------------------------------------


LASTS = other_under_mujoco_4("the last tile comes to rest after 8.01 instead of at most 8 s")


@pytest.mark.parametrize(
    ("split", "speed"),
    [("subtle", 0.275), *(pytest.param(s, 0.4, marks=LASTS if s == "low_starter" else ()) for s in SPLITS)],
)
def test_however_hard_its_first_tile_is_struck_only_the_intact_chain_reaches_the_red_slab(split, speed):
    """The hand strikes the top of a tile with up to 0.4 m/s, 8 rad/s at 50 mm; below 5 rad/s one may rock back."""
    scenario = TASK.draw(split, 0, 1).scenario
    spin = speed / scenario.starter.height
    # three low tiles, fallen on one another, rock by 1.4 mrad/s
    rest = 3 * REST_TOLERANCE if split == "low_tiles" else REST_TOLERANCE
    reached = [k for k in range(LANES) if strike(scenario, k, spin, rest) >= SLAB_DISPLACEMENT]
    assert reached == [scenario.intact_lane]


@pytest.mark.parametrize("gap_ratio", [0.9, 1.2, 1.5, 1.8])
def test_a_chain_stays_intact_as_long_as_its_spaces_are_shorter_than_a_tile_is_tall(gap_ratio):
    """The textbook's reach of a falling tile is its height: 50 mm; the widest space here is 45 mm."""
    scenario = DominoSelect(gap_ratio=gap_ratio, count=3)
    assert strike(scenario, scenario.intact_lane, 6.0) >= SLAB_DISPLACEMENT


@pytest.mark.parametrize(("stretch", "reaches"), [(1.02, True), (1.07, False), (1.15, False)])
def test_the_reach_of_a_falling_tile_is_its_height_and_the_two_millimetres_by_which_it_slides(stretch, reaches):
    scenario = DominoSelect(second=Defect(kind=DRIFT, stretch=stretch))
    assert (strike(scenario, lane_of(scenario, DRIFT), 6.0) >= SLAB_DISPLACEMENT) == reaches


@pytest.mark.parametrize("kind", [GAP, DRIFT, DECOY, MISSING])
def test_a_push_at_a_wrong_chain_is_watched_until_all_is_still_and_no_rule_ends_it_before(kind):
    scenario, w = EVERY_KIND, load(TASK, EVERY_KIND)
    k = lane_of(scenario, kind)
    ended = play_shortcut(TASK, scenario, f"topple_chain_{k}", w)
    assert (ended.outcome, ended.reason) == ("timeout", AT_REST) and ended.seconds < TASK.horizon - 2.0
    assert w.tilt(f"tile_{k}_0") > math.radians(45) and np.abs(w.data.qvel).max() < REST_TOLERANCE
    fallen = [name for name in scenario.feet if w.tilt(name) > math.radians(45)]
    assert {name.split("_")[1] for name in fallen if name.startswith("tile")} == {str(k)}
    assert ("decoy" in fallen) == (kind == DECOY) and "slab" not in fallen


def test_a_wrong_chain_that_falls_beyond_the_time_limit_is_seen_to_its_end():
    """Two leaning tiles may rock for as long as 14 s."""
    hurried = replace(TASK, horizon=2.0)
    ended = play_shortcut(hurried, EVERY_KIND, f"topple_chain_{EVERY_KIND.wrong[0]}")
    assert ended.reason == AT_REST and ended.seconds > hurried.horizon


def test_the_witness_of_one_lane_is_lost_in_another():
    one = TASK.draw("id", 0, 0).scenario
    other = next(s for s in (TASK.draw("id", 0, i).scenario for i in range(1, 20)) if s.intact_lane != one.intact_lane)
    assert not replayed(TASK, one, other).solved


def test_without_the_intact_chain_the_push_that_worked_moves_no_slab():
    ((ended, _),) = ablated(TASK, EVERY_KIND).values()
    assert ended.reason == AT_REST


# --- chance -------------------------------------------------------------------------------


def test_no_lane_is_right_more_often_than_another():
    """The best of 600 draws, on 600 others: 1 of 4, and as much more as chance may give with a probability of 5 %."""
    scenarios = [TASK.draw("id", 0, i).scenario for i in range(1200)]
    (best,) = fit(scenarios[:600], fresh=scenarios[600:])
    assert len(best.values) == 1 and 0.20 < best.fresh <= best.bound <= 0.30


def test_the_side_of_the_decoy_does_not_tell_the_intact_chain():
    """By its distance from the blue slab: whichever of the four lanes is chosen, it is right in 1 of 4."""
    found = []
    for scenario in (TASK.draw("id", 1, i).scenario for i in range(600)):
        (blue,) = (k for k, defect in enumerate(scenario.defects) if defect and defect.kind == DECOY)
        assert blue in (0, LANES - 1)
        found.append([abs(scenario.intact_lane - blue) == away for away in range(1, LANES)])
    assert np.abs(np.mean(found, axis=0) - 1 / RED_LANES).max() < 3 * math.sqrt(0.25 * 0.75 / len(found))


@pytest.mark.parametrize("split", SPLITS)
def test_there_is_one_red_slab_and_one_blue_one_and_colour_tells_the_chain_that_leads_astray_alone(split):
    """The red slab stands before all other first tiles; the blue one before none of them."""
    for scenario in (TASK.draw(split, 2, i).scenario for i in range(5)):
        model, across = scenario.build().compile(), np.cross([0.0, 0.0, 1.0], scenario.u)
        slabs = [name for name in scenario.feet if not name.startswith("tile")]
        assert sorted(slabs) == ["decoy", "slab"]
        assert model.geom("slab/box").rgba[0] > 0.7 > 0.2 > model.geom("decoy/box").rgba[0]
        (blue,) = (k for k, chain in enumerate(scenario.lanes.chains) if chain.astray)
        for name in slabs:
            reached = [
                k
                for k in range(LANES)
                if abs((scenario.feet[f"tile_{k}_0"] - scenario.feet[name]) @ across)
                <= (scenario.lanes.piece(name).width - scenario.tile.width) / 2
            ]
            assert reached == ([blue] if name == "decoy" else [k for k in range(LANES) if k != blue])


# --- what can be seen ---------------------------------------------------------------------


def test_first_tiles_stand_in_one_row_and_slabs_in_another_whatever_is_wrong():
    along = {name: round(float(foot @ EVERY_KIND.u), 9) for name, foot in EVERY_KIND.feet.items()}
    assert len({x for name, x in along.items() if name.startswith("tile") and name.endswith("_0")}) == 1
    assert len({x for name, x in along.items() if not name.startswith("tile")}) == 1


def test_tiles_of_all_chains_look_the_same():
    model = EVERY_KIND.build().compile()
    looks = {name: tuple(model.geom(f"{name}/box").rgba) for name in EVERY_KIND.feet if name.startswith("tile")}
    assert {look for name, look in looks.items() if name.endswith("_0")} == {tuple(np.float32(EVERY_KIND.starter.rgba))}
    assert {look for name, look in looks.items() if not name.endswith("_0")} == {tuple(np.float32(Domino().rgba))}


def test_the_orders_deal_three_different_defects_in_six_ways():
    assert len({replace(EVERY_KIND, order=n).defects for n in range(6)}) == 6


# --- ways around the choice ---------------------------------------------------------------


ALONE = "the robot touched the first tile of the intact chain alone"
IN_PLACE, CASCADE = "that tile fell where it stood", "each tile of that chain struck the next"
BYPASSES = {
    "try_a_second_chain": ALONE,
    "push_a_slab": f"{ALONE}; {CASCADE}",
    "push_the_last_tile": f"{ALONE}; {CASCADE}",
    "carry_the_first_tile_to_the_slab": f"{IN_PLACE}; {CASCADE}",
}


@pytest.mark.parametrize("name", BYPASSES)
def test_every_way_around_the_choice_reaches_the_goal_and_lacks_means(name):
    ended = play_shortcut(TASK, DominoSelect(count=3), name)
    assert (ended.outcome, ended.reason) == ("failure", f"{OTHERWISE}: {BYPASSES[name]}")


# --- scenes that must not be certified ---------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Mended(DominoSelect):
    """The tile that should be out of line stands in line, so that two chains work."""

    def build(self):
        scene, k = super().build(), lane_of(self, GAP)
        defect = self.defects[k]
        tile = scene.body(f"tile_{k}_{defect.broken(self.count)}")
        shift(tile, [0.0, -(2 * defect.side - 1) * defect.offset * self.tile.width, 0.0])
        return scene


@dataclass(frozen=True, kw_only=True)
class Hidden(Mended):
    """As Mended, but a rule ends every attempt at a wrong chain before it can succeed."""

    def failure(self, world):
        touched = (k for k in self.wrong if world.touched("robot", f"tile_{k}_0"))
        return super().failure(world) or next((f"chain {k} is wrong" for k in touched), None)


@dataclass(frozen=True, kw_only=True)
class AllBroken(DominoSelect):
    """The second tile of the intact chain is missing too: of 31, 8 and 31 mm a tile of 50 mm reaches none."""

    def build(self):
        scene = super().build()
        scene.delete(scene.body(f"tile_{self.intact_lane}_1"))
        return scene

    def shortcuts(self):
        return {}


NEGATIVES = {
    "gap that is mended": (
        Mended(count=3),
        "shortcuts",
        f"'topple_chain_0' reaches the goal (filtered): {OTHERWISE}",
    ),
    "drift that slides across": (
        DominoSelect(second=Defect(kind=DRIFT, stretch=1.02)),
        "shortcuts",
        f"'topple_chain_1' reaches the goal (filtered): {OTHERWISE}",
    ),
    "rule that hides what works": (
        Hidden(count=3),
        "shortcuts",
        "was not seen to its end (filtered): chain 0 is wrong",
    ),
    "no intact chain": (AllBroken(count=3), "solved", "the oracle failed"),
}


@pytest.mark.parametrize("name", NEGATIVES)
def test_what_is_no_fair_choice_is_not_certified(name):
    not_certified(TASK, *NEGATIVES[name])


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            DominoSelect(gap_ratio=2.1),
            DominoSelect(gap_ratio=0.8),
            DominoSelect(count=3, second=Defect(kind=DRIFT, stretch=1.9)),
            DominoSelect(first=Defect(kind=DECOY)),
            DominoSelect(lane=0.05),
            DominoSelect(x=0.3),
            DominoSelect(count=3, x=0.28, y=0.15, heading=180.0),
        ]
    )


@given(
    count=st.integers(3, 8),
    gap_ratio=st.floats(0.2, 2.5),
    lane=st.floats(0.05, 0.15),
    heading=st.floats(-180.0, 180.0),
    intact=st.integers(0, RED_LANES - 1),
    kinds=st.tuples(*[st.integers(GAP, MISSING)] * 3),
)
@settings(max_examples=40, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_can_be_built(
    count, gap_ratio, lane, heading, intact, kinds
):
    scenario = DominoSelect(count=count, gap_ratio=gap_ratio, lane=lane, heading=heading, intact=intact)
    defects = zip(("first", "second", "third"), kinds, strict=True)
    builds_or_is_refuted(with_values(scenario, {f"{name}.kind": kind for name, kind in defects}))
