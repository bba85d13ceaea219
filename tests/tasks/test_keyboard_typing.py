"""A letter counts in its turn, for its owner, after its time; and the other robot is part of the scene, bit by bit."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from controls import (
    ablated,
    each_refuted_for_its_own_reason,
    load,
    missed,
    mistaken,
    not_certified,
    play_shortcut,
    replayed,
    solution,
)

from scengen import load_task
from scengen.assets.glyph import STROKES
from scengen.assets.keyboard import LETTERS, Keyboard
from scengen.assets.prop import TABLE_TOP
from scengen.assets.words import DOUBLED_WORDS, LONG_WORDS, TRAINING_WORDS, UNSEEN_WORDS, WORDS
from scengen.control.loop import Loop
from scengen.episode import OTHERWISE, Episode
from scengen.geometry import UP
from scengen.tasks.keyboard_typing import (
    MIN_CLEARANCE,
    MISTAKES,
    PARTNER_HOME,
    TURN_LIMIT,
    KeyboardTyping,
)

TASK = load_task("keyboard_typing")
NOMINAL = KeyboardTyping(mine=0b00110)
"""WORLD, of which O and R are the agent's: it waits, types two letters in a row, and makes room."""
PERIODS = round(NOMINAL.hold / Loop.PERIOD)


@dataclass
class Moment:
    typed: int
    shown: list[bool]
    keys: tuple[int, int]
    """What each arm touches."""
    beside: bool
    """Whether the agent's hand is out of the way."""
    home: float
    """How far the partner's hand is from home [m]."""


@pytest.fixture(scope="module")
def history():
    """The witness of the nominal scenario, period by period; a state in the middle of a press, and the end."""
    world, actions = load(TASK, NOMINAL), solution(TASK, NOMINAL).actions
    episode, seen, middle = Episode(NOMINAL, world), list[Moment](), None
    for row, action in enumerate(actions):
        assert episode.step(action) != "failure"
        memory, (partner,) = world.memory, world.partners
        shown = [bool(world.pos(f"typed_{k}")[2] > TABLE_TOP - 0.001) for k in range(5)]
        keys = int(memory["key_0"]), int(memory["key_1"])
        away = float(np.linalg.norm(partner.hand - PARTNER_HOME))
        seen.append(Moment(int(memory["typed"]), shown, keys, NOMINAL.beside(world, world.arm), away))
        if middle is None and memory["held_1"] > NOMINAL.hold / 2:
            middle = row + 1, world.state()
    assert middle is not None
    return seen, middle, world.digest


# --- what the witness shows ---------------------------------------------------------------


def test_letters_are_typed_in_their_order_each_by_its_owner(history):
    seen, _, _ = history
    assert [m.typed for m in seen] == sorted(m.typed for m in seen) and seen[-1].typed == 5
    for before, after in pairwise(seen):
        if after.typed > before.typed:
            letter = LETTERS.index(NOMINAL.letters[before.typed]) + 1
            assert after.keys[0 if NOMINAL.owns(before.typed) else 1] == letter


def test_what_has_been_typed_is_bold_and_nothing_else(history):
    assert all(m.shown == [k < m.typed for k in range(5)] for m in history[0])


def test_the_partner_goes_to_the_keys_only_while_the_agent_is_out_of_the_way(history):
    out = [before for before, after in pairwise(history[0]) if after.home > before.home + 0.0005]  # at 5 cm/s or more
    assert len(out) > 200 and all(m.beside and not NOMINAL.owns(m.typed) for m in out)


def test_an_episode_restored_in_the_middle_of_the_partners_press_goes_on_bit_by_bit(history):
    _, (row, state), digest = history
    world, actions = load(TASK, NOMINAL), solution(TASK, NOMINAL).actions
    world.restore(state)
    episode = Episode(NOMINAL, world)
    for action in actions[row:]:
        episode.step(action)
    assert world.memory["typed"] == 5 and world.digest == digest


