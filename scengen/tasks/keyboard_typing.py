"""M02 keyboard-typing: type a word together with another robot, each its own letters, in their order.

        o partner          seen from above; the keyboard lies between the two arms
       /
      /  [Q W E R T Y U I O P]        H o U s E     the word stands behind the keyboard: blue letters are the agent's,
        [A S D F G H J K L]                         orange ones the partner's; what has been typed is bold, there and
      \\   [Z X C V B N M]                           on its key
       \\
        o agent

Bottleneck: every letter has its turn and its owner. From the word, or the colours of the caps, and from the bold
letters the agent must infer whose turn it is. It must keep away from the keyboard in the partner's turn, hit one key of
26 with a finger 26 mm wide, and keep it down until it counts. No key takes a letter back.

Decisions, where the paper (App. B, M02) is silent, or contradicts itself (one arm in App. B.1, two in App. B):

* The agent is the right arm, as in every episode of the paper, and acts with 7 numbers. The left arm is part of the
  scene: events move it by a law of memory and poses alone, so that an episode can be saved, restored and repeated. It
  types, when it is its turn, if the agent's hand is `MIN_CLEARANCE` beside the keyboard, then goes home to its own
  side. If the agent comes back before the letter counts, the partner turns round and waits again.
* The partner pauses before each of its turns, for a time that is unknown to the agent. An agent whose hand stays beside
  the keyboard for `TURN_LIMIT` in its own turn has let its turn go by, and no goal counts any more. The paper has
  neither. The two close turn-taking by the clock, without a look at the partner or at the bold letters: the best fixed
  wait fits a quarter of the turns, and in training there are two in a word. The partner's motion reveals a turn, too.
* A letter is typed when an arm touches its key, and no other, for `hold` without a break. A shorter touch is allowed.
  Holding a key that is not next, or the other's, or several at once ends the episode. No goal counts after contact of
  the arms. A typed key must be released before it counts again.
* The colours of the caps alone give word and places (72 of 72 in training), without the word. That is fair.
* The keyboard lies loose on the table: an arm that drags it moves the keys. The paper gives no lengths.
* The agent does not know how long `hold` is. A letter that becomes bold shows that the press was long enough.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import mujoco
import numpy as np

from ..assets.display import place_with_display, show_typed
from ..assets.keyboard import LETTERS, Keyboard, disable
from ..assets.prop import TABLE_TOP, table
from ..assets.words import WORDS
from ..control.loop import Loop
from ..decisions import Decision, choice, near
from ..geometry import UP, Vec3, about_z
from ..means import Mean, throughout
from ..params import param
from ..predicates import KEY_MEMORY, SEVERAL_KEYS, count_time, fallen, key_that_counts, long_enough
from ..robots import panda
from ..scenario import Plan, Refutation, Scenario, Shortcut, require
from ..sim.arm import Arm
from ..sim.memory import remember
from ..sim.world import World
from ..skills import keys, motion
from ..skills.motion import CLOSED, COARSE, OPEN, facing_down, go_to, until, wait

MIN_CLEARANCE = 0.15
"""Distance beside the keyboard at which a hand is out of the other arm's way [m]: a palm is 0.10 m to each side."""
PARKED_HAND: Vec3 = np.array([-0.20, -0.45, TABLE_TOP + 0.20])  # of the agent's hand, out of the partner's way [m]
PARTNER_HOME: Vec3 = PARKED_HAND * [1.0, -1.0, 1.0]  # of the partner's hand, out of the agent's way [m]
TURN_LIMIT = 2.5
"""Longest time that the agent's hand may stay beside the keyboard in its own turn, the partner being out of the way
[s]; the oracle needs 0.3 to 0.6 s."""
TURN_TIMEOUT = 40.0  # after which the oracle stops waiting for a turn [s]
TIME_MARGIN = 0.05  # beyond `hold`, for which shortcuts press a key [s]
TIP_HALF_WIDTH = 0.013  # of the closed finger tips, along y [m]
MAX_REACH = 0.70
"""Distance from an arm's first axis up to which a hand that points down goes exactly to its target [m]; measured."""
MISTAKES = ("", "several keys were held at once", "the letter was not next", "the letter was the other robot's")
MEMORY = ("typed", "mistake", *KEY_MEMORY, "waited")
"""Number of letters typed; number of the mistake; touches of keys; in the partner's turn the time since the agent was
last in its way, in the agent's turn the time that it let go by [s]."""


