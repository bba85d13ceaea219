"""M02 keyboard-typing: type a word together with another robot, each its own letters, in their order.

        o partner          seen from above; the keyboard lies between the two arms
       /
      /  [Q W E R T Y U I O P]        H o U s E     the word stands behind the keyboard: blue letters are the agent's,
        [A S D F G H J K L]                         orange ones the partner's; what has been typed is bold, there and
      \\   [Z X C V B N M]                           on its key
       \\
        o agent

Bottleneck: every letter has its turn and its owner. The agent must tell from the word and from what is bold whose turn
it is, keep away from the keyboard while it is the partner's, hit one key of 26 with a finger 26 mm wide, and keep it
down until it counts. There is no key that takes a letter back.

Decisions, where the paper (App. B, M02) is silent, or contradicts itself (one arm in App. B.1, two in App. B):

* The agent is the right arm and acts with 7 numbers. The left arm is part of the scene: its events move it by a law of
  memory and poses alone, so that an episode can be saved, restored and repeated. It types in its turn as soon as the
  agent's hand is `CLEAR` beside the keyboard, and goes home to its own side. If the agent comes back while it is still
  on its way there it turns round; what it has begun to press it finishes.
* A letter is typed when an arm has touched its key, and no other, for `hold` without a break. Touching a key for less
  is no mistake. A key held that is not next, or is the other's, or several at once, lose the episode. A key that has
  been typed must be let go of before it counts again.
* Arms that touch each other lose the episode.
* The keyboard lies loose on the table: who drags it moves the keys. The paper gives no lengths.
* Nobody is told how long `hold` is. That a letter has become bold tells that it was long enough.
* Left and right are not exchanged: who is the agent is the same in every episode of the paper.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np

from ..assets.glyph import write
from ..assets.keyboard import LETTERS, PRINT_SIZE, Keyboard
from ..assets.prop import TABLE_TOP, Rgba, place, shown, table
from ..control.loop import Loop
from ..geometry import UP, Mat3, Vec3, about_z, between, quat
from ..params import param
from ..predicates import fallen
from ..robots import panda
from ..scenario import Action, Plan, Refutation, Scenario, Shortcut, require
from ..sim.memory import remember
from ..sim.world import Arm, World
from ..skills.motion import CLOSED, COARSE, FINE, OPEN, Pace, facing_down, go_to, hold, steer, until, wait

TRAINED = tuple("WORLD PLANT MUSIC FRUIT BREAD CHAIR HOUSE NIGHT QUICK JUMBO GHOST BLACK".split())
UNSEEN = tuple("TABLE STONE CLOUD OCEAN TIGER LEMON SUGAR VIDEO PIANO ZEBRA WALTZ FLAME".split())
DOUBLED = tuple("APPLE HELLO SWEET GRASS HAPPY LEVEL KAYAK RADAR".split())
LONG = tuple("PICTURE KITCHEN DOLPHIN TROUBLE PROBLEM MONKEYS JOURNAL HUSBAND".split())
WORDS = TRAINED + UNSEEN + DOUBLED + LONG
"""Every word that there is, by its number: five different letters, five with a letter twice, seven different ones."""

CLEAR = 0.15
"""How far beside the keyboard a hand is out of the other's way [m]: a palm is 0.10 m long to either side."""
ASIDE: Vec3 = np.array([-0.20, -0.45, TABLE_TOP + 0.20])
HOME: Vec3 = ASIDE * [1.0, -1.0, 1.0]
"""Where the agent's hand and the partner's are out of the other's way [m]."""
OVER = 0.10
"""Height of a hand's way over the keys [m]."""
LOW, NEAR, ON = 0.02, 0.004, 0.010
"""The partner: how far under its way it counts as being down, how near to a key's middle it is when it begins to go
down, and how far from there it may come while it is down [m]. From 12 mm on it would touch the neighbour."""
DEEP = 0.010
"""How far below the upper face of a cap the partner aims [m]. It arrives at 0.04 m/s and presses with about 4 N: the
controller of a hand that is stopped from below pushes it aside too, the more the harder it presses."""
PRESS, ABOVE, SOFTLY = 0.006, 0.02, Pace(0.08, 0.0, 20.0)
"""The agent's oracle: how far below that face it aims, from how far above it comes down slowly [m], and how."""
PATIENCE, LINGER = 20.0, 0.10
"""How long it waits for a turn at most, and stays on a key that has become bold [s]: who repeats what it did without
looking may then be that much too short."""
LONGER, STUBBORN = 0.05, 4.0
"""How much longer than needed shortcuts hold a key, and how long one waits for its turn over it [s]."""
NOWHERE: Vec3 = np.zeros(3)
TIP_HALF, NARROWEST = 0.013, 0.006
"""Half of the closed finger tips along y, and the least free way to a neighbouring cap [m]."""
EXACT = 0.70
"""Distance from an arm's first axis up to which a hand that points down gets exactly where it should [m]; measured."""
LARGE, BOLD, SPACING, BEHIND = 0.024, 0.0020, 0.030, 0.035
"""Of the word on the display: its height, half the width of a bold stroke, the distance of its letters, and how far
behind the keyboard it stands [m]."""
HIDDEN, PROUD = 0.03, 0.0003
"""How far below the table top bold letters wait until they are shown, and how far before the faint ones then [m]."""
SHADES: tuple[tuple[Rgba, Rgba, Rgba], ...] = (
    ((1.0, 0.80, 0.55, 1.0), (0.96, 0.66, 0.38, 1.0), (0.70, 0.25, 0.0, 1.0)),
    ((0.70, 0.82, 1.0, 1.0), (0.48, 0.66, 1.0, 1.0), (0.0, 0.10, 0.55, 1.0)),
)
"""Colour of a cap, of a faint and of a bold letter: the partner's, the agent's."""
SEVERAL = -1
"""Stands in memory for more than one key at once."""
MISTAKES = ("", "several keys were held at once", "the letter was not next", "the letter was the other robot's")
MEMORY = ("typed", "mistake", "key_0", "held_0", "key_1", "held_1")
"""How many letters have been typed; the number of the mistake that was made; which key each arm touches, counted from
1, or `SEVERAL`, and for how long without a break [s]."""