def test_an_action_and_what_a_policy_sees_are_of_the_agents_arm_alone(history):
    world = load(TASK, NOMINAL)
    assert solution(TASK, NOMINAL).actions.shape[1] == world.size == len(world.idle) == 7
    assert [arm.label for arm in world.arms] == ["robot0"] and [arm.label for arm in world.partners] == ["robot1"]


# --- the law of the keys ------------------------------------------------------------------


@pytest.fixture(scope="module")
def world():
    return load(TASK, NOMINAL)


def touch(scenario, world, letters, periods, arm=0):
    """Let an arm touch keys for some control periods, without moving anything."""
    rows = world.loop.touching
    for _ in range(periods):
        rows[:] = 0
        for letter in letters:
            rows[world.model.nbody + arm, world.body(f"keyboard/key_{letter}")] = 1
        with world.events():
            scenario.events(world)
    return int(world.memory["typed"]), MISTAKES[int(world.memory["mistake"])]


@pytest.mark.parametrize(("periods", "typed"), [(PERIODS - 1, 0), (PERIODS, 1), (5 * PERIODS, 1)])
def test_a_key_counts_once_after_its_time(world, periods, typed):
    world.reset()
    assert touch(NOMINAL, world, "W", periods, arm=1) == (typed, "")


def test_a_key_that_is_let_go_of_begins_anew(world):
    world.reset()
    for _ in range(3):
        assert touch(NOMINAL, world, "W", PERIODS - 1, arm=1) == (0, "")
        touch(NOMINAL, world, "", 1)
    assert touch(NOMINAL, world, "X", PERIODS - 1, arm=1) == (0, "")
    assert touch(NOMINAL, world, "W", PERIODS - 1, arm=1) == (0, "")


@pytest.mark.parametrize(
    ("typed", "letters", "arm", "mistake"),
    [("", "X", 1, 2), ("", "W", 0, 3), ("W", "O", 1, 3), ("W", "W", 1, 2), ("W", "OP", 0, 1), ("WORLD", "D", 1, 2)],
)
def test_what_is_not_next_not_ones_own_or_more_than_one_is_a_mistake(world, typed, letters, arm, mistake):
    world.reset()
    for k, letter in enumerate(typed):
        touch(NOMINAL, world, letter, PERIODS, arm=0 if NOMINAL.owns(k) else 1)
        touch(NOMINAL, world, "", 1)
    assert touch(NOMINAL, world, letters, PERIODS - 1, arm)[1] == ""
    assert touch(NOMINAL, world, letters, 1, arm) == (len(typed), MISTAKES[mistake])
    assert NOMINAL.failure(world) == MISTAKES[mistake]


def test_a_letter_that_comes_twice_must_be_let_go_of_in_between():
    scenario = KeyboardTyping(word=WORDS.index("HELLO"), mine=0b01110)
    world = load(TASK, scenario)
    for typed, (letter, arm) in enumerate((("H", 1), ("E", 0), ("L", 0)), start=1):
        assert touch(scenario, world, letter, PERIODS, arm)[0] == typed
    assert touch(scenario, world, "L", 3 * PERIODS) == (3, "")
    touch(scenario, world, "", 1)
    assert touch(scenario, world, "L", PERIODS) == (4, "")


def test_the_partner_waits_as_long_as_the_agent_is_in_its_way(world):
    """At the start the agent's hand is less than `MIN_CLEARANCE` beside the keyboard: nothing happens by itself."""
    world.reset()
    episode = Episode(NOMINAL, world)
    for _ in range(300):
        episode.step(world.idle.astype(np.float32))
    (partner,) = world.partners
    assert NOMINAL.beside(world, partner) and not NOMINAL.beside(world, world.arm) and not NOMINAL.pending(world)
    assert np.linalg.norm(partner.hand - PARTNER_HOME) < 0.01 and world.memory["typed"] == 0