@dataclass(frozen=True, kw_only=True)
class KeyboardTyping(Scenario):
    """A keyboard between two arms, and a word whose letters are shared out."""

    VERSION = 2

    word: int = param(0, "words", 0, len(WORDS) - 1)  # number of the word in `WORDS`
    mine: int = param(0b01010, "1", 1, 254, answer=True)
    """Places of the word that are the agent's, one bit each; the lowest bit is the first letter."""
    hold: float = param(0.2, "s", 0.05, 1.0, hidden=True)
    """Time that a key must be touched until it counts; the move is called `motion.hold`."""
    pace: float = param(0.22, "m/s", 0.05, 0.30)  # speed of the partner's hand
    first_pause: float = param(0.0, "s", 0.0, 20.0, hidden=True)  # of the partner, before its first turn
    second_pause: float = param(0.0, "s", 0.0, 20.0, hidden=True)  # before its second turn
    third_pause: float = param(0.0, "s", 0.0, 20.0, hidden=True)  # before its third turn; later turns have none
    x: float = param(-0.10, "m", -0.2, 0.1)
    y: float = param(0.0, "m", -0.1, 0.1)
    yaw: float = param(0.0, "deg", -30.0, 30.0)
    keyboard: Keyboard = Keyboard(mass=0.8)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, *MEMORY)
        place_with_display(scene, self.keyboard, "keyboard", self.spot, math.radians(self.yaw), self.letters, self.owns)
        return scene

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.memory["typed"] == len(self.letters)

    def failure(self, world: World) -> str | None:
        if mistake := MISTAKES[int(world.memory["mistake"])]:
            return mistake
        return "the keyboard fell off the table" if fallen(world, "keyboard") else None

    def means(self) -> Mapping[str, Mean]:
        return {
            "the agent came in each of its turns": throughout(lambda world: not self.late(world)),
            "the arms kept clear of each other": throughout(lambda world: not world.touched("robot0", "robot1")),
        }

    def events(self, world: World) -> None:
        """Count what is typed, show it, and move the partner."""
        (partner,) = world.partners
        for arm in (world.arm, partner):
            if number := key_that_counts(world, arm, "keyboard", self.hold):
                self._judge_press(world, number, arm)
        self._watch_turn(world)
        k = int(world.memory["typed"])
        show_typed(world, "keyboard", k)
        key = self.key(world, k) if self.partner_next(world) and world.memory["waited"] > self.pause(k) else None
        counts = long_enough(world.memory["held_1"], self.hold)
        partner.set_action(
            keys.type_or_go_home(partner, self.keyboard, "keyboard", key, counts, PARTNER_HOME, self.pace)
        )

    def _judge_press(self, world: World, key: int, arm: Arm) -> None:
        """Judge a key that counts: it is the next letter, and this arm's, or a mistake."""
        k = int(world.memory["typed"])
        if key == SEVERAL_KEYS:
            world.memory["mistake"] = 1.0
        elif k == len(self.letters) or LETTERS[key - 1] != self.letters[k]:
            world.memory["mistake"] = 2.0
        elif self.owns(k) != (arm.number == 0):
            world.memory["mistake"] = 3.0
        else:
            world.memory["typed"], world.memory["waited"] = k + 1.0, 0.0

    def _watch_turn(self, world: World) -> None:
        """Measure for how long the partner could have typed without a break, or the agent has let its turn go by."""
        memory, beside = world.memory, self.beside(world, world.arm)
        if self.partner_next(world):
            count_time(world, "waited", beside)
        elif beside and self.beside(world, *world.partners):
            memory["waited"] += Loop.PERIOD

    def late(self, world: World) -> bool:
        """Whether the agent has stayed beside the keyboard for too long in its own turn. The paper has no limit."""
        k = int(world.memory["typed"])
        return k < len(self.letters) and self.owns(k) and world.memory["waited"] > TURN_LIMIT

    def pending(self, world: World) -> bool:
        """Whether the partner has a letter to type, and goes there by itself after a pause."""
        return self.partner_next(world) and self.beside(world, world.arm)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait beside the keyboard for each own letter's turn, go and type it; at the end make room for the partner."""
        yield from self.type_own(world, len(self.letters))
        yield from self.make_room(world)

    def type_own(self, world: World, end: int) -> Plan:
        """Type the own letters before place `end` of the word, each when it is its turn."""
        for k in [k for k in self.own if k < end]:
            yield from self.await_turn(world, k)
            yield from self.press(world, k)

    def await_turn(self, world: World, k: int) -> Plan:
        """Wait, out of the way, until a place of the word is the next one and the partner has left the keyboard."""
        if world.memory["typed"] < k:
            yield from self.make_room(world)
            yield from wait(world.arm, lambda: world.memory["typed"] >= k, TURN_TIMEOUT)
        yield from wait(world.arm, lambda: self.beside(world, *world.partners), TURN_TIMEOUT)

    def make_room(self, world: World) -> Plan:
        """Go beside the keyboard, if the hand is not there."""
        if not self.beside(world, world.arm):
            yield from keys.rise(world.arm, self.keyboard, "keyboard")
            yield from go_to(world.arm, PARKED_HAND, facing_down(), COARSE, CLOSED)

    def press(self, world: World, k: int, aside: float = 0.0, seconds: float = math.inf, grip: float = CLOSED) -> Plan:
        """Type the letter of a place: over its key, down, stay there until a letter becomes bold, up.

        Args:
            aside: offset along the row by which the key is missed [m].
            seconds: longest time on the key [s].
            grip: gripper command of the hand.
        """
        shift = aside * world.rot("keyboard")[:, 1]
        spot, count = lambda: self.key(world, k) + shift, lambda: world.memory["typed"]
        late = lambda: world.memory["held_0"] > seconds - 1e-9  # noqa: E731
        yield from keys.press(world.arm, self.keyboard, "keyboard", spot, count, late, grip)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        again = [k for k in self.own[:-1] if not (self.owns(k + 1) and self.letters[k + 1] == self.letters[k])]
        once_more = {"once_more": Shortcut(lambda world: self._repeat_letter(world, again[0]))}
        return {
            **(once_more if again else {}),
            "type_it_all": Shortcut(lambda world: self._press_all(world, range(len(self.letters)))),
            "mine_without_waiting": Shortcut(lambda world: self._press_all(world, self.own, self.hold + TIME_MARGIN)),
            "one_key_aside": Shortcut(lambda world: self._press_first(world, neighbour=True)),
            "short_taps": Shortcut(lambda world: self._press_first(world, times=3, seconds=Loop.PERIOD)),
            "make_no_room": Shortcut(self._wait_over_key),
            "open_fingers": Shortcut(lambda world: self._press_first(world, grip=OPEN)),  # on the keys beside, too
        }

    def _press_all(self, world: World, places: Iterable[int], seconds: float = math.inf) -> Plan:
        """Type the letters of some places one after the other, in any turn."""
        for k in places:
            yield from self.press(world, k, seconds=seconds)

    def _repeat_letter(self, world: World, again: int) -> Plan:
        """Type as the oracle up to an own letter, and that one again, although it is not next, or not one's own."""
        yield from self.type_own(world, again + 1)
        yield from self.press(world, again, seconds=self.hold + TIME_MARGIN)

    def _press_first(
        self, world: World, times: int = 1, neighbour: bool = False, seconds: float = 0.0, grip: float = CLOSED
    ) -> Plan:
        """Wait for the turn of the first own letter, and press it, or the next key farther along the row.

        Args:
            seconds: time on the key [s]; by default long enough to count.
        """
        k, seconds = self.own[0], seconds or self.hold + TIME_MARGIN
        yield from self.await_turn(world, k)
        aside = -math.copysign(self.keyboard.pitch, self.keyboard.at(self.letters[k])[1]) if neighbour else 0.0
        for _ in range(times):
            yield from self.press(world, k, aside, seconds, grip)

    def _wait_over_key(self, world: World) -> Plan:
        """Wait for one's turn over the key for 4 s, and press when it does not come."""
        k = next(k for k in self.own if k > 0 and not self.owns(k - 1))
        yield from self.type_own(world, k)
        yield from go_to(world.arm, self.key(world, k) + keys.TRAVEL_HEIGHT * UP, facing_down(), COARSE, CLOSED)
        yield from until(motion.hold(world.arm, 4.0), lambda: world.memory["typed"] >= k)
        yield from self.press(world, k, seconds=self.hold + TIME_MARGIN)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The keys of the partner's letters give way: nothing touches them, and its turn never ends."""
        scene = self.build()
        for k, letter in enumerate(self.letters):
            if not self.owns(k):
                disable(scene, "keyboard", letter)
        return {"dead_keys_of_the_partner": scene}

    # --- decisions ---------------------------------------------------------------------------

    def decisions(self) -> Mapping[str, Decision]:
        first = self.keyboard.at(self.letters[self.own[0]])[:2]
        return {
            "starts": choice(self.owns(0), "typed_*", "* of typed"),
            "own_places": choice(tuple(self.own), "typed_*", "* of typed"),
            "word": choice(self.word, "typed_*", "* of typed"),
            "first_own_key": near(
                self.spot[:2] + about_z(math.radians(self.yaw))[:2, :2] @ first, 0.010, "typed_*", "x", "y", "yaw"
            ),
        }

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        places = len(self.letters)
        yield require(self.mine < 2**places, "the share names a place that the word has not", mine=self.mine)
        first, last = min((k for k in range(places) if not self.owns(k)), default=places), max(self.own)
        yield require(first < last, "there is no turn of the partner to wait for", first=first, last=last)
        room = self.keyboard.pitch - self.keyboard.cap / 2 - TIP_HALF_WIDTH
        yield require(room >= 0.006, "a finger that presses a key touches its neighbour", room=room)
        axes = about_z(math.radians(self.yaw))
        apart = min(self.keyboard.outside(axes.T @ (hand - self.spot)) for hand in (PARKED_HAND, PARTNER_HOME))
        yield require(apart > MIN_CLEARANCE, "nowhere is a hand out of the way", apart=apart, least=MIN_CLEARANCE)
        right, left = panda.bases(2)
        for k, letter in enumerate(self.letters):
            base = right if self.owns(k) else left
            away = math.hypot(*(self.spot + axes @ self.keyboard.at(letter) - base)[:2])
            yield require(away <= MAX_REACH, "a key is out of its owner's reach", away=away, reach=MAX_REACH)

    def features(self) -> Mapping[str, float]:
        """Length of the word, the agent's share of it, and what a press needs: way [m], clearance [m], time [s];
        speed of the partner [m/s], its pauses [s], yaw [rad]."""
        spots = [self.keyboard.at(self.letters[k]) for k in self.own]
        return {
            "letters": float(len(self.letters)),
            "repeated_letters": float(len(self.letters) - len(set(self.letters))),
            "own_share": len(self.own) / len(self.letters),
            "own_way": float(sum(math.dist(a, b) for a, b in pairwise(spots))),
            "room_beside_a_finger": self.keyboard.pitch - self.keyboard.cap / 2 - TIP_HALF_WIDTH,
            "time_on_a_key": self.hold,
            "partner_speed": self.pace,
            "pauses": self.first_pause + self.second_pause + self.third_pause,
            "keyboard_yaw": math.radians(self.yaw),
        }

    def facts(self) -> Mapping[str, float | str]:
        return {
            "letters": len(self.letters),
            "own": len(self.own),
            "begins": "this robot" if self.owns(0) else "the other robot",
            "ends": "this robot" if self.owns(len(self.letters) - 1) else "the other robot",
        }

    # --- geometry -------------------------------------------------------------------------

    @cached_property
    def letters(self) -> str:
        """The word."""
        return WORDS[self.word]

    def owns(self, k: int) -> bool:
        """Whether a place of the word is the agent's."""
        return bool(self.mine >> k & 1)

    @cached_property
    def own(self) -> list[int]:
        """The agent's places."""
        return [k for k in range(len(self.letters)) if self.owns(k)]

    def partner_next(self, world: World) -> bool:
        """Whether the next letter is the partner's."""
        k = int(world.memory["typed"])
        return k < len(self.letters) and not self.owns(k) and not world.memory["mistake"]

    def pause(self, k: int) -> float:
        """Time for which the partner waits before it types a place of the word [s]: none within a turn."""
        starts = [j for j in range(k + 1) if not self.owns(j) and (j == 0 or self.owns(j - 1))]
        pauses = (self.first_pause, self.second_pause, self.third_pause)
        return pauses[len(starts) - 1] if starts[-1] == k and len(starts) <= len(pauses) else 0.0

    @cached_property
    def spot(self) -> Vec3:
        """Initial position of the keyboard [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    def key(self, world: World, k: int) -> Vec3:
        """Current position of the middle of the upper face of the key for a place of the word [m]."""
        return world.pos(f"keyboard/key_{self.letters[k]}")

    def beside(self, world: World, arm: Arm) -> bool:
        """Whether an arm's hand is out of the way."""
        return self.keyboard.outside(world.rot("keyboard").T @ (arm.hand - world.pos("keyboard"))) >= MIN_CLEARANCE
