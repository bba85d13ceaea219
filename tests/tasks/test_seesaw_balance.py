"""Only the place where the moments balance keeps the deck level; nobody can see it, and hands off is what counts."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scengen import config
from scengen.assets.box import Block
from scengen.assets.prop import UP, place, table
from scengen.assets.seesaw import Seesaw
from scengen.params import parameters
from scengen.sim import scene_text
from scengen.sim.world import IDLE, World
from scengen.tasks.seesaw_balance import BEAM, LEVEL, MOVED, STAYS, SeesawBalance
from scengen.validate.certify import certify
from scengen.validate.rollout import replay, run
from scengen.validate.settings import CertifySettings

TASK = config.task("seesaw_balance")
SPLITS = ["id", *TASK.axes]
NAMES = ("seesaw", "target", "weight")
LIGHT, HEAVY = Block(mass=0.14), Block(mass=0.35)


def world(scenario, visual=False):
    return World.load(scene_text.emit(scenario.build())[0], TASK.embodiment, visual=visual)


def play(scenario, plan, w=None):
    return run(scenario, w or world(scenario), plan, TASK.horizon, until_settled=True)


def laid(scenario, along, target_along=None):
    """The scene with both blocks on a deck that starts level [places along it in m]."""
    scene, yaw = table(), math.radians(scenario.heading)
    deck = scenario.foot + scenario.seesaw.height * UP
    target_along = scenario.offset if target_along is None else target_along
    place(scene, scenario.seesaw, "seesaw", scenario.foot, yaw, free=False)
    place(scene, scenario.weight, "weight", deck + along * scenario.s, yaw)
    place(scene, scenario.target, "target", deck + target_along * scenario.s, yaw)
    return scene


def settled(scenario, along, target_along=None):
    """The world after 4 s in which nobody acts."""
    w = World.load(scene_text.emit(laid(scenario, along, target_along))[0], TASK.embodiment)
    for _ in range(400):
        w.step(IDLE)
    return w


# --- statics ----------------------------------------------------------------------------


def test_the_balancing_place_is_the_textbooks():
    """m_t r_t = m_c r_c on a beam without weight: 250 g at 120 mm against 150 g at 200 mm."""
    balanced = SeesawBalance(offset=0.12, target=Block(mass=0.25), weight=Block(mass=0.15))
    assert balanced.balance == pytest.approx(-0.200)
    assert balanced.margin == pytest.approx(math.tan(math.radians(5)) * (0.35 * 0.066 + 0.4 * 0.035) / 0.15)


@pytest.mark.parametrize(("share", "level"), [(0.0, True), (-0.8, True), (0.8, True), (-1.25, False), (1.25, False)])
@pytest.mark.parametrize("split", ["id", "far_pivot", "heavy_beam", "other_arm"])
def test_within_the_margin_of_the_balancing_place_the_goal_holds_and_beyond_it_does_not(split, share, level):
    scenario = TASK.draw(split, 0, 3).scenario
    assert scenario.success(settled(scenario, scenario.balance + share * scenario.margin)) == level


def test_level_with_the_target_elsewhere_is_not_the_goal():
    scenario = SeesawBalance(weight=HEAVY)
    moved = scenario.offset - STAYS - 0.005
    w = settled(scenario, replace(scenario, offset=moved).balance, moved)
    assert w.tilt(BEAM) < LEVEL and not scenario.success(w)


@pytest.mark.parametrize(("mass", "level"), [(0.20, True), (0.19, False)])
def test_where_it_is_refuted_that_a_nudge_levels_the_deck_it_does(mass, level):
    """The counterweight in the mirror image, the target brought as near to the axle as `MOVED` says."""
    scenario = SeesawBalance(weight=Block(mass=mass))
    w = settled(scenario, scenario.mirror, scenario.offset - MOVED)
    assert (w.tilt(BEAM) < LEVEL) == level == (scenario.infeasible() is not None)


@pytest.mark.parametrize("weight", [LIGHT, HEAVY])
def test_which_arm_is_raised_is_seen_but_not_where_the_counterweight_belongs(weight):
    scenario = SeesawBalance(weight=weight)
    assert world(scenario).tilt(BEAM) == pytest.approx(math.radians(scenario.seesaw.stop), abs=1e-4)


# --- hidden masses ----------------------------------------------------------------------


def test_scenes_that_differ_in_masses_only_are_the_same_to_the_eye():
    """Of everything in the compiled model only what weighs may differ: no size, colour, place, name or texture."""
    one = SeesawBalance()
    other = replace(
        one,
        seesaw=replace(one.seesaw, mass=0.2),
        target=replace(one.target, mass=0.4),
        weight=replace(one.weight, mass=0.6),
    )
    a, b = (world(s, visual=True).model for s in (one, other))
    assert a.names == b.names and not (a.cam_mode.any() or a.light_mode.any()), "no camera follows a centre of mass"
    arrays = {name: (getattr(a, name), getattr(b, name)) for name in dir(a)}
    arrays = {name: both for name, both in arrays.items() if isinstance(both[0], np.ndarray)}
    differ = {n for n, (x, y) in arrays.items() if not np.array_equal(x, y, equal_nan=x.dtype.kind == "f")}
    assert len(arrays) > 300 and {"body_mass", "body_inertia"} <= differ
    weights = {"mass", "inertia", "subtreemass", "invweight0", "M0", "poscom0"}
    assert {name.partition("_")[2] for name in differ} <= weights, differ
    assert np.array_equal(world(one).data.qpos, world(other).data.qpos)


def test_every_mass_is_declared_hidden_and_drawn_at_random():
    masses = {p.name for p in parameters(SeesawBalance()) if p.name.endswith("mass")}
    assert masses == {p.name for p in parameters(SeesawBalance()) if p.hidden} == {f"{n}.mass" for n in NAMES}
    drawn = [TASK.draw("id", 0, i).scenario for i in range(20)]
    assert all(len({getattr(s, name).mass for s in drawn}) == 20 for name in NAMES)


def test_blocks_and_beam_look_alike_in_every_split():
    looks = set()
    for split in SPLITS:
        for index in range(4):
            s = TASK.draw(split, 0, index).scenario
            looks.add((*((b.width, b.height, b.rgba) for b in (s.target, s.weight)), s.seesaw.thickness, s.seesaw.rgba))
    assert len(looks) == 1


@pytest.mark.parametrize("weight", [LIGHT, HEAVY])
def test_the_oracle_reads_no_mass_and_puts_the_counterweight_more_than_once(weight, monkeypatch):
    """Told wrong masses, it does the same to the bit."""
    scenario = SeesawBalance(weight=weight)
    misled = replace(scenario, seesaw=Seesaw(mass=0.7), target=Block(mass=0.9), weight=Block(mass=0.05))
    tries = []
    put = SeesawBalance.put

    def counted(self, world, along):
        tries.append(along)
        yield from put(self, world, along)

    monkeypatch.setattr(SeesawBalance, "put", counted)
    w = world(scenario)
    honest = play(scenario, scenario.oracle, w)
    assert honest.solved and len(tries) > 1
    assert abs(scenario.along(w, "weight") - scenario.balance) < scenario.margin
    assert np.array_equal(play(scenario, misled.oracle, w).actions, honest.actions)


def test_a_memorised_tape_is_lost_where_masses_are_others():
    trained, moved = (TASK.draw(split, 0, 1).scenario for split in ("id", "heavy_target"))
    actions = play(trained, trained.oracle).actions
    assert not replay(moved, world(moved), actions, TASK.horizon, until_settled=True).solved


# --- goal -------------------------------------------------------------------------------


def test_the_deck_sweeps_through_level_on_its_way_and_that_does_not_count():
    scenario, seen = SeesawBalance(weight=HEAVY), []

    @dataclass(frozen=True, kw_only=True)
    class Watched(SeesawBalance):
        def success(self, world):
            seen.append(super().success(world))
            return seen[-1]

    watched = Watched(weight=HEAVY)
    episode = play(watched, scenario.shortcuts()["mirror the target"])
    assert any(seen) and not seen[-1] and episode.outcome == "timeout"


@dataclass(frozen=True, kw_only=True)
class ByHand(SeesawBalance):
    """CertifySettings counts whoever holds it."""

    def success(self, world):
        return world.tilt(BEAM) <= LEVEL


def test_held_level_by_hand_is_level_and_does_not_count():
    plan = SeesawBalance(weight=HEAVY).shortcuts()["hold the deck level"]
    assert play(ByHand(weight=HEAVY), plan).solved and not play(SeesawBalance(weight=HEAVY), plan).solved


def test_without_the_counterweight_the_witness_levels_nothing():
    scenario = SeesawBalance(weight=HEAVY)
    (scene,) = scenario.ablations().values()

    @dataclass(frozen=True, kw_only=True)
    class Lenient(SeesawBalance):
        """Asks for a level deck and nothing else."""

        def success(self, world):
            return world.tilt(BEAM) <= LEVEL

    actions = play(scenario, scenario.oracle).actions
    maimed = World.load(scene_text.emit(scene)[0], TASK.embodiment)
    assert not replay(Lenient(weight=HEAVY), maimed, actions, TASK.horizon, until_settled=True).solved


# --- scenes that must not be certified --------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Unchecked(SeesawBalance):
    """Nobody has done the sums."""

    def infeasible(self):
        return None


@dataclass(frozen=True, kw_only=True)
class Levelled(SeesawBalance):
    """The counterweight stands where it belongs from the start."""

    def build(self):
        return laid(self, self.balance)


@dataclass(frozen=True, kw_only=True)
class Impatient(SeesawBalance):
    """The oracle puts the counterweight once and has done with it."""

    def oracle(self, world):
        yield from self.put(world, self.expected(-1))

    def shortcuts(self):
        return {}


NEGATIVES = {
    "counterweight too light": (SeesawBalance(weight=Block(mass=0.06)), "feasible", "no place on the deck balances"),
    "counterweight too heavy": (SeesawBalance(weight=Block(mass=0.9)), "feasible", "no place on the deck balances"),
    "raised arm too short": (
        SeesawBalance(weight=HEAVY, seesaw=Seesaw(length=0.25, pivot_offset=-0.1)),
        "feasible",
        "the raised arm has no room",
    ),
    "target beyond the end": (SeesawBalance(offset=0.3), "feasible", "the target has no room on its arm"),
    "equal masses": (SeesawBalance(weight=Block(mass=0.25)), "feasible", "the mirror image of the target's place"),
    "nearly equal masses": (SeesawBalance(weight=Block(mass=0.20)), "feasible", "once the target is nudged"),
    "masses as expected": (
        SeesawBalance(target=Block(mass=0.22), weight=Block(mass=0.22), seesaw=Seesaw(mass=0.28, pivot_offset=-0.045)),
        "feasible",
        "the first guess balances",
    ),
    "balanced by its beam": (
        SeesawBalance(target=Block(mass=0.25), seesaw=Seesaw(mass=0.5, pivot_offset=0.058), weight=Block(mass=0.05)),
        "feasible",
        "not on its stop at the start",
    ),
    "deck near the table": (SeesawBalance(weight=HEAVY, seesaw=Seesaw(height=0.05)), "feasible", "strikes the table"),
    "counterweight in the way": (SeesawBalance(weight=HEAVY, weight_x=-0.1), "feasible", "beside the seesaw"),
    "slippery deck": (
        SeesawBalance(seesaw=Seesaw(friction=0.1), target=Block(friction=0.1), weight=Block(mass=0.35, friction=0.1)),
        "feasible",
        "slide on the tilted deck",
    ),
    "out of reach": (SeesawBalance(weight=HEAVY, weight_x=0.33, weight_y=0.3), "feasible", "is out of reach"),
    "level from the start": (Levelled(weight=HEAVY), "unsolved", "the goal holds"),
    "mirror that works": (Unchecked(weight=Block(mass=0.25)), "shortcuts", "'mirror the target' reaches the goal"),
    "hand that may stay": (ByHand(weight=HEAVY), "shortcuts", "'hold the deck level' reaches the goal"),
    "no second try": (Impatient(weight=HEAVY), "solved", "the oracle failed"),
}


@pytest.mark.parametrize("name", NEGATIVES)
def test_what_is_no_fair_problem_is_not_certified(name):
    scenario, check, says = NEGATIVES[name]
    certificate = certify(scenario, TASK.horizon, CertifySettings(), TASK.embodiment).certificate
    assert certificate.failed is not None and says in certificate.reason, certificate.reason
    verdict = "unknown" if check == "solved" else "refuted"
    assert (certificate.verdict, certificate.failed.name) == (verdict, check)


@pytest.mark.parametrize(("mass", "end"), [(0.06, -1), (0.9, 0)])
def test_where_it_is_refuted_that_any_place_balances_none_does(mass, end):
    """Tried at the outermost place that there is, and at the innermost."""
    scenario = SeesawBalance(weight=Block(mass=mass), seesaw=Seesaw(stop=25.0, height=0.19))
    refutation = scenario.infeasible()
    assert refutation is not None and refutation.reason == "no place on the deck balances with room to spare"
    (span,) = scenario.spans(scenario.raised)
    w = settled(scenario, scenario.raised * span[end])
    assert w.tilt(BEAM) > LEVEL


def test_dropping_the_target_loses():
    scenario = SeesawBalance()
    w = settled(scenario, -0.1, 0.33)
    assert scenario.failure(w) == "the target fell off the seesaw"


@given(
    offset=st.floats(-0.35, 0.35),
    pivot=st.floats(-0.1, 0.1),
    beam=st.floats(0.2, 0.8),
    masses=st.tuples(st.floats(0.02, 1.0), st.floats(0.02, 1.0)),
)
@settings(max_examples=60, deadline=None)
def test_whatever_is_within_bounds_is_refuted_with_numbers_or_has_room_to_balance(offset, pivot, beam, masses):
    scenario = SeesawBalance(
        offset=offset,
        seesaw=Seesaw(mass=beam, pivot_offset=pivot),
        target=Block(mass=masses[0]),
        weight=Block(mass=masses[1]),
    )
    refutation = scenario.infeasible()
    if refutation:
        assert refutation.reason and refutation.numbers
        return
    scenario.build().compile()
    assert math.isclose(scenario.tilt_at(scenario.balance), 0.0, abs_tol=1e-9)
    assert abs(scenario.tilt_at(scenario.balance + scenario.margin)) == pytest.approx(LEVEL, rel=1e-6)