@dataclass(frozen=True, kw_only=True)
class KeyboardTyping(Scenario):
    """A keyboard between two arms, and a word whose letters are shared out."""

    word: int = param(0, "words", 0, len(WORDS) - 1)
    """Its number in `WORDS`."""
    mine: int = param(0b01010, "1", 1, 254)
    """Which places of the word are the agent's, a bit for each; the lowest is the first letter's."""
    hold: float = param(0.2, "s", 0.05, 1.0, hidden=True)
    """How long a key must be touched until it counts."""
    pace: float = param(0.22, "m/s", 0.05, 0.30)
    """How fast the partner goes."""
    x: float = param(-0.10, "m", -0.2, 0.1)
    y: float = param(0.0, "m", -0.1, 0.1)
    yaw: float = param(0.0, "deg", -30.0, 30.0)
    keyboard: Keyboard = Keyboard(mass=0.8)

    # --- scene ----------------------------------------------------------------------------

    def build(self) -> mujoco.MjSpec:
        scene = table()
        remember(scene, *MEMORY)
        place(scene, self.keyboard, "keyboard", self.spot, math.radians(self.yaw))
        turn = quat("z", math.radians(self.yaw))
        body, half = scene.body("keyboard"), [LARGE, SPACING * len(self.letters) / 2, 0.0005]
        shown(body, "display", (0.97, 0.97, 0.95, 1.0), size=half, pos=self._shown_at((len(self.letters) - 1) / 2))
        for k, letter in reversed(list(enumerate(self.letters))):  # a letter twice: its key shows the first owner
            cap, faint, bold = SHADES[self.owns(k)]
            scene.geom(f"keyboard/cap_{letter}").rgba = np.array(cap, np.float32)
            write(body, letter, self._shown_at(k), LARGE, BOLD / 2, faint, f"faint_{k}")
            typed = scene.worldbody.add_body(name=f"typed_{k}", mocap=True, pos=self.spot - HIDDEN * UP, quat=turn)
            for where, height in (
                (self._shown_at(k), LARGE),
                (self.keyboard.at(letter), PRINT_SIZE * self.keyboard.cap),
            ):
                write(typed, letter, where + PROUD * UP, height, BOLD, bold, f"bold_{height:.3f}_{k}")
        return scene

    def _shown_at(self, k: float) -> Vec3:
        """Where a place of the word stands on the display, in the keyboard's axes [m]."""
        across = (len(self.letters) - 1) / 2 - k
        return np.array([self.keyboard.size[0] / 2 + BEHIND, SPACING * across, 0.001])

    # --- goal -----------------------------------------------------------------------------

    def success(self, world: World) -> bool:
        return world.memory["typed"] == len(self.letters)

    def failure(self, world: World) -> str | None:
        if mistake := MISTAKES[int(world.memory["mistake"])]:
            return mistake
        if world.touched("robot0", "robot1"):
            return "the arms touched each other"
        return "the keyboard fell off the table" if fallen(world, "keyboard") else None

    def events(self, world: World) -> None:
        """Count what is typed, show it, and move the partner."""
        (partner,) = world.partners
        for arm in (world.arm, partner):
            self._count(world, arm)
        keyboard = world.body("keyboard")
        for k in range(int(world.memory["typed"])):
            world.move(f"typed_{k}", world.data.xpos[keyboard], world.data.xquat[keyboard])
        partner.tell(self._partner(world, partner))

    def _count(self, world: World, arm: Arm) -> None:
        """Watch which key an arm touches, and for how long."""
        memory, key, held = world.memory, f"key_{arm.number}", f"held_{arm.number}"
        touched = [name for name in world.touching_bodies(arm.label) if name.startswith("keyboard/key_")]
        now = SEVERAL if len(touched) > 1 else LETTERS.index(touched[0][-1]) + 1 if touched else 0
        before = memory[held]
        memory[held] = (before if now == memory[key] else 0.0) + Loop.PERIOD if now else 0.0
        memory[key] = now
        if self._long(memory[held]) and not (self._long(before) and memory[held] > before):
            self._type(world, now, arm)

    def _long(self, held: float) -> bool:
        return held > self.hold - 1e-9

    def _type(self, world: World, key: int, arm: Arm) -> None:
        """A key counts: it is the next letter, of this arm, or a mistake."""
        k = int(world.memory["typed"])
        if key == SEVERAL:
            world.memory["mistake"] = 1.0
        elif k == len(self.letters) or LETTERS[key - 1] != self.letters[k]:
            world.memory["mistake"] = 2.0
        elif self.owns(k) != (arm.number == 0):
            world.memory["mistake"] = 3.0
        else:
            world.memory["typed"] = k + 1.0

    def pending(self, world: World) -> bool:
        """As long as the partner has something to type and is let to it."""
        return self._wanted(world, *world.partners) is not None

    # --- the partner ------------------------------------------------------------------------

    def _wanted(self, world: World, arm: Arm) -> Vec3 | None:
        """The key that the partner is going for [m], or None."""
        k = int(world.memory["typed"])
        if k == len(self.letters) or self.owns(k) or world.memory["mistake"]:
            return None
        return self.key(world, k) if self.beside(world, world.arm) or not self._high(world, arm) else None

    def _high(self, world: World, arm: Arm) -> bool:
        return bool(arm.hand[2] > self._way(world) - LOW)

    def _way(self, world: World) -> float:
        """Height at which hands go over the keys [m]."""
        return float(world.pos("keyboard")[2]) + self.keyboard.height + OVER

    def _partner(self, world: World, arm: Arm) -> Action:
        """Over the key, down on it until it counts, up, home: a law of where the hand is now."""
        key, hand, high = self._wanted(world, arm), arm.hand, self._high(world, arm)
        spot = HOME if key is None else key
        way, off = self._way(world), math.hypot(*(spot - hand)[:2])
        if off > (NEAR if high else ON):
            goal = np.array([*(spot if high else hand)[:2], max(way, HOME[2] if key is None else 0.0)])
        elif key is None:
            goal = HOME
        else:
            goal = key + OVER * UP if self._long(world.memory["held_1"]) else key - DEEP * UP
        ahead = goal - hand
        distance = math.sqrt(ahead @ ahead)
        velocity = ahead * (min(self.pace, 4.0 * distance) / max(distance, 1e-9))
        return steer(arm, hand, velocity, between(arm.hand_rot, facing_down()), CLOSED)

    # --- oracle ---------------------------------------------------------------------------

    def oracle(self, world: World) -> Plan:
        """Wait beside the keyboard for each own letter's turn, go and type it; in the end make room for the others."""
        for k in self.own:
            yield from self.await_turn(world, k)
            yield from self.press(world, k)
        yield from self.make_room(world)

    def await_turn(self, world: World, k: int) -> Plan:
        """Wait, out of the way, until a place of the word is the next one and the partner has left the keyboard."""
        if world.memory["typed"] < k:
            yield from self.make_room(world)
            yield from wait(world.arm, lambda: world.memory["typed"] >= k, PATIENCE)
        yield from wait(world.arm, lambda: self.beside(world, *world.partners), PATIENCE)

    def make_room(self, world: World) -> Plan:
        """Go beside the keyboard, if the hand is not there."""
        if not self.beside(world, world.arm):
            yield from self._rise(world)
            yield from go_to(world.arm, ASIDE, facing_down(), COARSE, CLOSED)

    def _rise(self, world: World) -> Plan:
        """Straight up to where hands go over the keys."""
        hand = world.arm.hand
        if hand[2] < self._way(world) - LOW:
            yield from go_to(world.arm, [*hand[:2], self._way(world)], facing_down(), COARSE)

    def press(
        self, world: World, k: int, shift: Vec3 = NOWHERE, seconds: float = math.inf, grip: float = CLOSED
    ) -> Plan:
        """Type the letter of a place: over its key, down, stay there until a letter becomes bold, up.

        Args:
            shift: by how much the key is missed [m].
            seconds: how long it is held at most.
            grip: of the hand.
        """
        arm, down, over = world.arm, facing_down(), self.key(world, k) + shift
        yield from self._rise(world)
        yield from go_to(arm, [*over[:2], self._way(world)], down, COARSE, grip)
        over = self.key(world, k) + shift
        yield from go_to(arm, over + ABOVE * UP, down, FINE, grip)
        before = world.memory["typed"]

        def done() -> bool:
            return world.memory["typed"] > before or world.memory["held_0"] > seconds - 1e-9

        yield from until(go_to(arm, over - PRESS * UP, down, SOFTLY, grip), done)
        if world.memory["typed"] > before:
            yield from hold(arm, LINGER, grip)
        yield from self._rise(world)

    # --- what must not work ---------------------------------------------------------------

    def shortcuts(self) -> Mapping[str, Shortcut]:
        again = [k for k in self.own[:-1] if not (self.owns(k + 1) and self.letters[k + 1] == self.letters[k])]
        once_more = {"once_more": Shortcut(lambda world: self._once_more(world, again[0]))}
        return {
            **(once_more if again else {}),
            "type_it_all": Shortcut(self._type_all),
            "mine_without_waiting": Shortcut(self._mine_at_once),
            "one_key_aside": Shortcut(self._one_aside),
            "short_taps": Shortcut(self._taps),
            "make_no_room": Shortcut(self._no_room),
            "open_fingers": Shortcut(self._open),
        }

    def _type_all(self, world: World) -> Plan:
        """All letters in their order, the partner's too."""
        for k in range(len(self.letters)):
            yield from self.press(world, k)

    def _mine_at_once(self, world: World) -> Plan:
        """Own letters one after the other, whoever's turn it is; each held long enough for any key."""
        for k in self.own:
            yield from self.press(world, k, seconds=self.hold + LONGER)

    def _once_more(self, world: World, again: int) -> Plan:
        """Like the oracle up to an own letter, and that one again, although it is not next, or not one's own."""
        for k in [k for k in self.own if k <= again]:
            yield from self.await_turn(world, k)
            yield from self.press(world, k)
        yield from self.press(world, again, seconds=self.hold + LONGER)

    def _first(self, world: World) -> Plan:
        """Like the oracle until it is the turn of the first own letter."""
        yield from self.await_turn(world, self.own[0])

    def _one_aside(self, world: World) -> Plan:
        """One key farther along the row."""
        yield from self._first(world)
        across = self.keyboard.at(self.letters[self.own[0]])[1]
        shift = -math.copysign(self.keyboard.pitch, across) * world.rot("keyboard")[:, 1]
        yield from self.press(world, self.own[0], shift, self.hold + LONGER)

    def _taps(self, world: World) -> Plan:
        """Up again as soon as the key has been touched, three times."""
        yield from self._first(world)
        for _ in range(3):
            yield from self.press(world, self.own[0], seconds=Loop.PERIOD)

    def _no_room(self, world: World) -> Plan:
        """Wait for one's turn over the key, and press when it does not come."""
        k = next(k for k in self.own if k > 0 and not self.owns(k - 1))
        for before in [before for before in self.own if before < k]:
            yield from self.await_turn(world, before)
            yield from self.press(world, before)
        yield from go_to(world.arm, self.key(world, k) + OVER * UP, facing_down(), COARSE, CLOSED)
        yield from until(hold(world.arm, STUBBORN), lambda: world.memory["typed"] >= k)
        yield from self.press(world, k, seconds=self.hold + LONGER)

    def _open(self, world: World) -> Plan:
        """With fingers that have not been closed: they come down on the keys to both sides."""
        yield from self._first(world)
        yield from self.press(world, self.own[0], seconds=self.hold + LONGER, grip=OPEN)

    def ablations(self) -> Mapping[str, mujoco.MjSpec]:
        """The keys of the partner's letters give way: nothing touches them, and its turn never ends."""
        scene = self.build()
        for k, letter in enumerate(self.letters):
            if not self.owns(k):
                cap = scene.geom(f"keyboard/cap_{letter}")
                cap.contype = cap.conaffinity = 0
        return {"dead_keys_of_the_partner": scene}

    # --- constraints ------------------------------------------------------------------------

    def constraints(self) -> Iterator[Refutation | None]:
        places = len(self.letters)
        yield require(self.mine < 2**places, "the share names a place that the word has not", mine=self.mine)
        others = [k for k in range(places) if not self.owns(k)]
        first, last = min(others, default=places), max(self.own)
        yield require(first < last, "there is no turn of the partner to wait for", first=first, last=last)
        room = self.keyboard.pitch - self.keyboard.cap / 2 - TIP_HALF
        yield require(room >= NARROWEST, "a finger that presses a key touches its neighbour", room=room)
        apart = min(self._beside(hand) for hand in (ASIDE, HOME))
        yield require(apart > CLEAR, "nowhere is a hand out of the way", apart=apart, least=CLEAR)
        right, left = panda.bases(2)
        for k, letter in enumerate(self.letters):
            base = right if self.owns(k) else left
            away = math.hypot(*(self.spot + self._axes @ self.keyboard.at(letter) - base)[:2])
            yield require(away <= EXACT, "a key is out of its owner's reach", away=away, reach=EXACT)

    def features(self) -> Mapping[str, float]:
        """How long the word is, how it is shared out, and what a press asks for: way [m], room [m], time [s]."""
        keys = [self.keyboard.at(self.letters[k]) for k in self.own]
        return {
            "letters": float(len(self.letters)),
            "repeated_letters": float(len(self.letters) - len(set(self.letters))),
            "own_share": len(self.own) / len(self.letters),
            "own_way": float(sum(math.dist(a, b) for a, b in pairwise(keys))),
            "room_beside_a_finger": self.keyboard.pitch - self.keyboard.cap / 2 - TIP_HALF,
            "time_on_a_key": self.hold,
            "partner_speed": self.pace,
            "keyboard_yaw": math.radians(self.yaw),
        }

    # --- geometry -------------------------------------------------------------------------

    @property
    def letters(self) -> str:
        """The word."""
        return WORDS[self.word]

    def owns(self, k: int) -> bool:
        """Whether a place of the word is the agent's."""
        return bool(self.mine >> k & 1)

    @property
    def own(self) -> list[int]:
        """The agent's places."""
        return [k for k in range(len(self.letters)) if self.owns(k)]

    @property
    def spot(self) -> Vec3:
        """Where the keyboard lies [m]."""
        return np.array([self.x, self.y, TABLE_TOP])

    @property
    def _axes(self) -> Mat3:
        return about_z(math.radians(self.yaw))

    def key(self, world: World, k: int) -> Vec3:
        """Middle of the upper face of the key for a place of the word, where it now is [m]."""
        return world.pos(f"keyboard/key_{self.letters[k]}")

    def beside(self, world: World, arm: Arm) -> bool:
        """Whether an arm's hand is out of the way."""
        away = world.rot("keyboard").T @ (arm.hand - world.pos("keyboard"))
        return self._outside(away) >= CLEAR

    def _beside(self, spot: Vec3) -> float:
        return self._outside(self._axes.T @ (spot - self.spot))

    def _outside(self, away: Vec3) -> float:
        """How far beyond the keyboard's outline a place is, along its axes [m]."""
        return float((np.abs(away) - self.keyboard.size / 2)[:2].max())