def test_each_turn_of_the_partner_has_its_pause_and_letters_within_a_turn_have_none():
    """T, L and E are the agent's in TROUBLE: the partner's turns are R O U, B, and none."""
    scenario = KeyboardTyping(word=WORDS.index("TROUBLE"), mine=0b1010001, first_pause=3.0, second_pause=5.0)
    assert scenario.letters == "TROUBLE"
    assert [scenario.pause(k) for k in (1, 2, 3, 5)] == [3.0, 0.0, 0.0, 5.0]


def beside_until(episode, world, stop, seconds=8.0):
    """Go beside the keyboard and stay there; returns the time that this took when `stop` was true [s]."""
    for action in episode.scenario.make_room(world):
        if episode.scenario.beside(world, world.arm):
            break
        episode.step(world.filter(action))
    begin = world.time
    while not stop() and episode.outcome is None and world.time < begin + seconds:
        episode.step(world.filter(world.arm.idle))
    return world.time - begin


def test_the_partner_pauses_and_waits_anew_when_the_agent_comes_back():
    scenario = replace(NOMINAL, first_pause=3.0)
    world = load(TASK, scenario)
    episode, (partner,) = Episode(scenario, world), world.partners
    moved = lambda: np.linalg.norm(partner.hand - PARTNER_HOME) > 0.02  # noqa: E731
    for _ in range(300):  # it goes home
        episode.step(world.filter(world.arm.idle))
    assert beside_until(episode, world, moved, seconds=2.5) == pytest.approx(2.5, abs=0.02) and not moved()
    for action in scenario.press(world, 1, seconds=0.0):
        episode.step(world.filter(action))
        if not scenario.beside(world, world.arm):
            break
    episode.step(world.filter(world.arm.idle))
    assert world.memory["waited"] == 0.0 and not moved()
    assert 2.5 < beside_until(episode, world, moved) < 3.5 and moved()


def test_a_word_in_which_the_agent_let_a_turn_go_by_lacks_one_mean():
    scenario, in_turn = replace(NOMINAL, mine=0b00011), "the agent came in each of its turns"
    world = load(TASK, scenario)
    episode = Episode(scenario, world, TASK.horizon)
    late = beside_until(episode, world, lambda: missed(scenario, world, in_turn))
    assert late == pytest.approx(TURN_LIMIT, abs=1.0) and episode.outcome is None
    for action in scenario.oracle(world):
        episode.step(world.filter(action))
    while episode.outcome is None:
        episode.step(world.filter(world.arm.idle))
    assert world.memory["typed"] == 5 and episode.reason == f"{OTHERWISE}: {in_turn}"


@dataclass(frozen=True, kw_only=True)
class Corners(KeyboardTyping):
    """The four keys at the corners, all of them of one arm: of the agent where `mine` is 15, else of the partner."""

    @property
    def letters(self):
        return "QPZM"


@pytest.mark.parametrize("arm", [0, 1])
def test_a_press_of_a_second_stays_well_within_its_key(arm):
    """A hand that is stopped from below is pushed aside; 12 mm away is the neighbour, measured are up to 7."""
    scenario = Corners(mine=0b1111 if arm == 0 else 0b10000, hold=1.0)
    world, off = load(TASK, scenario), list[float]()
    episode, hand = Episode(scenario, world), (*world.arms, *world.partners)[arm]

    def plan():
        if arm == 0:
            for k in range(4):
                yield from scenario.press(world, k)
        else:
            yield from scenario.make_room(world)
            while world.memory["typed"] < 4:
                yield world.idle

    for action in plan():
        assert episode.step(world.filter(action)) in (None, "success")
        if key := int(world.memory[f"key_{arm}"]):
            off.append(float(np.abs(hand.hand - world.pos(f"keyboard/key_{LETTERS[key - 1]}"))[:2].max()))
    assert world.memory["typed"] == 4 and max(off) < 0.009


