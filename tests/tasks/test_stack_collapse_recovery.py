"""Cubes that are struck go where mechanics says; only the tower that has fallen and stands again counts."""

import math
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import pytest
from controls import (
    after_oracle,
    each_refuted_for_its_own_reason,
    load,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    solution,
)

from scengen import load_task
from scengen.assets.box import LoadedCube
from scengen.assets.prop import TABLE_TOP
from scengen.episode import Episode
from scengen.geometry import UP
from scengen.physics import GRAVITY
from scengen.robots.jaw import TIP_BELOW
from scengen.sim.arm import IDLE
from scengen.skills.motion import FINE, OPEN, go_to, hold
from scengen.tasks.stack_collapse_recovery import GUARD_CLEARANCE, NAMES, Blow, StackCollapseRecovery

TASK = load_task("stack_collapse_recovery")
NOMINAL = StackCollapseRecovery()
ALONE = replace(NOMINAL, blow_0=Blow(both=0))
SETTLED = 2.5
"""When all has come to rest after the nominal blow, nobody acting [s]."""


def watched(scenario, look, seconds=SETTLED, world=None):
    """What `look` sees of the world after every period in which nobody acts."""
    world = world or load(TASK, scenario)
    episode, seen = Episode(scenario, world), []
    while world.time < seconds - 1e-9:
        episode.step(IDLE.astype(np.float32))
        seen.append(look(world))
    return seen


def energy(world):
    """Kinetic and potential energy of the cubes [J]."""
    total = 0.0
    for name, cube in NOMINAL.cubes.items():
        velocity, spin = world.velocity(name)[3:], world.velocity(name)[:3]
        total += cube.mass * (velocity @ velocity / 2 + GRAVITY * (world.com(name)[2] - TABLE_TOP))
        total += cube.mass * cube.edge**2 / 6 * (spin @ spin) / 2
    return total


@pytest.fixture(scope="module")
def collapse():
    """The nominal collapse: time, blows, energy, place and velocity of the cubes."""

    def look(w):
        return w.time, w.memory["blows"], energy(w), {n: w.com(n) for n in NAMES}, {n: w.velocity(n) for n in NAMES}

    return watched(NOMINAL, look)


# --- the blow -----------------------------------------------------------------------------


def test_the_blow_comes_when_the_tower_has_stood_for_its_time(collapse):
    first = next(time for time, blows, *_ in collapse if blows == 1.0)
    assert first == pytest.approx(NOMINAL.blow_0.when, abs=0.03)


def test_each_struck_cube_takes_the_way_and_the_momentum_of_its_blow_and_the_lowest_none(collapse):
    """Less what friction takes in the same period: Coulomb's 5 %, and more where the cubes slide fast on each other."""
    struck = next(velocities for _, blows, _, _, velocities in collapse if blows == 1.0)
    for name, velocity in NOMINAL.velocities(NOMINAL.blow_0).items():
        assert 0.65 < struck[name][3:] @ velocity / (velocity @ velocity) < 1.0
        assert abs(struck[name][3:] @ np.cross(velocity, UP)) < 0.02
    assert np.linalg.norm(struck["bottom"][3:]) < 0.01
    bottom = [places["bottom"] for *_, places, _ in collapse]
    assert math.dist(bottom[0], bottom[-1]) < 0.001


def test_the_top_cube_falls_freely_between_the_tower_and_the_table(collapse):
    flight = [(time, places["top"]) for time, blows, _, places, _ in collapse if blows]
    flight = [(time, at) for time, at in flight if 0.035 < at[2] - TABLE_TOP < 0.11]
    times, heights = np.array([time for time, _ in flight]), np.array([at[2] for _, at in flight])
    assert len(times) >= 4
    assert -2 * np.polyfit(times, heights, 2)[0] == pytest.approx(GRAVITY, rel=0.04)


def test_after_the_blow_energy_is_lost_and_never_gained(collapse):
    """From two periods on, when contacts that the blow has pressed together have let go."""
    history = np.array([joules for _, blows, joules, *_ in collapse if blows])[2:]
    given = sum(NOMINAL.cubes[n].mass * v @ v / 2 for n, v in NOMINAL.velocities(NOMINAL.blow_0).items())
    before = next(joules for _, blows, joules, *_ in collapse if not blows)
    assert 0.45 * given < history[0] - before < given
    assert np.diff(history).max() < 0.03 * given
    lying = GRAVITY * sum(cube.mass * cube.edge / 2 for cube in NOMINAL.cubes.values())
    assert history[-1] == pytest.approx(lying, rel=0.01)


@pytest.mark.parametrize(("share", "leaves"), [(0.93, False), (1.07, True)])
def test_a_cube_leaves_the_one_below_if_friction_does_not_stop_it_within_half_an_edge(share, leaves):
    """v^2 = 2 mu g (edge / 2): then its middle has passed the edge."""
    speed = share * math.sqrt(NOMINAL.top.friction * GRAVITY * NOMINAL.middle.edge)
    scenario = replace(ALONE, blow_0=Blow(both=0, speed=speed))
    world = load(TASK, scenario)
    watched(scenario, lambda w: None, world=world)
    assert (world.memory["fell"] == 1.0) == leaves


