"""Certificates of scenes that deserve one, and of scenes that do not: computed, not guessed."""

import math
from dataclasses import dataclass
from itertools import repeat

import numpy as np
import pytest
from helpers import shift

from scengen import load_task
from scengen.certificate import CHECKS
from scengen.control.loop import Loop
from scengen.episode import PAPER
from scengen.geometry import UP, compound, quat
from scengen.scenario import Shortcut
from scengen.sim.arm import ROBOT
from scengen.sim.world import World
from scengen.tasks.domino_single import SLAB_DISPLACEMENT, DominoSingle
from scengen.tasks.pendulum_grasp import BOB, HINGE
from scengen.validate.certify import certify
from scengen.validate.rebuilt import world_of
from scengen.validate.rollout import AT_REST, OUT_OF_REACH, Jitter, replay, run, try_shortcut
from scengen.validate.settings import CertifySettings, Robust, lower_bound

HORIZON = 12.0


@pytest.fixture(scope="module")
def good():
    return certify(load_task("domino_single").draw("id", 0, 1).scenario, HORIZON, CertifySettings())


def test_a_good_scene_passes_every_check(good):
    assert good.certificate.verdict == "certified" and good.certificate.reason == ""
    assert [c.name for c in good.certificate.checks] == list(CHECKS)
    assert all(c.passed is True for c in good.certificate.checks if c.name != "attack")
    assert good.certificate["attack"].waived and "no rollouts" in good.certificate["attack"].reason


def test_the_certificate_keeps_how_every_shortcut_ended(good):
    ends = next(c for c in good.certificate.checks if c.name == "shortcuts").numbers
    assert len(ends) == 5
    for told in ends.values():
        assert {how: end["outcome"] for how, end in told.items()} == {"filtered": "failure", "raw": "failure"}


def test_the_certificate_keeps_what_the_physics_depends_on(good):
    features = load_task("domino_single").draw("id", 0, 1).scenario.features()
    assert good.certificate.checks[0].name == "feasible" and good.certificate.checks[0].numbers == features


def test_certifying_twice_gives_the_same_bits(good):
    again = certify(load_task("domino_single").draw("id", 0, 1).scenario, HORIZON, CertifySettings())
    assert again.digest == good.digest and np.array_equal(again.witness, good.witness)
    assert again.certificate == good.certificate


# --- scenes that must not be certified ------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class SlabAway(DominoSingle):
    """The slab stands 6 cm from where the chain ends."""

    def build(self):
        scene = super().build()
        shift(scene.body("slab"), [SLAB_DISPLACEMENT + 0.01, 0, 0])
        return scene


@dataclass(frozen=True, kw_only=True)
class TileGone(DominoSingle):
    """The fourth tile is missing. At gap 1.2, two gaps and a tile are 108 mm, more than the 80 mm of a tile."""

    def build(self):
        scene = super().build()
        scene.delete(scene.body("tile_3"))
        return scene


@dataclass(frozen=True, kw_only=True)
class Leaning(DominoSingle):
    """The third tile leans back by more than its tipping angle."""

    def build(self):
        scene = super().build()
        angle = -1.3 * self.tile.tipping_angle
        tile = scene.body("tile_2")
        tile.quat = compound(tile.quat, quat("y", angle))
        tile.pos = tile.pos + self.tile.thickness / 2 * math.sin(-angle) * UP
        return scene


@dataclass(frozen=True, kw_only=True)
class OverTheEdge(DominoSingle):
    """Half of the chain has no table under it, and nobody noticed."""

    def infeasible(self):
        return None


@dataclass(frozen=True, kw_only=True)
class Overlapping(DominoSingle):
    """Two tiles share their place in part."""

    def build(self):
        scene = super().build()
        shift(scene.body("tile_2"), [-self.gap - 0.004, 0, 0])
        return scene


@dataclass(frozen=True, kw_only=True)
class Broken(DominoSingle):
    """A scene that MuJoCo cannot compile."""

    def build(self):
        scene = super().build()
        scene.body("slab").add_geom(name="point", size=[0, 0, 0])
        return scene


NEGATIVES = {
    "gap beyond a tile's height": (DominoSingle(gap_ratio=2.2, count=3), "refuted", "feasible", "cannot reach"),
    "chain off the table": (DominoSingle(x=0.35), "refuted", "feasible", "leaves the table"),
    "chain out of reach": (
        DominoSingle(count=2, x=0.34, y=0.34, heading=-135.0),
        "refuted",
        "feasible",
        "out of reach",
    ),
    "half the chain in the air": (OverTheEdge(x=0.35), "refuted", "rest", "drifts"),
    "slab already displaced": (SlabAway(), "refuted", "unsolved", "already holds at the start"),
    "tile removed": (TileGone(gap_ratio=1.2), "unknown", "solved", "the oracle failed"),
    "tile that falls by itself": (Leaning(gap_ratio=1.2), "refuted", "rest", "drifts"),
    "tiles that overlap": (Overlapping(), "refuted", "overlap", "overlap by 4"),
    "scene that does not compile": (Broken(), "refuted", "compiles", "does not compile"),
}


