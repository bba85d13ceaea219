"""M02: turns are taken by the clock, without a look at the partner or at what is bold."""

from collections.abc import Callable

from hand import Hand, otherwise

from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, hold
from scengen.tasks.keyboard_typing import KeyboardTyping

TURN_TIME = 4.0  # from the start of a turn of the partner until its first letter has been typed, without a pause [s]
LETTER_TIME = 2.0  # for each further letter of its turn [s]
LEAVE_TIME = 1.5  # until the partner has left [s]
PRESS_TIME = 0.35  # longer than any key of training must be held [s]


class NoPause(KeyboardTyping):
    """The task without the partner's pauses and without means."""

    def pause(self, k: int) -> float:
        return 0.0


def unmended(scenario: Scenario) -> Scenario:
    return otherwise(with_values(NoPause(), values(scenario)))


def by_the_clock(pause: float) -> Callable[[Scenario, World], Plan]:
    """Type the own letters; in each turn of the partner wait beside the keyboard for a time that is known beforehand.

    Args:
        pause: wait beyond the time that the partner's letters take [s].
    """

    def plan(scenario: Scenario, world: World) -> Plan:
        assert isinstance(scenario, KeyboardTyping)
        place = 0
        for k in scenario.own:
            if others := k - place:
                yield from scenario.make_room(world)
                yield from hold(world.arm, pause + TURN_TIME + LETTER_TIME * (others - 1) + LEAVE_TIME, CLOSED)
            yield from scenario.press(world, k, seconds=PRESS_TIME)
            place = k + 1
        yield from scenario.make_room(world)

    return plan


HANDS = {
    "by_the_clock": Hand(by_the_clock(0.0), unmended),
    "by_the_longest_clock": Hand(by_the_clock(18.0), unmended),
}