@pytest.mark.parametrize("both", [0, 1])
def test_what_is_struck_falls_and_comes_to_rest_no_farther_than_friction_allows(both):
    scenario = replace(NOMINAL, blow_0=Blow(both=both))
    world = load(TASK, scenario)
    watched(scenario, lambda w: None, world=world)
    assert world.touching("middle", "bottom") == (not both) and world.touching("top", "table")
    for name, spot in zip(scenario.velocities(scenario.blow_0), scenario.spots(scenario.blow_0), strict=True):
        come, far = (math.dist(at[:2], scenario.feet[0][:2]) for at in (world.com(name), spot))
        assert 0.4 < come / far < 1.3
        assert world.rot(name)[2] == pytest.approx(np.round(world.rot(name)[2]), abs=0.01)  # on a face


def test_a_collapse_goes_on_bit_by_bit_from_a_state_in_its_midst():
    world, again = load(TASK, NOMINAL), load(TASK, NOMINAL)
    watched(NOMINAL, lambda w: None, NOMINAL.blow_0.when + 0.12, world)
    again.restore(world.state())
    assert world.memory["blows"] > 0.0 and np.abs(world.velocity("top")).max() > 0.3
    watched(NOMINAL, lambda w: None, world=world)
    watched(NOMINAL, lambda w: None, world=again)
    assert world.digest == again.digest


# --- goal and failure ---------------------------------------------------------------------


def test_the_tower_counts_only_struck_fallen_and_put_up_again():
    world = load(TASK, NOMINAL)
    watched(NOMINAL, lambda w: None, 0.3, world)
    assert NOMINAL.stands(world) and not NOMINAL.success(world)
    world = after_oracle(TASK, ALONE)
    assert ALONE.success(world)
    with world.events():
        world.memory["fell"] = 0.0
    assert not ALONE.success(world)


def test_who_holds_the_tower_only_puts_off_the_blow():
    later = replace(NOMINAL, blow_0=replace(NOMINAL.blow_0, when=2.0))
    world = load(TASK, later)
    assert not play_shortcut(TASK, later, "hold_the_tower", world).solved
    assert world.memory["blows"] == 1.0 and world.time > 4.0


@pytest.mark.parametrize(("higher", "guards"), [(-0.008, True), (0.008, False)])
def test_the_blow_waits_while_the_hand_is_low_beside_the_tower(higher, guards):
    """Moves are exact to 3 mm and 0.05 rad, which is 3 mm at the fingers."""
    later = replace(NOMINAL, blow_0=replace(NOMINAL.blow_0, when=3.0))
    world = load(TASK, later)
    episode, over = Episode(later, world), later.top.edge + GUARD_CLEARANCE + TIP_BELOW + higher
    plans = go_to(world.arm, later.feet[2] + over * UP, pace=FINE, grip=OPEN), hold(world.arm, 4.0)
    for action in chain(*plans):
        episode.step(world.filter(action))
    assert world.memory["blows"] == (0.0 if guards else 1.0)


@pytest.mark.parametrize("name", ["smallest_at_the_bottom", "over_the_edge", "as_if_the_middle_stood"])
def test_another_tower_or_none_is_not_the_goal(name):
    world = load(TASK, NOMINAL)
    ended = play_shortcut(TASK, NOMINAL, name, world)
    assert not ended.solved and not ended.gave_up
    upside_down = world.touching("bottom", "middle") and world.com("bottom")[2] > world.com("middle")[2]
    assert upside_down == (name == "smallest_at_the_bottom")


def test_a_second_blow_is_for_the_tower_that_stands_again():
    twice = replace(ALONE, blows=2)
    world = after_oracle(TASK, twice)
    assert world.memory["blows"] == 2.0
    assert not replayed(TASK, ALONE, twice).solved
    assert len(solution(TASK, twice).actions) > 1.4 * len(solution(TASK, ALONE).actions)


@pytest.mark.parametrize("split", ["hard_blow", "late_blow"])
def test_a_memorised_motion_serves_no_other_collapse(split):
    trained, moved = (TASK.draw(name, 0, 0).scenario for name in ("id", split))
    assert not replayed(TASK, trained, moved).solved


def test_a_cube_with_its_weight_on_one_side_stands_only_where_its_centre_of_mass_is_borne():
    loaded = TASK.draw("loaded_top", 0, 0).scenario
    assert solution(TASK, loaded).solved
    world = load(TASK, loaded)
    assert not play_shortcut(TASK, loaded, "middle_over_middle", world).solved
    assert not world.touching("top", "middle") or world.touching("top", "table")


# --- scenes that must not be certified ----------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class AnyOrder(StackCollapseRecovery):
    """Whatever has fallen and stands on something counts, also if no cube that fell was carried there."""

    def success(self, world):
        return bool(world.memory["fell"]) and sum(world.touching(name, "table") for name in NAMES) == 1

    def means(self):
        return {}


@pytest.mark.parametrize(
    ("scenario", "check", "says"),
    [
        (AnyOrder(), "shortcuts", "'smallest_at_the_bottom' reaches the goal"),
        (mistaken(StackCollapseRecovery, "as_if_the_middle_stood")(), "solved", "the oracle failed"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, StackCollapseRecovery) else str(value),
)
def test_an_invalid_scenario_is_not_certified(scenario, check, says):
    not_certified(TASK, scenario, check, says)


def test_every_refutation_has_its_own_reason():
    each_refuted_for_its_own_reason(
        [
            replace(NOMINAL, top=LoadedCube(edge=0.049)),
            replace(NOMINAL, top=LoadedCube(lean=0.34)),
            replace(NOMINAL, x=0.39, y=0.38),
            replace(NOMINAL, y=0.25),
            replace(NOMINAL, blow_0=Blow(speed=0.3)),
            replace(NOMINAL, x=-0.15, blow_0=Blow(heading=180.0)),
            replace(NOMINAL, x=0.1, blow_0=Blow(heading=0.0)),
        ]
    )