@pytest.mark.parametrize("name", NEGATIVES)
def test_a_bad_scene_gets_the_right_verdict_and_reason(name):
    scenario, verdict, check, says = NEGATIVES[name]
    certificate = certify(scenario, HORIZON, CertifySettings()).certificate
    assert (certificate.verdict, certificate.failed.name) == (verdict, check)
    assert says in certificate.reason
    after = list(CHECKS).index(check) + 1
    assert all(c.passed is None for c in certificate.checks[after:]), "a check after a failed one counts as skipped"


def test_a_scene_that_solves_itself_is_refuted():
    @dataclass(frozen=True, kw_only=True)
    class TooEasy(DominoSingle):
        def success(self, world):
            return world.time > 6.0

        def pending(self, world):
            return world.time <= 6.0

    certificate = certify(TooEasy(), HORIZON, CertifySettings()).certificate
    assert certificate.verdict == "refuted" and certificate.reason == "idle: doing nothing reaches the goal"


def test_idling_ends_once_everything_rests_and_not_before_rest_was_watched():
    certificate = certify(DominoSingle(), HORIZON, CertifySettings(), last="idle").certificate
    numbers = certificate["idle"].numbers
    assert numbers["reason"] == AT_REST and CertifySettings().rest.seconds < numbers["seconds"] < HORIZON / 2


def test_a_shortcut_that_works_refutes_the_scene():
    @dataclass(frozen=True, kw_only=True)
    class Permissive(DominoSingle):
        """The paper's own rule, under which pushing the last tile is as good as pushing the first."""

        def means(self):
            return {}

    certificate = certify(Permissive(), HORIZON, CertifySettings()).certificate
    assert certificate.verdict == "refuted" and "'push_the_last_tile' reaches the goal" in certificate.reason


def test_a_means_that_is_not_needed_refutes_the_scene():
    @dataclass(frozen=True, kw_only=True)
    class Needless(DominoSingle):
        def ablations(self):
            return {"no_change": self.build()}

    certificate = certify(Needless(), HORIZON, CertifySettings()).certificate
    assert certificate.reason == "ablations: the witness succeeds with 'no_change'"


# --- rollouts that end when they are decided ---------------------------------------------------


@pytest.fixture(scope="module")
def to_the_end():
    return certify(load_task("domino_single").draw("id", 0, 1).scenario, HORIZON, CertifySettings(), to_the_end=True)


def test_only_raw_shortcuts_end_before_the_plan_does(good, to_the_end):
    assert (good.digest, good.scene_xml) == (to_the_end.digest, to_the_end.scene_xml)
    for one, other in zip(good.certificate.checks, to_the_end.certificate.checks, strict=True):
        assert one == other or one.name == "shortcuts"
    short, whole = (made.certificate["shortcuts"].numbers for made in (good, to_the_end))
    cut = {name for name in short if short[name]["raw"] != whole[name]["raw"]}
    assert cut and all(short[name]["filtered"] == whole[name]["filtered"] for name in short)
    for name in cut:
        assert short[name]["raw"]["reason"].startswith(OUT_OF_REACH)
        assert short[name]["raw"]["seconds"] < whole[name]["raw"]["seconds"]
        assert whole[name]["raw"]["outcome"] != "success"


def test_a_plan_that_is_simulated_to_rest_does_not_end_when_a_mean_is_missed():
    scenario = DominoSingle()
    plan, world = scenario.shortcuts()["push_the_last_tile"].plan, world_of(scenario)
    ends = [try_shortcut(scenario, world, Shortcut(plan, rest), HORIZON, until_decided=True) for rest in (False, True)]
    assert ends[0].reason.startswith(OUT_OF_REACH) and not ends[1].reason.startswith(OUT_OF_REACH)


def test_a_plan_that_the_filter_leaves_alone_gives_the_same_bits_raw():
    scenario = DominoSingle()
    world = world_of(scenario)

    def stand(world):
        yield from repeat(world.idle, 20)

    still = [try_shortcut(scenario, world, Shortcut(stand), HORIZON, raw=raw) for raw in (False, True)]
    assert not still[0].filtered and still[0].digest == still[1].digest
    assert try_shortcut(scenario, world, scenario.shortcuts()["push_the_slab"], HORIZON).filtered


def test_idling_goes_on_where_the_rest_check_ended():
    scenario = load_task("galileo_ramp_drop").draw("id", 0, 0).scenario
    periods = round(CertifySettings().rest.seconds / Loop.PERIOD)

    def wait(world):
        yield from repeat(world.idle, periods)

    whole = run(scenario, world_of(scenario), wait, HORIZON, until_settled=True, rules=PAPER)
    numbers = certify(scenario, HORIZON, CertifySettings(), last="idle").certificate["idle"].numbers
    assert numbers == {"outcome": whole.outcome, "reason": whole.reason, "seconds": whole.seconds}