# --- what must not work -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("type_it_all", MISTAKES[3]),
        ("mine_without_waiting", MISTAKES[2]),
        ("once_more", MISTAKES[2]),
        ("one_key_aside", MISTAKES[2]),
        ("short_taps", "everything came to rest"),
        ("make_no_room", MISTAKES[2]),
        ("open_fingers", MISTAKES[1]),
    ],
)
def test_a_shortcut_fails_for_its_own_reason(name, reason):
    ended = play_shortcut(TASK, NOMINAL, name)
    assert not ended.solved and reason in ended.reason and not ended.gave_up


def test_a_letter_may_be_typed_once_more_where_that_is_the_word():
    """HELLO: the second L is a mistake if it is the partner's, and right if it is one's own."""
    hello = KeyboardTyping(word=WORDS.index("HELLO"), mine=0b10100)
    assert play_shortcut(TASK, hello, "once_more").reason == MISTAKES[3]
    assert "once_more" not in replace(hello, mine=0b01100).shortcuts()


def test_with_dead_keys_for_the_partner_its_turn_never_ends():
    ((rollout, world),) = ablated(TASK, NOMINAL).values()
    assert not rollout.solved and world.memory["typed"] == 0


@dataclass(frozen=True, kw_only=True)
class Parked(KeyboardTyping):
    """The partner pauses for ever, and stays at home."""

    def pause(self, k):
        return math.inf


def test_with_the_partner_parked_the_witness_fails(world):
    parked = Parked(mine=NOMINAL.mine)
    ended = replayed(TASK, NOMINAL, parked, world)
    assert ended.reason == MISTAKES[2] and world.memory["typed"] == 0


def test_what_was_learnt_of_one_word_types_no_other():
    assert not replayed(TASK, NOMINAL, replace(NOMINAL, word=WORDS.index("PLANT"))).solved


def test_an_oracle_that_does_not_share_is_not_certified():
    not_certified(TASK, mistaken(KeyboardTyping, "type_it_all")(mine=NOMINAL.mine), "solved", MISTAKES[3])


# --- words and constraints ----------------------------------------------------------------


def test_words_are_what_their_axes_say():
    assert len(set(WORDS)) == len(WORDS) == 40 and set("".join(WORDS)) <= set(LETTERS) == set(STROKES)
    assert all(len(word) == len(set(word)) == 5 for word in TRAINING_WORDS + UNSEEN_WORDS)
    assert all(len(word) == 5 > len(set(word)) for word in DOUBLED_WORDS)
    assert all(len(word) == len(set(word)) == 7 for word in LONG_WORDS)
    drawn = {split: {TASK.draw(split, 0, i).scenario.letters for i in range(60)} for split in ("id", *TASK.axes)}
    assert drawn["id"] <= set(TRAINING_WORDS) and drawn["unseen_words"] <= set(UNSEEN_WORDS)
    assert drawn["doubled_letters"] <= set(DOUBLED_WORDS) and drawn["long_words"] <= set(LONG_WORDS)


def test_most_pairs_of_letters_in_unseen_words_are_new():
    known, others = ({pair for word in words for pair in pairwise(word)} for words in (TRAINING_WORDS, UNSEEN_WORDS))
    assert len(others - known) / len(others) > 0.8


def test_home_is_out_of_the_way():
    assert KeyboardTyping(y=0.02, yaw=15.0).infeasible() is None
    hand = PARTNER_HOME - (TABLE_TOP + 0.2) * UP
    assert abs(hand[1]) - Keyboard().size[1] / 2 - 0.02 > MIN_CLEARANCE and math.isclose(hand[2], 0.0)


def test_every_constraint_refutes_what_violates_it():
    each_refuted_for_its_own_reason(
        [
            KeyboardTyping(mine=0b100010),
            KeyboardTyping(mine=0b00011),
            KeyboardTyping(keyboard=Keyboard(pitch=0.031)),
            KeyboardTyping(x=0.1, yaw=30.0, y=0.1),
            KeyboardTyping(x=-0.2, y=0.1, yaw=-10.0),
        ]
    )
