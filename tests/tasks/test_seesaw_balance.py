"""Only the place where the moments balance keeps the deck level; it is hidden, and the hand may not help."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from controls import ablated, load, missed, not_certified, play, play_shortcut, refuted, replayed, unchecked
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import load_task
from scengen.assets.box import Block
from scengen.assets.prop import place, table
from scengen.assets.seesaw import Seesaw
from scengen.attack.priors import fit
from scengen.look.looks import PLAIN
from scengen.params import parameters
from scengen.sim.arm import IDLE
from scengen.sim.world import World
from scengen.tasks.seesaw_balance import BEAM, MAX_TILT, TARGET_TOLERANCE, SeesawBalance
from scengen.validate.rebuilt import rebuild
from scengen.validate.rollout import run

TASK = load_task("seesaw_balance")
SPLITS = ["id", *TASK.axes]
STAYED = "the target stayed where it stood, untouched"
LIGHT, HEAVY = SeesawBalance(weight=Block(mass=0.14)), SeesawBalance(weight=Block(mass=0.35))


def laid(scenario, along, target_along):
    """The scene with both blocks on a deck that starts level [places along it in m]."""
    scene, yaw = table(), math.radians(scenario.heading)
    scene.option = SeesawBalance.build(scenario).option
    place(scene, scenario.seesaw, "seesaw", scenario.foot, yaw, free=False)
    place(scene, scenario.weight, "weight", scenario.on_deck(along, 0.0), yaw)
    place(scene, scenario.target, "target", scenario.on_deck(target_along, 0.0), yaw)
    return scene


def settled(scenario, along, target_along=None):
    """The world after 4 s without actions."""
    world = load(TASK, scenario, laid(scenario, along, scenario.offset if target_along is None else target_along))
    for _ in range(400):
        world.step(IDLE)
    return world


# --- statics ----------------------------------------------------------------------------


def test_the_balancing_place_is_the_textbooks():
    """m_t r_t = m_c r_c on a beam without weight: 250 g at 120 mm against 150 g at 200 mm."""
    balanced = SeesawBalance(offset=0.12, target=Block(mass=0.25), weight=Block(mass=0.15))
    assert balanced.balance == pytest.approx(-0.200)
    assert balanced.margin == pytest.approx(math.tan(math.radians(5)) * (0.35 * 0.066 + 0.4 * 0.035) / 0.15)


@pytest.mark.parametrize(("share", "level"), [(0.0, True), (-0.8, True), (0.8, True), (-1.25, False), (1.25, False)])
@pytest.mark.parametrize("split", ["id", "far_pivot", "heavy_beam", "own_arm"])
def test_within_the_margin_of_the_balancing_place_the_goal_holds_and_beyond_it_does_not(split, share, level):
    scenario = TASK.draw(split, 0, 3).scenario
    assert scenario.success(settled(scenario, scenario.balance + share * scenario.margin)) == level


def test_level_with_the_target_elsewhere_is_not_the_goal():
    moved = HEAVY.offset - TARGET_TOLERANCE - 0.005
    world = settled(HEAVY, replace(HEAVY, offset=moved).balance, moved)
    assert world.tilt(BEAM) < MAX_TILT and not HEAVY.success(world)


@pytest.mark.parametrize(("mass", "place"), [(0.06, 0), (0.9, -1)])
def test_where_it_is_refuted_that_any_place_balances_none_does(mass, place):
    """Tried at the outermost place that there is, and at the innermost."""
    scenario = SeesawBalance(weight=Block(mass=mass), seesaw=Seesaw(stop=25.0, height=0.19))
    assert refuted(scenario) == "no place on the deck balances with room to spare"
    (span,) = scenario.spans(-1)
    assert settled(scenario, span[place]).tilt(BEAM) > MAX_TILT


@given(
    offset=st.floats(-0.35, 0.35),
    pivot=st.floats(-0.1, 0.1),
    beam=st.floats(0.2, 0.8),
    masses=st.tuples(st.floats(0.02, 1.0), st.floats(0.02, 1.0)),
)
@settings(max_examples=60, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_has_room_to_balance(offset, pivot, beam, masses):
    target, weight = (Block(mass=mass) for mass in masses)
    scenario = SeesawBalance(offset=offset, seesaw=Seesaw(mass=beam, pivot_offset=pivot), target=target, weight=weight)
    if scenario.infeasible():
        assert refuted(scenario)
        return
    assert math.isclose(scenario.tilt_at(scenario.balance), 0.0, abs_tol=1e-9)
    assert abs(scenario.tilt_at(scenario.balance + scenario.margin)) == pytest.approx(MAX_TILT, rel=1e-6)


def test_no_fixed_place_balances_a_tenth_of_training_and_no_three_a_fifth():
    """Given the raised arm and the place of the target; fitted on 400 draws, measured on as many others."""
    scenarios = [TASK.draw("id", 0, i).scenario for i in range(800)]
    one, two, three = fit(scenarios[:400], fresh=scenarios[400:])
    assert 0.0 < one.fresh <= one.bound <= 0.10 and one.fresh < two.fresh < three.fresh <= three.bound <= 0.20


def test_the_mass_of_the_counterweight_alone_does_not_help():
    """The lever law with the true mass of the counterweight, and the middle of training for the other masses."""
    scenarios = [TASK.draw("id", 1, i).scenario for i in range(400)]
    known = [replace(s, seesaw=replace(s.seesaw, mass=0.26), target=Block(mass=0.35)).balance for s in scenarios]
    balanced = [abs(s.balance - at) <= s.margin for s, at in zip(scenarios, known, strict=True)]
    assert 0.0 < np.mean(balanced) <= 0.10


def test_the_target_stands_to_the_left_and_to_the_right_in_training():
    sides = [math.copysign(1.0, TASK.draw("id", 0, i).scenario.heading) for i in range(60)]
    assert 20 < sides.count(1.0) < 40


# --- hidden masses ----------------------------------------------------------------------


def test_scenes_that_differ_in_masses_only_are_the_same_to_the_eye():
    """Only masses and their consequences may differ in the compiled model: no size, colour, place, name or texture."""
    one = SeesawBalance()
    other = replace(
        one,
        seesaw=replace(one.seesaw, mass=0.2),
        target=replace(one.target, mass=0.4),
        weight=replace(one.weight, mass=0.6),
    )
    worlds = [World.load(rebuild(s), TASK.embodiment, look=PLAIN) for s in (one, other)]
    a, b = (world.model for world in worlds)
    assert a.names == b.names and not (a.cam_mode.any() or a.light_mode.any()), "no camera follows a centre of mass"
    arrays = {name: (getattr(a, name), getattr(b, name)) for name in dir(a)}
    arrays = {name: both for name, both in arrays.items() if isinstance(both[0], np.ndarray)}
    differ = {n for n, (x, y) in arrays.items() if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")}
    assert len(arrays) > 300 and {"body_mass", "body_inertia"} <= differ
    weights = {"mass", "inertia", "subtreemass", "invweight0", "M0", "poscom0"}
    assert {name.partition("_")[2] for name in differ} <= weights, differ
    assert np.array_equal(worlds[0].data.qpos, worlds[1].data.qpos)


def test_every_mass_is_declared_hidden_and_drawn_at_random():
    owners = ("seesaw", "target", "weight")
    masses = {p.name for p in parameters(SeesawBalance()) if p.name.endswith("mass")}
    assert masses == {p.name for p in parameters(SeesawBalance()) if p.hidden} == {f"{n}.mass" for n in owners}
    drawn = [TASK.draw("id", 0, i).scenario for i in range(20)]
    assert all(len({getattr(s, name).mass for s in drawn}) == 20 for name in owners)


def test_blocks_and_beam_look_alike_in_every_split():
    looks = set()
    for scenario in (TASK.draw(split, 0, i).scenario for split in SPLITS for i in range(4)):
        blocks, deck = (scenario.target, scenario.weight), scenario.seesaw
        looks.add((*((b.width, b.height, b.rgba) for b in blocks), deck.thickness, deck.rgba))
    assert len(looks) == 1


@pytest.mark.parametrize("scenario", [LIGHT, HEAVY], ids=["light", "heavy"])
def test_which_arm_is_raised_is_seen_but_not_where_the_counterweight_belongs(scenario):
    assert load(TASK, scenario).tilt(BEAM) == pytest.approx(math.radians(scenario.seesaw.stop), abs=1e-4)


@pytest.mark.parametrize("scenario", [LIGHT, HEAVY], ids=["light", "heavy"])
def test_the_oracle_reads_no_mass_and_puts_the_counterweight_more_than_once(scenario, monkeypatch):
    """With wrong masses as parameters, it does the same to the bit."""
    tries, put_at = [], SeesawBalance.put_at

    def counted(self, world, along):
        tries.append(along)
        yield from put_at(self, world, along)

    monkeypatch.setattr(SeesawBalance, "put_at", counted)
    misled = replace(scenario, seesaw=Seesaw(mass=0.7), target=Block(mass=0.9), weight=Block(mass=0.05))
    world = load(TASK, scenario)
    rollout = play(TASK, scenario, misled.oracle, world)
    assert rollout.solved and len(tries) > 1
    assert abs(scenario.along(world, "weight") - scenario.balance) < scenario.margin
    assert np.array_equal(rollout.actions, play(TASK, scenario, scenario.oracle).actions)


def test_memorised_actions_are_lost_where_masses_are_others():
    trained, shifted = (TASK.draw(split, 0, 1).scenario for split in ("id", "heavy_target"))
    assert not replayed(TASK, trained, shifted).solved


# --- goal -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Lenient(SeesawBalance):
    """The goal is a level deck and nothing else: it may be held."""

    def success(self, world):
        return world.tilt(BEAM) <= MAX_TILT

    def means(self):
        return {}


LENIENT = Lenient(weight=HEAVY.weight)


def test_the_deck_sweeps_through_level_on_its_way_and_that_does_not_count():
    seen = []

    @dataclass(frozen=True, kw_only=True)
    class Watched(SeesawBalance):
        def success(self, world):
            seen.append(super().success(world))
            return seen[-1]

    rollout = play_shortcut(TASK, Watched(weight=HEAVY.weight), "mirror_the_target")
    assert any(seen) and not seen[-1] and rollout.outcome == "timeout"


def test_held_level_by_hand_is_level_and_does_not_count():
    assert play_shortcut(TASK, LENIENT, "hold_the_deck_level").solved
    assert not play_shortcut(TASK, HEAVY, "hold_the_deck_level").solved


def test_without_the_counterweight_the_witness_levels_nothing():
    ((_, world),) = ablated(TASK, HEAVY).values()
    assert world.tilt(BEAM) > MAX_TILT
    assert not replayed(TASK, HEAVY, LENIENT, load(TASK, HEAVY, *HEAVY.ablations().values())).solved


def test_a_target_that_falls_on_the_table_did_not_stay():
    assert missed(SeesawBalance(), settled(SeesawBalance(), -0.1, 0.33), STAYED)


@pytest.mark.parametrize("index", range(2))
def test_moving_the_target_levels_what_a_guess_has_missed_but_it_must_stay(index):
    scenario = TASK.draw("id", 0, index).scenario
    shift = scenario.shortcuts()["shift_the_target"].plan
    free = run(scenario, load(TASK, scenario), shift, TASK.horizon, rules="paper")
    assert free.solved and STAYED in free.lacks
    ended = play_shortcut(TASK, scenario, "shift_the_target")
    assert ended.outcome == "failure" and STAYED in ended.reason


# --- scenes that must not be certified --------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Levelled(SeesawBalance):
    """The counterweight stands where it belongs from the start."""

    def build(self):
        return laid(self, self.balance, self.offset)


@dataclass(frozen=True, kw_only=True)
class Impatient(SeesawBalance):
    """The oracle puts the counterweight once and is done."""

    def oracle(self, world):
        yield from self.put_at(world, self.guess)

    def shortcuts(self):
        return {}


slippery = replace(
    HEAVY, seesaw=Seesaw(friction=0.1), target=Block(friction=0.1), weight=Block(mass=0.35, friction=0.1)
)
REFUTED = {
    "no place on the deck balances": replace(HEAVY, weight=Block(mass=0.06)),
    "no place on the deck balances with": replace(HEAVY, weight=Block(mass=0.9)),
    "the raised arm has no room": replace(HEAVY, seesaw=Seesaw(length=0.25, pivot_offset=-0.1)),
    "the target has no room on its arm": SeesawBalance(offset=0.3),
    "the mirror image of the target's place": SeesawBalance(weight=Block(mass=0.25)),
    "the first guess balances": SeesawBalance(
        target=Block(mass=0.25), weight=Block(mass=0.25), seesaw=Seesaw(mass=0.25, pivot_offset=-0.045)
    ),
    "not on its stop at the start": SeesawBalance(
        target=Block(mass=0.25), seesaw=Seesaw(mass=0.5, pivot_offset=0.058), weight=Block(mass=0.05)
    ),
    "strikes the table": replace(HEAVY, seesaw=Seesaw(height=0.05)),
    "leaves the table": replace(HEAVY, weight_x=-0.37),
    "beside the seesaw": replace(HEAVY, weight_x=-0.1),
    "slide on the tilted deck": slippery,
    "is out of reach": replace(HEAVY, weight_x=0.33, weight_y=0.3),
}


@pytest.mark.parametrize("reason", REFUTED)
def test_an_invalid_scenario_is_refuted_with_its_reason(reason):
    assert reason in refuted(REFUTED[reason])


@pytest.mark.parametrize(
    ("scenario", "check", "reason"),
    [
        (Levelled(weight=HEAVY.weight), "unsolved", "the goal holds"),
        (unchecked(SeesawBalance)(weight=Block(mass=0.25)), "shortcuts", "mirror_the_target"),
        (LENIENT, "shortcuts", "hold_the_deck_level"),
        (Impatient(weight=HEAVY.weight), "solved", "the oracle failed"),
    ],
    ids=["level from the start", "mirror that works", "hand that may stay", "no second try"],
)
def test_what_solves_itself_or_cannot_be_solved_is_not_certified(scenario, check, reason):
    verdict = not_certified(TASK, scenario, check, reason).verdict
    assert verdict == ("unknown" if check == "solved" else "refuted")