@pytest.mark.parametrize(("iterations", "converged"), [(100, True), (2, False)])
def test_twice_the_iterations_give_the_same_bits_if_the_solver_has_converged(good, iterations, converged):
    scenario = load_task("domino_single").draw("id", 0, 1).scenario
    ends = []
    for factor in (1, 2):
        world = World.load(good.scene_xml)
        world.model.opt.iterations = factor * iterations
        ends.append(replay(scenario, world, good.witness[:150], HORIZON))
    assert ends[0].converged is converged and (ends[0].digest == ends[1].digest) is converged


# --- robustness -------------------------------------------------------------------------------


@pytest.mark.parametrize(("k", "n", "bound"), [(14, 14, 0.807), (4, 4, 0.473), (0, 5, 0.0), (9, 10, 0.606)])
def test_the_lower_bound_is_clopper_and_pearsons(k, n, bound):
    assert lower_bound(k, n) == pytest.approx(bound, abs=5e-4)


def test_too_few_runs_cannot_show_a_high_bound():
    certificate = certify(DominoSingle(), HORIZON, CertifySettings(robust=Robust(runs=2, bound=0.8))).certificate
    assert certificate.verdict == "unknown" and "ask for more" in certificate.reason


def test_a_scene_that_only_works_undisturbed_is_not_certified():
    wild = CertifySettings(robust=Robust(runs=4, bound=0.45, position=0.06, turn=60.0))
    certificate = certify(DominoSingle(), HORIZON, wild).certificate
    assert certificate.failed.name == "robust"
    numbers = certificate["robust"].numbers
    assert len(numbers["failures"]) == 1 and numbers["failures"][0].startswith(f"run {numbers['runs'] - 1}: ")


def test_jitter_moves_what_it_should_by_what_its_key_says():
    world = world_of(DominoSingle())
    jitter = Jitter("k", 0.002, 1.0, 0.05, 0.1, 0.0, 0)
    moved, again = jitter.disturbed(world), jitter.disturbed(world)
    other = Jitter("l", 0.002, 1.0, 0.05, 0.1, 0.0, 0).disturbed(world)
    shift = moved.pos("slab") - world.pos("slab")
    assert 0 < np.abs(shift[:2]).max() <= 0.002 and shift[2] == 0
    assert np.array_equal(moved.pos("slab"), again.pos("slab")) and not np.array_equal(
        moved.pos("slab"), other.pos("slab")
    )
    slab = world.body("slab")
    assert 0.95 <= moved.model.body_mass[slab] / world.model.body_mass[slab] <= 1.05
    assert moved.model.body_mass[slab] != world.model.body_mass[slab]
    assert np.array_equal(moved.model.body_mass[: world.body("tile_0")], world.model.body_mass[: world.body("tile_0")])


def test_jitter_turns_a_hinge_that_is_named_about_its_axle():
    """The bob of a pendulum stays at its distance from the axle, and the joint reads where it hangs."""
    scenario = load_task("pendulum_grasp").draw("id", 0, 0).scenario
    world = world_of(scenario)
    turned = Jitter("k", 0.002, 1.0, 0.05, 0.1, 0.0, 0).disturbed(world, scenario.DISTURBED)
    (before, _), (angle, rate) = world.hinge(HINGE), turned.hinge(HINGE)
    assert 0 < abs(angle - before) <= math.radians(1.0) and rate == 0
    assert turned.com(BOB) == pytest.approx(scenario.bob_at(angle), abs=1e-6)
    assert world.com(BOB) == pytest.approx(scenario.bob_at(before), abs=1e-6)
    assert turned.model.body_mass[world.body(BOB)] != world.model.body_mass[world.body(BOB)]
    with pytest.raises(ValueError, match="is not a hinge"):
        Jitter("k", 0, 1.0, 0, 0, 0, 0).disturbed(world, ["gripper0_right_finger_joint1"])


# --- rollouts -----------------------------------------------------------------------------------


def test_a_replay_after_a_used_world_ends_in_the_same_bits(good):
    scenario = load_task("domino_single").draw("id", 0, 1).scenario
    world = World.load(good.scene_xml)
    run(scenario, world, scenario.shortcuts()["push_the_slab"].plan, 3.0)
    assert replay(scenario, world, good.witness, HORIZON).digest == good.digest


def test_a_success_that_does_not_last_is_none():
    @dataclass(frozen=True, kw_only=True)
    class Fleeting(DominoSingle):
        def success(self, world):
            return 1.0 < world.time < 1.2

        def means(self):
            return {}

    episode = run(Fleeting(), world_of(DominoSingle()), DominoSingle().oracle, HORIZON)
    assert episode.outcome == "timeout" and "did not last" in episode.reason


def test_a_touch_of_the_slab_between_two_looks_is_remembered():
    scenario = DominoSingle()
    world = world_of(scenario)
    episode = run(scenario, world, scenario.shortcuts()["push_the_slab"].plan, HORIZON)
    assert episode.outcome == "failure" and world.touched(ROBOT, "slab")
