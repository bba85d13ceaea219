"""The adversary on the smallest task: macros, forks, evidence, priors, and a hole that it must find."""

from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from scengen import load_task
from scengen.attack import draws
from scengen.attack.adversary import RANDOM, RETRY, Attack
from scengen.attack.campaign import AttackReport, AttackSettings, attack, drawn, player_of
from scengen.attack.evidence import CausalContacts, Hit, TierRate, hit, rates
from scengen.attack.macros import Macro
from scengen.attack.player import Attempt, Player
from scengen.attack.priors import Prior, fit
from scengen.attack.solids import handles, sides
from scengen.attack.variations import at_another_pace, perturbed, phase, rest
from scengen.cli.program import run
from scengen.control.teleop import Filter
from scengen.predicates import touched_only
from scengen.scenario import Answer
from scengen.sim.arm import ROBOT
from scengen.validate.rollout import replay

TASK = load_task("domino_single")


def with_hole(self, world):
    """Rules in place of the means: the robot may touch the first tile alone, and may carry it."""
    if world.touched(ROBOT, "slab"):
        return "the robot touched the slab"
    return touched_only(world, "tile_0")


@pytest.fixture(scope="module", autouse=True)
def hole():
    with mock.patch.multiple(TASK.family, failure=with_hole, means=lambda self: {}):
        yield


@pytest.fixture(scope="module")
def subject():
    return drawn(TASK, "id", 1, 0)[0]


@pytest.fixture(scope="module")
def player(subject) -> Player:
    return player_of(subject)


@pytest.fixture(scope="module")
def causal(player):
    return CausalContacts(player)


PICK, AGAINST = Macro("pick", "tile_0", (0.6, 0.0, 1.0, 0.2)), Macro("push", "slab", (np.pi / 2, 0.8, 0.0, 0.08, 0.15))


# --- playing ------------------------------------------------------------------------------------


def test_a_hand_takes_what_leaves_room_for_its_fingers(player):
    player.rewind()
    best = handles(player.solids, suction=False)[0]
    assert best.name == "tile_0" and sides(player.world, player.solids, best) == [1, 0]


@pytest.mark.parametrize("raw", [False, True])
def test_a_fork_continues_bit_for_bit(player, raw):
    whole = player.play((PICK, AGAINST), raw)
    node = player.play((PICK,), raw).nodes[0]
    forked = player.play((AGAINST,), raw, node)
    assert forked.digest == whole.digest and np.array_equal(forked.actions, whole.actions)
    assert forked.signature == whole.signature


def test_a_macro_that_gives_up_does_not_end_the_plan(player):
    played = player.play(
        (Macro("press", "slab", (0.0, 0.0, 0.2, 0.1)), Macro("go", "", (3.0, 0, 1, 0, 0, 0, 1)), PICK), True
    )
    assert played.outcome == "failure" or played.notes


def test_draws_depend_on_their_key_alone(player):
    first = [draws.plan(player, 0, "a", k) for k in range(20)]
    player.play((PICK,), False)
    assert [draws.plan(player, 0, "a", k) for k in range(20)] == first
    assert len({macro.kind for plan in first for macro in plan}) >= 5
    assert draws.plan(player, 1, "a", 0) != first[0]


# --- witnesses ----------------------------------------------------------------------------------


def test_phases_cover_the_witness_and_can_be_followed(player):
    phases = player.trace.phases
    assert phases[0][0] == 0 and phases[-1][1] == len(player.trace.actions)
    assert all(one[1] == other[0] for one, other in pairwise(phases))
    assert player.trace.handled == ("tile_0",) and player.trace.concerned[0] == "slab"
    for raw in (False, True):
        assert player.play(rest(player, 0), raw).solved


def test_recorded_actions_come_through_the_filter(player):
    player.foreign = {"own": player.trace.actions}
    asked = list(player.plan(Macro("replay", "own"), raw=False))
    filtered = np.array([f(a) for f in [Filter()] for a in asked])
    assert np.allclose(filtered, player.trace.actions, atol=1e-5)
    assert player.play((Macro("replay", "own"),), raw=True).solved
    player.foreign = {}


def test_the_oracles_own_moves_at_another_pace_are_told_from_other_ones(player):
    paced = [attempt for attempt in perturbed(player) if at_another_pace(player, attempt)]
    assert len(paced) == 2 * (player.phases + 1), "each phase, and all of them, slower and faster"
    dropped, mirrored = (
        Attempt("", rest(player, 1), 0),
        Attempt("", (phase(player, 0, mirrored=True), *rest(player, 1))),
    )
    shifted = Attempt("", (phase(player, 0, shift=(0.01, 0.0, 0.0)), *rest(player, 1)))
    assert not any(
        at_another_pace(player, one) for one in (dropped, mirrored, shifted, Attempt("", ()), Attempt("", (PICK,)))
    )


def test_what_the_oracles_own_moves_lack_is_not_causal(player):
    causal = CausalContacts(player, varied=0)
    every = player.trace.signature.pairs
    one = next(iter(sorted(every)))
    assert causal.lacking(every - {one}) == {one}
    causal.spare(every - {one})
    assert not causal.lacking(every - {one})


def test_perturbed_witnesses_begin_where_a_phase_does(player):
    attempts = list(perturbed(player))
    assert {attempt.stage for attempt in attempts} == {None, *range(player.phases)}
    assert len(set(attempts)) == len(attempts)


