"""One take: an episode that a person drives, control period by control period. It knows neither devices nor clocks."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...control.loop import Loop
from ...episode import STRICT, Actions, Episode, Outcome, Rules
from ...errors import ScengenError
from ...look.looks import Look
from ...scenario import Scenario
from ...sim.boxes import box_around
from ...sim.world import World
from ...validate.rollout import Rollout, replay
from .mapping import ARM_CONTROLS, Grips, action_of, advanced, motion
from .pad import CONNECTED, Pad, PadEvent

MOMENT_PERIODS = 10
"""Number of control periods between two saved states."""
UNDO_TIME = 1.0
"""Time by which one press of the undo button goes back [s]."""

Phase = Literal["ready", "running", "paused", "settling", "ended"]
"""Phase of a take. `ready`: the first motion starts the clock. `settling`: the goal was reached and has to last."""
READY: Phase = "ready"
RUNNING: Phase = "running"
PAUSED: Phase = "paused"
SETTLING: Phase = "settling"
ENDED: Phase = "ended"
LOST = "the pad is unplugged; plug it in and press start"
"""Message of a take whose pad was unplugged."""
MISSING = "there is no pad; plug one in and press start"
"""Message of a take that starts without a pad."""
RESUME = "press start, or enter on the keyboard"
"""Message of such a take once there is a pad."""
CONTROLS = f"""{ARM_CONTROLS}\
B held: no motion (clutch)     Y: next arm     X: undo one second     start: pause, go on, keep     back: give up
"""
"""All controls as text."""


@dataclass(frozen=True)
class Stage:
    """A scenario that is driven."""

    name: str
    scenario: Scenario
    scene_xml: str
    embodiment: str
    horizon: float
    """Time limit for reaching the goal [s]."""
    settle: float
    """Time for which a reached goal has to last [s]."""
    rules: Rules = STRICT
    """Rules that end the episode."""

    def world(self, look: Look | None = None) -> World:
        """The world of its scene at the start."""
        return World.load(self.scene_xml, self.embodiment, look)


@dataclass(frozen=True)
class StateLine:
    """Text that the person reads next to the picture. Programs that drive get the same and nothing else."""

    phase: Phase
    time: float
    """Time of the episode [s]."""
    horizon: float
    """Time limit [s]."""
    outcome: Outcome | None
    """Outcome so far; None while it is open."""
    reason: str
    """Reason of an outcome that is not a success."""
    message: str
    """Latest message, such as that of an unplugged pad."""
    arm: int
    """Number of the driven arm."""
    grip: float
    """Gripper command of the driven arm, -1 open to 1 closed."""
    hand: tuple[float, float, float]
    """Position of the driven hand [m]."""
    pointing: tuple[float, float, float]
    """Direction in which the driven hand points."""
    opening: tuple[float, float, float]
    """Direction in which its fingers open."""
    bodies: dict[str, tuple[float, ...]]
    """Pose of each body of the scene: position [m], orientation wxyz."""
    boxes: dict[str, tuple[float, ...]]
    """Box around each body in its own axes: least x, y, z and greatest x, y, z [m]."""

    @property
    def text(self) -> str:
        """The line for people, without message and poses."""
        told = self.outcome or self.phase
        reason = f": {self.reason}" if self.reason else ""
        x, y, z = self.hand
        where = f"hand {x:.3f} {y:.3f} {z:.3f} m, grip {self.grip:+.2f}"
        whose = f"arm {self.arm}, " if self.arm else ""
        return f"{self.time:5.2f} of {self.horizon:g} s   {told}{reason}   {whose}{where}"


@dataclass(frozen=True)
class _Moment:
    """A saved state of a take."""

    periods: int
    state: NDArray[np.float64]
    grips: Grips
    held: float


class Session:
    """A take. Call `tick` once in every control period with the events since the last call.

    A take is a function of the events of its ticks alone, so that its log drives it again.
    """

    def __init__(self, stage: Stage, world: World | None = None):
        """Start a take.

        Args:
            world: the world of the stage, which is reset; by default it is loaded.
        """
        self.stage, self.world, self.pad = stage, world or stage.world(), Pad()
        self.world.reset()
        self.episode = Episode(stage.scenario, self.world, stage.horizon, stage.rules)
        self.phase: Phase = READY
        self.message = ""
        self.ticks = 0
        """Number of ticks since the start, those without motion included."""
        self.log: list[tuple[int, PadEvent]] = []
        """All events with the ticks at which they acted."""
        self.undone = 0
        """Number of times that the person went back."""
        self.given_up = False
        """Whether the person has discarded the take."""
        self.finished = False
        """Whether the person has left the take: it is kept, or given up."""
        self._actions: list[NDArray[np.float32]] = []
        self._grips = Grips(tuple(arm.grip for arm in self.world.arms))
        self._met = False
        """Whether the pad was there in a control period of this take."""
        self._settling = 0
        self._moments: list[_Moment] = []
        self._remember()

    # --- control periods ------------------------------------------------------------------

    def tick(self, events: Sequence[PadEvent] = ()) -> None:
        """Take the events of a control period, and simulate it if the episode runs."""
        self.log += [(self.ticks, event.check()) for event in events]
        pressed = self.pad.update(events)
        self.ticks += 1
        self._command(pressed)
        if self.phase == RUNNING:
            self._grips = advanced(self._grips, self.pad, pressed)
            self._step(action_of(self.pad, self._grips))
            if self.episode.outcome == "success":
                self.phase, self._settling = SETTLING, round(self.stage.settle / Loop.PERIOD)
            elif self.episode.outcome is not None:
                self._end()
        elif self.phase == SETTLING:
            if self._settling:
                self._settling -= 1
                self._step(self.world.idle)
            if not self._settling or self.episode.outcome != "success":
                self._end()

    def finish(self) -> None:
        """Leave the take, as after the last event of a file. An episode without an outcome is given up."""
        while self.phase == SETTLING:
            self.tick()
        self.given_up = self.given_up or self.episode.outcome is None
        self.finished = True

    def _command(self, pressed: set[str]) -> None:
        """Act on the buttons that are not for the arm."""
        if not self.pad[CONNECTED]:
            if self.phase in (RUNNING, READY):
                self.phase, self.message = PAUSED, LOST if self._met else MISSING
            return
        self._met = True
        if self.message in (LOST, MISSING):
            self.message = RESUME
        if "back" in pressed:
            self.given_up = self.finished = True
            self.phase = ENDED
        elif "x" in pressed and self.phase != SETTLING:
            self._undo()
        elif "start" in pressed:
            if self.phase == ENDED:
                self.finished = True
            elif self.phase == RUNNING:
                self.phase, self.message = PAUSED, "paused; press start to go on"
            elif self.phase in (READY, PAUSED):
                self._run()
        elif self.phase == READY and self._moves(pressed):
            self._run()

    def _moves(self, pressed: set[str]) -> bool:
        """Whether the person asks the robot for something."""
        return bool(motion(self.pad).any() or pressed & {"a"} or advanced(self._grips, self.pad, set()) != self._grips)

    def _run(self) -> None:
        self.phase, self.message = RUNNING, ""

    def _step(self, action: NDArray[np.float64]) -> None:
        self._actions.append(self.world.received(action))
        self.episode.step(self._actions[-1])
        if len(self._actions) % MOMENT_PERIODS == 0 and self.episode.outcome is None:
            self._remember()

    def _end(self) -> None:
        self.episode.outcome, self.episode.reason = self.episode.settled()
        self.phase = ENDED
        self.message = "start: keep and go on, X: undo, back: give up"

    # --- undo -----------------------------------------------------------------------------

    def _remember(self) -> None:
        self._moments.append(_Moment(len(self._actions), self.world.state(), self._grips, self.episode.held))

    def _undo(self) -> None:
        """Return to the last state that is at least `UNDO_TIME` old; the next motion goes on from there."""
        target = len(self._actions) - round(UNDO_TIME / Loop.PERIOD)
        while len(self._moments) > 1 and self._moments[-1].periods > target:
            self._moments.pop()
        moment = self._moments[-1]
        del self._actions[moment.periods :]
        self.world.restore(moment.state)
        self._grips = moment.grips
        self.episode.outcome, self.episode.reason, self.episode.lacks = None, "", ""
        self.episode.held = moment.held
        self.undone += 1
        self.phase, self.message = READY, f"back at {self.world.time:.2f} s"

    # --- results --------------------------------------------------------------------------

    @property
    def actions(self) -> Actions:
        """Filtered actions so far, shape (n, 7 * arms)."""
        return np.array(self._actions, np.float32).reshape(-1, self.world.size)

    @property
    def line(self) -> StateLine:
        """The state line of now."""
        arm, world = self.world.arms[self._grips.active], self.world
        rotation = arm.hand_rot
        return StateLine(
            phase=self.phase,
            time=round(world.time, 2),
            horizon=self.stage.horizon,
            outcome=self.episode.outcome,
            reason=self.episode.reason,
            message=self.message,
            arm=arm.number,
            grip=self._grips.commands[arm.number],
            hand=_point(arm.hand),
            pointing=_point(rotation[:, 2]),
            opening=_point(rotation[:, 0]),
            bodies={name: self._pose(number) for name, number in self._scene_bodies.items()},
            boxes=self._boxes,
        )

    @cached_property
    def _scene_bodies(self) -> dict[str, int]:
        """Indices of the bodies of the scene by their names."""
        model, own = self.world.model, self.world.own
        return {name: i for i in range(1, model.nbody) if i not in own and (name := model.body(i).name)}

    @cached_property
    def _boxes(self) -> dict[str, tuple[float, ...]]:
        """Boxes around the bodies of the scene, without bodies that only mark a place."""
        model, found = self.world.model, {}
        for name, body in self._scene_bodies.items():
            geoms = np.flatnonzero(model.geom_bodyid == body)
            if not len(geoms):
                continue
            found[name] = tuple(round(float(value), 4) for value in box_around(model, geoms).ravel())
        return found

    def _pose(self, number: int) -> tuple[float, ...]:
        data = self.world.data
        return tuple(round(float(value), 4) for value in (*data.xpos[number], *data.xquat[number]))

    def replayed(self) -> Rollout:
        """The take as a rollout: its actions, played again from the start in a new world.

        Raises:
            ScengenError: the replay ends in other bits, or with another outcome.
        """
        stage = self.stage
        again = replay(stage.scenario, stage.world(), self.actions, stage.horizon, stage.settle, rules=stage.rules)
        if again.digest != self.world.digest or again.outcome != self.episode.outcome:
            told = f"it ends as {again.outcome} in {again.digest}, not as {self.episode.outcome} in {self.world.digest}"
            raise ScengenError(f"{stage.name}: the take does not replay bit for bit: {told}")
        return again


def _point(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
