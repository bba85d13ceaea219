"""Certification: every check of one scenario, cheap ones first."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from itertools import repeat
from typing import Any

import numpy as np

from .. import html_tables
from ..certificate import CHECKS, NOT_CHECKED, Certificate, Check
from ..control.loop import Loop
from ..episode import PAPER, Actions, Episode
from ..errors import BadConfig, ScengenError, UnknownName, where_written
from ..geometry import Mat3, Vec3
from ..scenario import Plan, Planner, Scenario
from ..sim import scene_text
from ..sim.embodiment import JAW, action_size
from ..sim.world import World
from .impaired import held, impaired, posed
from .rollout import AT_REST, Jitter, Rollout, go_on, replay, run, still_moving, try_shortcut
from .settings import QUICK, CertifySettings, Robust, lower_bound
from .words import lines


@dataclass(frozen=True, repr=False)
class Certified:
    """A certificate with the scene and the witness that it is about. The scene is empty if it was never built."""

    certificate: Certificate
    scene_xml: str
    witness: Actions
    digest: str
    """Hash of the physics state at the end of the witness."""

    def __repr__(self) -> str:
        return f"Certified({self.certificate.summary}, witness of {len(self.witness)} actions)"

    def _repr_html_(self) -> str:
        """Its checks, in a notebook."""
        rows = list(lines(self.certificate.checks))
        title = f"{self.certificate.verdict}, witness of {len(self.witness)} actions"
        return html_tables.table(title, ("check", "passed", "found"), rows, len(rows))


def certify(
    scenario: Scenario,
    horizon: float,
    settings: CertifySettings = QUICK,
    embodiment: str = JAW,
    last: str | None = None,
    adversary: "Adversary | None" = None,
    to_the_end: bool = False,
) -> Certified:
    """Run every check on a scenario, cheap ones first, until one fails.

    Args:
        scenario: an instance of a family that has an oracle.
        horizon: time limit for reaching the goal [s].
        settings: settings of the checks.
        embodiment: the robot, one of `scengen.sim.embodiment.EMBODIMENTS`.
        last: the check after which to stop, if only this check is of interest; nothing is certified then.
        adversary: attacks the scenario if the settings request it: `scengen.attack.check.attacked`.
        to_the_end: see `Trial`.

    Raises:
        BadConfig: the settings request an attack, and there is no adversary.
    """
    if settings.attack and adversary is None:
        what = f"certify.attack = {settings.attack}, but no adversary is given"
        raise BadConfig(f"{what}; pass adversary=scengen.attack.check.attacked")
    trial = Trial(scenario, horizon, settings, embodiment, adversary, to_the_end)
    checks: list[Check] = []
    for name in CHECKS:
        failed = bool(checks) and checks[-1].passed is False
        if failed or (checks and checks[-1].name == last):
            why = "skipped after a failed check" if failed else "not asked for"
            checks.extend(Check(rest, None, why, {}, {}) for rest in list(CHECKS)[len(checks) :])
            break
        checks.append(trial.check(name))
    solution = trial.solution
    empty = np.zeros((0, action_size(embodiment)), np.float32)
    return Certified(
        Certificate(settings.name, tuple(checks)),
        trial.text,
        solution.actions if solution else empty,
        solution.digest if solution else "",
    )


class Trial:
    """State that the checks of one scenario share: its text, its world, its solution.

    If a solution exists already, set `text` and `solution` to run only the checks that replay it.
    """

    def __init__(
        self,
        scenario: Scenario,
        horizon: float,
        settings: CertifySettings,
        embodiment: str,
        adversary: "Adversary | None" = None,
        to_the_end: bool = False,
    ):
        """
        Args:
            to_the_end: whether rollouts go on after what a check asks is decided, as in certificates of earlier
                releases: verdicts are the same, and some numbers differ.
        """
        self.scenario, self.horizon, self.settings, self.embodiment = scenario, horizon, settings, embodiment
        self.adversary, self.to_the_end = adversary, to_the_end
        self.text = ""
        """The scene, MJCF; empty before it compiles."""
        self.solution: Rollout | None = None
        """Rollout of the oracle that reached the goal, whose actions become the witness; None before there is one."""

    def check(self, name: str) -> Check:
        """Run one of `CHECKS`; some need the results of earlier ones."""
        checks = {
            "feasible": self._feasible,
            "compiles": self._compiles,
            "overlap": self._overlap,
            "rest": self._rest,
            "unsolved": self._unsolved,
            "idle": self._idle,
            "shortcuts": self._shortcuts,
            "solved": self._solved,
            "robust": self._robust,
            "numerics": self._numerics,
            "ablations": self._ablations,
            "witness": self._witness,
            "attack": self._attack,
        }
        settings, numbers, reason = checks[name]()
        waived = reason.startswith(NOT_CHECKED)
        return Check(name, None if waived else not reason, reason, settings, numbers)

    # Each check returns its settings, its numbers, and the reason of its failure: empty if it passed, and one that
    # starts with `NOT_CHECKED` if there is nothing to check.

    def _feasible(self) -> "Finding":
        """Constraints of the family. Numbers of a feasible scenario are the features that its physics depends on."""
        if refutation := self.scenario.infeasible():
            return {}, dict(refutation.numbers), refutation.reason
        return {}, dict(self.scenario.features()), ""

    def _compiles(self) -> "Finding":
        try:
            text, lost = scene_text.emit(self.scenario.build())
            if lost:
                return {}, lost, "the emitted text has lost elements"
            self.text = posed(text, self.scenario.conditions, self.scenario.under(None).id)
            self.world = self._load()
        except (ScengenError, ValueError) as error:
            if "repeated name" in str(error):  # in every draw
                where = where_written(type(self.scenario).build)
                raise BadConfig(f"{where}: {_one_line(error)}; give each its own name") from None
            return {}, {}, f"the scene does not compile: {_one_line(error)}"
        counts = {
            "bodies": self.world.model.nbody,
            "geoms": self.world.model.ngeom,
            "coordinates": self.world.model.nq,
        }
        return {}, counts, "" if not self.world.warnings else "MuJoCo warns at the start"

    def _overlap(self) -> "Finding":
        data = self.world.data
        depth = max((-float(c.dist) for c in data.contact[: data.ncon]), default=0.0)
        reason = f"bodies overlap by {1000 * depth:.1f} mm" if depth > self.settings.overlap else ""
        return {"overlap": self.settings.overlap}, {"deepest": depth}, reason

    def _rest(self) -> "Finding":
        """Whether bodies move without action. The goal is evaluated at the start, and at the end or before an event.

        Under conditions of control an arm may move without action, and what it holds with it.
        """
        world, limits = self.world, self.settings.rest
        moving = (*self.scenario.MOVING, held(world) if self.scenario.conditions else "")
        bodies = [b for b in world.free_bodies if b not in moving]

        def state() -> tuple[dict[str, tuple[Vec3, Mat3]], bool]:
            return {b: (world.com(b), world.rot(b)) for b in bodies}, self.scenario.success(world)

        start, self.solved_at_start = state()
        if self.solved_at_start is None:
            raise BadConfig(f"{where_written(type(self.scenario).success)}: it returned None; return True or False")
        end, self.solved_after_rest = start, self.solved_at_start
        episode, waiting = Episode(self.scenario, world, self.horizon, PAPER), self.scenario.pending(world)
        self.rested = episode
        for _ in range(self._resting_periods):
            if episode.step(world.received(world.idle)) == "unstable":
                return asdict(limits), {}, episode.reason
            if waiting and not self.scenario.pending(world):
                break  # motion that the event has started does not count
            if waiting:
                end, self.solved_after_rest = state()
        else:
            end, self.solved_after_rest = state()
        drift = {b: float(np.linalg.norm(end[b][0] - start[b][0])) for b in bodies}
        turn = {b: _angle(end[b][1], start[b][1]) for b in bodies}
        worst, most = (
            max(drift, key=drift.__getitem__, default=""),
            max(turn, key=turn.__getitem__, default=""),
        )
        numbers = {"drift": drift.get(worst, 0.0), "turn": turn.get(most, 0.0)}
        if numbers["drift"] > limits.drift:
            return asdict(limits), numbers, f"{worst} drifts {1000 * drift[worst]:.1f} mm while nobody acts"
        if numbers["turn"] > limits.turn:
            return asdict(limits), numbers, f"{most} turns {turn[most]:.1f} deg while nobody acts"
        return asdict(limits), numbers, ""

    def _unsolved(self) -> "Finding":
        if self.solved_at_start:
            return {}, {}, "the goal already holds at the start"
        return {}, {}, "the goal holds after settling" if self.solved_after_rest else ""

    def _idle(self) -> "Finding":
        """Whether doing nothing reaches the goal in any way. It may end at rest, after the seconds of `rest`.

        The rollout of `rest` goes on, unless it was decided before its end.
        """

        def wait(world: World) -> Plan:
            yield from repeat(world.idle, self._resting_periods - round(world.time / Loop.PERIOD))

        settle = self.settings.settle
        if self.rested.outcome is None:
            episode = go_on(self.rested, wait, settle)
        else:
            episode = run(self.scenario, self.world, wait, self.horizon, settle, until_settled=True, rules=PAPER)
        settings = {"horizon": self.horizon}
        return settings, _outcome(episode), "doing nothing reaches the goal" if episode.solved else ""

    @property
    def _resting_periods(self) -> int:
        """Number of control periods of the rest check."""
        return round(self.settings.rest.seconds / Loop.PERIOD)

    def _solved(self) -> "Finding":
        episode = self._run(self.scenario.oracle)
        if not episode.solved:
            return {"horizon": self.horizon}, _outcome(episode), f"the oracle failed: {episode.reason}"
        self.solution = episode
        return {"horizon": self.horizon}, _outcome(episode), ""

    def _shortcuts(self) -> "Finding":
        """Every tempting plan, through the teleoperation filter and without it, because a policy acts without it.

        The filtered one is played to its end and shows how it fails. The raw one ends when no goal counts any more, and
        is not played if its actions are those of the filtered one.
        """
        numbers: dict[str, dict[str, Any]] = {}
        settle, shorten = self.settings.settle, not self.to_the_end
        for name, shortcut in self.scenario.shortcuts().items():
            numbers[name] = {}
            tried: Rollout | None = None
            for how, raw in ACTIONS.items():
                if tried is None or tried.filtered:
                    decided = raw and shorten
                    tried = try_shortcut(self.scenario, self.world, shortcut, self.horizon, settle, raw, decided)
                numbers[name][how] = _outcome_of_shortcut(tried)
                if tried.solved:
                    return {}, numbers, f"{name!r} reaches the goal ({how})"
                if tried.outcome == "unstable" or (shortcut.to_rest and tried.reason != AT_REST):
                    seen = "reaches the goal" if tried.lacks else "was not seen to its end"
                    left = "" if tried.lacks else f"; still moving: {', '.join(still_moving(self.world)) or 'nothing'}"
                    return {}, numbers, f"{name!r} {seen} ({how}): {tried.reason}{left}"
        return {}, numbers, ""

    def _robust(self) -> "Finding":
        limits = self.settings.robust
        size = asdict(limits)
        failures: list[str] = []
        played = 0
        while played < limits.runs and (self.to_the_end or _can_reach(limits, len(failures))):
            jitter = Jitter.within(limits, self.scenario.id, played)
            episode = run(
                self.scenario,
                jitter.disturbed(self.world, self.scenario.DISTURBED),
                self.scenario.oracle,
                self.horizon,
                self.settings.settle,
                jitter,
            )
            if not episode.solved:
                failures.append(f"run {played}: {episode.reason}")
            played += 1
        solved = played - len(failures)
        bound = lower_bound(solved, played)
        numbers = {"runs": played, "solved": solved, "bound": bound, "failures": failures}
        if bound >= limits.bound:
            return size, numbers, ""
        if failures:
            return size, numbers, f"{solved} of {played} jittered runs succeed; {failures[0]}"
        return size, numbers, f"{limits.runs} runs cannot show a bound of {limits.bound:g}; ask for more"

    def _numerics(self) -> "Finding":
        """The witness with half the time step and with twice the iterations; if it fails, the oracle must succeed.

        If the solver has converged in every step of the solution, more iterations give the same bits, and the same end.
        """
        assert self.solution is not None
        half, patient = self._load(substeps=2 * self.world.loop.substeps), self._load()
        patient.model.opt.iterations *= 2
        numbers: dict[str, Any] = {}
        for name, world in {"half_time_step": half, "twice_the_iterations": patient}.items():
            if world is patient and self.solution.converged:
                kept = self.solution
            else:
                witness, settle = self.solution.actions, self.settings.settle
                kept = replay(self.scenario, world, witness, self.horizon, settle, until_settled=True)
            numbers[name] = {"witness": kept.outcome}
            if not kept.solved:
                again = run(self.scenario, world, self.scenario.oracle, self.horizon, self.settings.settle)
                numbers[name]["oracle"] = again.outcome
                if not again.solved:
                    return {}, numbers, f"at {name} both witness and oracle fail: {again.reason}"
        return {}, numbers, ""

    def _ablations(self) -> "Finding":
        assert self.solution is not None
        if not (ablations := self.scenario.ablations()):
            return {}, {}, no_ablations(self.scenario)
        numbers = {}
        for name, scene in ablations.items():
            text, _ = scene_text.emit(scene)
            if self.scenario.conditions:
                text = impaired(text, self.world.loop.impairment, self.embodiment)
            world, settle = World.load(text, self.embodiment), self.settings.settle
            try:
                episode = replay(self.scenario, world, self.solution.actions, self.horizon, settle, until_settled=True)
            except UnknownName as error:
                error.args = (f"{error} (in the ablation {name}, where it may be missing)",)
                raise
            numbers[name] = _outcome(episode)
            if episode.solved:
                return {}, numbers, f"the witness succeeds with {name!r}"
        return {}, numbers, ""

    def _witness(self) -> "Finding":
        """The recorded actions alone, in a freshly loaded world, which must end in the same bits."""
        assert self.solution is not None
        again = replay(self.scenario, self._load(), self.solution.actions, self.horizon, self.settings.settle)
        settings = {"settle": self.settings.settle}
        numbers = {"periods": len(self.solution.actions), "seconds": self.solution.seconds}
        if not again.solved:
            return settings, numbers, f"the recorded actions do not solve the scenario: {again.reason}"
        return (
            settings,
            numbers,
            "" if again.digest == self.solution.digest else "the replay ends in another state",
        )

    def _attack(self) -> "Finding":
        """Whether the built-in adversary reaches the goal without the means that the task requires."""
        if not self.settings.attack:
            return {}, {}, NO_ATTACK
        assert self.adversary is not None
        return self.adversary(self)

    def _load(self, substeps: int | None = None) -> World:
        return World.load(self.text, self.embodiment, substeps=substeps)

    def _run(self, planner: Planner) -> Rollout:
        return run(self.scenario, self.world, planner, self.horizon, self.settings.settle, whole=True)


Finding = tuple[Mapping[str, Any], Mapping[str, Any], str]
"""Settings and numbers of a check, and the reason of its failure."""
Adversary = Callable[[Trial], Finding]
"""Attacks the scenario of a trial that has a solution."""
ACTIONS = {"filtered": False, "raw": True}
"""Ways in which actions reach the controller, and whether that is raw."""
NO_ATTACK = f"{NOT_CHECKED}the settings ask for no rollouts of the adversary"
"""Reason in a certificate without an attack."""
NOT_TRIED = "not tried"
"""Outcome in a certificate of a shortcut that gave up: nothing is known about it."""


def no_ablations(scenario: Scenario) -> str:
    """Reason in a certificate of a family that has no ablations."""
    return NOT_CHECKED + (scenario.NO_ABLATIONS or "the family has no ablations, and does not say why")


def _can_reach(limits: Robust, failures: int) -> bool:
    """Whether the bound can still be shown after so many failures, or could not be shown by any."""
    return not failures or lower_bound(limits.runs - failures, limits.runs) >= limits.bound


def _outcome(episode: Rollout) -> dict[str, Any]:
    return {"outcome": episode.outcome, "reason": episode.reason, "seconds": episode.seconds}


def _outcome_of_shortcut(tried: Rollout) -> dict[str, Any]:
    """Like `_outcome`. A shortcut that gave up, and was not stopped by a failure, counts as not tried."""
    outcome = _outcome(tried)
    return {**outcome, "outcome": NOT_TRIED} if tried.gave_up and tried.outcome == "timeout" else outcome


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Angle between two orientations [deg]."""
    return math.degrees(math.acos(min(1.0, max(-1.0, (float(np.trace(a.T @ b)) - 1.0) / 2.0))))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