# --- evidence -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_carrying_lacks_the_chain(player, subject, causal, tmp_path):
    played = player.play((PICK, AGAINST), raw=False)
    found = hit(player, Attempt("random", (PICK, AGAINST)), False, played, None, causal)
    assert found and found.refutes and ("tile_0", "tile_1") in found.lacks and "tile_1" in found.unmoved
    found.store(tmp_path)
    stored = Hit.load(tmp_path / f"{found.name}.npz")
    assert stored == found
    again = replay(subject.scenario, player.world, stored.actions, subject.horizon)
    assert again.solved and again.digest == found.digest


def test_the_witness_itself_refutes_nothing(player, causal):
    steps = rest(player, 0)
    found = hit(player, Attempt("witness", steps), False, player.play(steps, False), None, causal)
    assert found and not found.refutes


def test_what_does_not_replay_is_no_hit(player):
    played = player.play((PICK, AGAINST), raw=False)
    forged = replace(played, digest="0" * 16)
    assert hit(player, Attempt("random", (PICK,)), False, forged, None, frozenset()) is None


def test_rates_add_up_and_have_bounds():
    counts = [TierRate(RANDOM, False, 20), TierRate(RANDOM, False, 39), TierRate(RANDOM, True, 10, 10, 2)]
    none, every = rates(counts)
    assert none.rollouts == 59 and none.bound == pytest.approx(0.0495, abs=1e-3)
    assert every.value == 1.0 and every.bound == 1.0 and every.refuting == 2


@pytest.mark.slow
def test_the_adversary_finds_that_the_first_tile_can_be_carried(player):
    """It knows nothing of dominoes: it takes what the witness touches, to where the witness ends."""
    found = Attack(player, 0, until=lambda hit: hit.refutes)
    result = found.run(60, (RETRY,))
    assert any(one.refutes for one in result.hits)
    assert sum(rate.rollouts for rate in result.rates) <= 60


# --- priors -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Lane:
    """A family that asks for a number from 0 to 4."""

    number: int

    def answer(self):
        return Answer((0.0, 1.0, 2.0, 3.0, 4.0), lambda world, value: iter(()), lambda value: value == self.number)


def test_fixed_answers_are_the_best_ones_together():
    training = [Lane(k) for k in (2, 2, 2, 2, 1, 1, 1, 4, 4, 0)]
    one, two, three = fit(training, fresh=[Lane(2), Lane(4), Lane(3), Lane(3)])
    assert (one.values, one.fitted, one.fresh) == ((2.0,), 0.4, 0.25)
    assert two.values == (2.0, 1.0) and two.fitted == 0.7
    assert three.values == (2.0, 1.0, 4.0) and three.fresh == 0.5 and three.bound < 1.0


@pytest.mark.parametrize(
    ("tier", "hits", "choices", "said"),
    [
        ("random", 64, 9, [("random plans solve 64 of 200, more than 10%", True)]),
        ("random", 22, 9, [("random plans solve 22 of 200, more than 10%", False)]),
        ("foreign", 20, 9, []),
        ("prior_1", 64, 3, []),
        ("prior_1", 64, 9, [("1 fixed answer solves 64 of 200, more than 16%", True)]),
        ("prior_3", 80, 9, [("3 fixed answers solve 80 of 200, more than 38%", False)]),
        ("servo", 200, 9, []),
    ],
)
def test_what_needs_no_look_has_limits(tier, hits, choices, said):
    counts = (TierRate(tier, False, 100, hits // 2), TierRate(tier, True, 100, hits - hits // 2))
    report = AttackReport("task", 1, "strict", (), counts, (), (), (), (), Path(), 0.0)
    answer = Answer(tuple(map(float, range(choices))), lambda world, value: iter(()))
    assert list(report.above_limits(answer)) == said


def test_fixed_answers_by_statics_count_before_rollouts():
    report = AttackReport(
        "task",
        1,
        "strict",
        (),
        (TierRate("prior_1", False, 5),),
        (),
        (Prior((0.3,), 0.5, 0.4, 300),),
        (),
        (),
        Path(),
        0.0,
    )
    answer = Answer(tuple(np.linspace(0.0, 1.0, 21)), lambda world, value: iter(()))
    assert list(report.above_limits(answer)) == [("1 fixed answer solves 120 of 300, more than 10%", True)]


# --- the command ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_attack_is_stored_and_continues(tmp_path, subject):
    settings, said = AttackSettings(n=1, budget=4, tiers=["random"]), []
    first = attack(TASK, [subject], settings, tmp_path, lambda done, hits: said.append(done))
    again = attack(TASK, [subject], settings, tmp_path, lambda done, hits: said.append(done))
    assert said == [1] and first.plain() == again.plain() and first.rollouts == 4


def test_the_command_says_what_is_missing(tmp_path, capsys):
    assert run(["attack"]) == 2
    assert "task=NAME or pool=FOLDER" in capsys.readouterr().err
    assert run(["attack", "task=domino_single", "tiers=[luck]"]) == 2
    assert "random" in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_fails_where_a_hit_refutes(tmp_path):
    """The declared shortcut that carries the tile is no failure here."""
    report = tmp_path / "report.json"
    words = ["task=domino_single", "n=1", "budget=10", "tiers=[shortcut]", f"to={tmp_path}", f"json={report}"]
    assert run(["attack", *words]) == 1
    assert '"refutes": true' in report.read_text() and list(tmp_path.glob("*.npz"))
