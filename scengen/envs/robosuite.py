"""Scenarios as robosuite environments: import this module, then `robosuite.make("DominoSingle", ...)`.

    row = Pool.open("generated/domino_single-id").row("3f")
    env = robosuite.make("DominoSingle", robots="Panda", scenario=row, use_camera_obs=False)

robosuite composes the model, its controller moves the robot, and its clock steps the physics. scengen adds the text of
the scene, the suction cup, the events of the scene, and the verdict, which is that of certification.
"""

import math
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from .. import compose
from ..assets.prop import TABLE_HALF
from ..control.loop import Loop
from ..control.osc import CLOSED_JAW
from ..control.teleop import check_filter
from ..episode import STRICT, Episode, Rules, check_rules
from ..errors import BadConfig, PoolError, UnknownName
from ..look.looks import PLAIN
from ..perturb.drawn import Drawn, Senses
from ..perturb.perturbation import Perturbation
from ..pictures.opengl import check_size, current, release
from ..pool import PoolRow
from ..pool.library import Library
from ..pool.row import SceneRow
from ..robots import panda
from ..samplers import task_files
from ..scenario import Scenario
from ..sim.embodiment import JAW, SUCTION, action_size, all_hands, hands
from ..sim.world import World
from ..validate.identity import check_versions
from ..validate.playable import scene_errors
from .object_state import NAME, ObjectState, bodies_of, rounded
from .observations import turns_pictures
from .pools import Folders, chosen, scenes_of
from .robomimic import IMAGE, names
from .robosuite_models import SceneModel, SceneTask  # first, because it keeps robosuite's import quiet

# isort: split
from robosuite import macros
from robosuite.environments.base import REGISTERED_ENVS
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.utils.mjcf_utils import IMAGE_CONVENTION_MAPPING
from robosuite.utils.observables import Observable, sensor

Observations = OrderedDict[str, Any]

ROBOT = "Panda"
"""robosuite's name of the certified robot."""
JOINT_POS = "joint_pos"
"""End of the name of the reading from which robosuite also gives cosine and sine."""
GRIPPERS = {JAW: "PandaGripper", SUCTION: "SuctionGripper"}
"""robosuite's names of the hands of scengen's embodiments."""


class RobosuiteEnv(ManipulationEnv):
    """The scenarios of one task as a robosuite environment; `env_class` makes a class for each task.

    `reward` is 1 once the goal has been reached, else 0. `done` is true at the horizon only, as in all environments of
    robosuite. `info` holds `scenario`, `success`, `reason`, the reason of a failure, and `lacks`, the means of the
    task without which the goal was reached.
    Goal, failures and events of the scene follow the certificate's clock of 100 Hz with any `control_freq`. The
    certificate itself holds for 100 Hz and robosuite's default controller.

    If a scenario is seen turned or mirrored (`Scenario.orientation`), every camera observation is turned, depth and
    segmentation included. `seen_<body>_pos`, of modality "seen", is the position at which the picture shows a body.
    `<body>_pos`, the robot's own pose and actions stay as they are. `object-state` is that of the Gymnasium
    environment, entry by entry.

    Under a perturbation lights, cameras, colour pictures, readings and the instruction are drawn as in the Gymnasium
    environment with `look="plain"`, whose scenes these are. Readings in `object-state` have its errors. Depth and
    segmentation are those of the changed cameras, without what happens to pictures. `info` holds `perturb`.

    `get_ep_meta` contains the id of the scenario, for robosuite's demonstrations. After `set_ep_meta` with this id,
    hard resets load that scenario.
    """

    NAME: ClassVar[str] = ""
    """Name of the task."""
    SEARCH: ClassVar[tuple[str, ...]] = ()
    """Further folders that may hold its file, see `task_files.search_path`."""

    sim: Any
    """robosuite's simulation."""
    row: SceneRow
    """Row of the running scenario in its pool."""
    scenario: Scenario
    """Running scenario. Privileged: it holds the hidden parameters, which a policy must find out."""
    episode: Episode
    """Outcome and reason so far, by the certificate's clock."""
    world: World
    """Access to robosuite's model and data by names. Read it only; robosuite steps the simulation."""

    def __init__(
        self,
        robots: str | Sequence[str] | None = None,
        scenario: PoolRow | str | None = None,
        pool: Folders | None = None,
        use_object_obs: bool = True,
        gripper_types: str | Sequence[str] = "default",
        control_freq: int = 100,
        horizon: int | None = None,
        action_filter: str | None = None,
        rules: Rules = STRICT,
        reward_scale: float = 1.0,
        reward_shaping: bool = False,
        perturb: str | None = None,
        perturb_seed: int = 0,
        **arguments: Any,
    ):
        """Select the scenarios and build the first one.

        Args:
            robots: "Panda", or a list of two for a task with two arms. Default: the robots of the task.
            scenario: a row of a pool; or, with `pool`, a name, an id, or a unique prefix of an id, as in `Pool.row`.
                Without it, every hard reset draws one from the pools; robosuite's `seed` determines the draws.
            pool: folder of a pool or of demonstrations, or several folders of one kind.
            use_object_obs: whether to observe `object-state` and every reading in it, such as `<body>_pos` [m]
                (`scengen.envs.object_state`); and `seen_<body>_pos` [m], if the family turns pictures.
            gripper_types: "default" for the hands of the task; other hands are refused.
            control_freq: actions per second.
            horizon: actions in an episode. Default: the task's time limit.
            rules: "strict", those of the certificates: a goal counts if it was reached by the means of the task; or
                "paper": it counts however it was reached.
            action_filter: None, the paper's interface for policies; or "teleop" for the filter of teleoperation and of
                the oracles, which is defined for 100 Hz.
            reward_scale: reward of a reached goal.
            reward_shaping: False. There is no intermediate reward, because it would reveal how to solve the puzzle.
            perturb: kinds of perturbation at their levels, such as `camera_angle@3+noise@1` (docs/perturb.md).
            perturb_seed: another number draws other perturbations for the same scenarios.
            arguments: the other arguments of robosuite's ManipulationEnv, with its defaults.

        Raises:
            ScengenError: there is no such scenario, or it is of another task, or was made with other versions of
                MuJoCo or robosuite; pictures cannot have this size, or are turned by a quarter and are not square; a
                perturbation affects nothing that is observed.
        """
        self.perturbation, self._perturb_seed = Perturbation.parse(perturb), perturb_seed
        self.perturbation.check_perceived("robosuite's own controller would ignore it; use the Gymnasium environment")
        _check_filter_rate(action_filter, control_freq)
        check_rules(rules)
        if reward_shaping:
            raise BadConfig("reward_shaping = True; the only reward is that of the goal: give reward_shaping=False")
        for name in ("camera_widths", "camera_heights"):
            for edge in np.atleast_1d(np.array(arguments.get(name, ()), object)):
                check_size(**{name: edge})
        self.action_filter, self.reward_scale, self.use_object_obs = action_filter, reward_scale, use_object_obs
        self.rules: Rules = rules
        self.task = compose.load_task(self.NAME, self.SEARCH)
        self._choice = _choice(self.NAME, scenario, pool)
        grippers = self._certified_grippers(gripper_types)
        self._object_state: NDArray[np.float64] | None = None
        if use_object_obs:
            bodies = bodies_of(self.task, _scenes(self._choice))
            self.objects = ObjectState(bodies, self._controlled_arms)
        super().__init__(
            robots=[ROBOT] * len(grippers) if robots is None else robots,
            gripper_types=grippers,  # type: ignore[arg-type]
            control_freq=control_freq,
            horizon=round(self.task.horizon * control_freq) if horizon is None else horizon,
            **arguments,
        )

    # --- robosuite's interface ------------------------------------------------------------

    def reward(self, action: NDArray[np.float64] | None = None) -> float:
        """`reward_scale` once the goal has been reached, else 0."""
        return self.reward_scale * float(self._check_success())

    def reset(self) -> Observations:
        """Reset as robosuite does, and run the scene's events of the first control period."""
        observations = super().reset()
        self._begin_episode()
        return observations

    def step(self, action: NDArray[np.float64]) -> tuple[Observations, float, bool, dict[str, Any]]:
        """Step as robosuite does, after the action filter, if there is one."""
        self._begin_episode()  # robosuite allows a step without a reset
        return super().step(self.world.received(action) if self.action_filter else action)

    @property
    def action_spec(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Smallest and largest action of the controlled arms. The scene itself drives its own arms."""
        low, high = map(np.asarray, super().action_spec)
        return low[: self.action_dim], high[: self.action_dim]

    @property
    def action_dim(self) -> int:
        """Number of entries of an action."""
        return action_size(self.task.embodiment)

    @property
    def _controlled_arms(self) -> int:
        """Number of robots that actions control."""
        return len(hands(self.task.embodiment))

    def __reduce__(self) -> NoReturn:
        raise TypeError("robosuite's simulation cannot be copied or pickled; make another environment")

    def _certified_grippers(self, gripper_types: str | Sequence[str]) -> list[str]:
        """robosuite's names of the task's hands, one for each arm.

        Raises:
            BadConfig: other hands were given.
        """
        grippers = [GRIPPERS[hand] for hand in all_hands(self.task.embodiment)]
        if gripper_types != "default" and _listed(gripper_types) != grippers:
            self._refuse("gripper_types", _listed(gripper_types), grippers)
        return grippers

    def _check_success(self) -> bool:
        """Whether the goal has been reached, without a failure since."""
        return self.episode.outcome == "success"

    def _check_robot_configuration(self, robots: Sequence[str]) -> None:
        certified = [ROBOT] * len(all_hands(self.task.embodiment))
        if list(robots) != certified:
            self._refuse("robots", robots, certified)
        layout = self.env_configuration
        if layout not in (layouts := ("default", "parallel") if len(certified) > 1 else ("default",)):
            self._refuse("env_configuration", [layout], layouts[-1:])

    def _refuse(self, argument: str, given: Sequence[str], certified: Sequence[str]) -> None:
        accepted = f"the scenarios of {self.NAME} are certified with {', '.join(certified)}"
        raise BadConfig(f"{argument} = {', '.join(given)}; {accepted}")

    def _load_model(self) -> None:
        super()._load_model()
        self.row = self._requested_row() or self._choice[int(self.rng.integers(len(self._choice)))]
        self.scenario = self.task.scenario(self.row.params)
        for width, height in zip(self.camera_widths, self.camera_heights, strict=True) if self.use_camera_obs else ():
            self.scenario.orientation.check_size(width, height)
        cameras = list(map(str, self.camera_names)) if self.use_camera_obs else []
        self.perturbation.check(self._streams, cameras, PLAIN, "use_camera_obs=True or use_object_obs=True")
        self.model = self._composed(self.row, self.perturbation.shows_spares)

    @property
    def _streams(self) -> list[str]:
        """This package's names of the observed streams."""
        own = {f"robot{number}_{JOINT_POS}" for number in range(len(all_hands(self.task.embodiment)))}
        return [*own, *([NAME] if self.use_object_obs else [])]

    def _composed(self, row: SceneRow, spare: bool = False) -> SceneTask:
        """The scene of a row with the loaded robots, and with spare geoms for distractors if they are needed."""
        robots = [robot.robot_model for robot in self.robots]
        for robot, base in zip(robots, panda.bases(len(robots)), strict=True):
            robot.set_base_xpos(robot.base_xpos_offset["table"](2 * TABLE_HALF) + base - panda.BASE)
        return SceneTask(SceneModel(row.scene_xml, spare), robots)

    def model_text(self, row: SceneRow) -> str:
        """The MJCF of a scenario as composed by robosuite, for demonstrations.

        Paths of meshes are relative to robosuite's own folder, so that `edit_model_xml` finds them on any machine.
        """
        text = self._composed(row).get_xml()
        return re.sub(r'file="[^"]*?(robosuite/models/[^"]*)"', r'file="\1"', text)

    def _initialize_sim(self, xml_string: str | None = None) -> None:
        with scene_errors():
            super()._initialize_sim(xml_string)
        ours, theirs = self.sim.model.opt.timestep, self.model_timestep
        if ours != theirs:
            raise BadConfig(f"robosuite.macros.SIMULATION_TIMESTEP = {theirs:g}; the scene's is {ours:g} s")
        self.sim.render = _rendering_in_any_thread(self.sim)
        row, model = self.row, self.sim.model._model
        self.drawn: Drawn = self.perturbation.senses(
            model, row.id, row.task, row.instruction, self._perturb_seed, self.SEARCH
        ).drawn

    def _setup_references(self) -> None:
        super()._setup_references()
        model, data = self.sim.model._model, self.sim.data._data
        self.world = World(model, data, Loop(model, data), len(self.robots) - self._controlled_arms)
        if self.world.loop.impairment:
            raise BadConfig(
                f"{self.row.name} is posed under conditions of control, which robosuite's own controller would ignore; "
                "play it in the Gymnasium environment"
            )

    def _setup_observables(self) -> Observations:
        observables = super()._setup_observables()
        for name, read in self._object_sensors().items() if self.use_object_obs else ():
            observables[name] = Observable(name=name, sensor=read, sampling_rate=self.control_freq)
        for name, observable in observables.items() if self.perturbation else ():
            if observable.modality.endswith("_proprio"):
                observable.set_sensor(self._erring(name, observable._sensor))
        return observables

    def _erring(self, name: str, read: Callable[[Any], NDArray]) -> Callable[[Any], NDArray]:
        """A sensor of the robot's own pose under the perturbation. Cosine and sine are those of the joints' reading."""
        robot, of, last = name.rpartition(f"{JOINT_POS}_")
        function = {"cos": np.cos, "sin": np.sin}.get(last) if of else None
        if function is None:
            return self._perceived(names(self.task.embodiment).get(name, name), read, lambda reading: reading)
        arms = (*self.world.arms, *self.world.partners)
        number = int(re.sub(r"\D", "", robot))

        @sensor(modality=read.__modality__)  # type: ignore[attr-defined]
        def joints(_: Any) -> NDArray:
            return arms[number].joint_pos

        return self._perceived(f"{robot}{JOINT_POS}", joints, function)

    def _perceived(
        self, stream: str, read: Callable[[Any], NDArray], function: Callable[[NDArray], NDArray]
    ) -> Callable[[Any], NDArray]:
        """A sensor with a function of what is perceived of a stream."""

        @sensor(modality=read.__modality__)  # type: ignore[attr-defined]
        def perceived(cache: Any) -> NDArray:
            reading = np.asarray(read(cache), float)
            entries = [f"{stream}.{number}" for number in range(reading.size)]
            return function(self._senses.reading(stream, entries, self._moment, reading))

        return perceived

    @property
    def _moment(self) -> float:
        """Time of the present observation [s]: the end of a step. robosuite reads its sensors at the beginning."""
        return math.ceil(self.world.time * self.control_freq - 1e-6) / self.control_freq

    def _create_camera_sensors(self, *arguments: Any, **named: Any) -> tuple[list[Callable[..., Any]], list[str]]:
        """robosuite's sensors, with pictures in the orientation of the running scenario and under the perturbation."""
        sensors, labels = super()._create_camera_sensors(*arguments, **named)
        cameras = [label.removesuffix(IMAGE) if label.endswith(IMAGE) else None for label in labels]
        return [self._oriented(*each) for each in zip(sensors, cameras, strict=True)], labels

    def _oriented(self, read: Callable[[Any], NDArray], camera: str | None) -> Callable[[Any], NDArray]:
        """A sensor with pictures as they are perceived.

        Args:
            camera: name of the camera; None for depth and segmentation.
        """
        rows = IMAGE_CONVENTION_MAPPING[macros.IMAGE_CONVENTION]  # 1: the first row is at the bottom; -1: on top

        @sensor(modality=read.__modality__)  # type: ignore[attr-defined]
        def picture(cache: Any) -> NDArray:
            seen = self.scenario.orientation.apply(read(cache)[::-rows])
            if camera is not None and self.perturbation:
                seen = self._senses.picture(camera, self._moment, seen)
            return seen[::-rows]

        return picture

    def _reset_internal(self) -> None:
        super()._reset_internal()
        if self.sim._render_context_offscreen is not None:
            release(self.sim._render_context_offscreen.gl_ctx)  # current since it was made; another thread may render
        # robosuite's controllers have read the arms before these took their initial posture: make them read again.
        for controller in (part for robot in self.robots for part in robot.part_controllers.values()):
            controller.new_update = True
        if self.world.loop.holds:
            self._close_jaw()
        self.sim.data.qacc_warmstart[:] = 0.0  # the constructors of the controllers have changed it
        self.world.filter.reset()
        self._senses = Senses(self.drawn)
        self.episode, self._substep = Episode(self.scenario, self.world, self.row.horizon, self.rules), 0
        self._started = False

    def _close_jaw(self) -> None:
        """Close the jaw of the first arm on what it holds at the start."""
        model, (gripper, *_) = self.world.model, self.robots[0].gripper.values()
        names = panda.arms(model)[0]
        self.world.data.qpos[panda.fingers(model, names)] = panda.start_fingers(model, names)
        gripper.current_action, self.world.arms[0].grip = np.array(CLOSED_JAW), 1.0
        mujoco.mj_forward(model, self.world.data)

    def _pre_action(self, action: NDArray[np.float64], policy_step: bool = False) -> None:
        """Command the arms; robosuite calls it between mj_step1 and mj_step2 of every physics step."""
        assert len(action) == self.action_dim, f"an action has {self.action_dim} numbers, not {len(action)}"
        actions = np.split(np.asarray(self.world.with_partner_actions(action)), len(self.robots))
        for number, (robot, own) in enumerate(zip(self.robots, actions, strict=True)):
            # The scene's own arms get a new action in every control period, with any `control_freq`.
            robot.control(own, policy_step=policy_step if number < self._controlled_arms else self._substep == 0)
        self.world.record_grip(action)
        self.world.loop.watch(first=self._substep == 0)

    def _update_observables(self, force: bool = False) -> None:
        """Update observables and clock; robosuite calls it after every physics step, and after a reset (`force`)."""
        self._object_state = None
        super()._update_observables(force)
        if not force:
            self._substep = (self._substep + 1) % self.world.loop.substeps
            if self._substep == 0:
                self._end_period()

    def _post_action(self, action: NDArray[np.float64]) -> tuple[float, bool, dict[str, Any]]:
        reward, done, info = super()._post_action(action)
        success = self._check_success()
        found = {"success": success, "reason": self.episode.reason, "lacks": self.episode.lacks}
        told = {"perturb": self.drawn.plain()} if self.perturbation else {}
        return reward, done, {**info, "scenario": self.row.id, **found, **told}

    # --- choice of the scenario -----------------------------------------------------------

    def get_ep_meta(self) -> dict[str, Any]:
        """Metadata of an episode for demonstrations: the scenario's id, the instruction as `lang`, the perturbation."""
        told = {"scenario": self.row.id, "lang": self.drawn.instruction or self.row.instruction}
        if self.perturbation:
            told |= {"perturb": str(self.perturbation), "perturb_seed": self._perturb_seed}
        return {**super().get_ep_meta(), **told}

    def _requested_row(self) -> SceneRow | None:
        """The scenario whose id was given to `set_ep_meta`, or None."""
        if (id_ := self._ep_meta.get("scenario")) is None:
            return None
        if isinstance(self._choice, Library):
            return self._choice[self._choice.find(str(id_))]
        (row,) = self._choice
        if row.id != id_:
            raise UnknownName("scenario to choose from", str(id_), [row.id])
        return row

    # --- the certificate's clock ----------------------------------------------------------

    def _begin_episode(self) -> None:
        """Run the scene's events of the first control period, unless they have been run."""
        if not self._started:
            self._started = True
            self.episode.begin()

    def _end_period(self) -> None:
        """Judge the past control period, and run the scene's events of the next one."""
        mujoco.mj_kinematics(self.world.model, self.world.data)  # otherwise poses are those of 2 ms before
        if self.episode.outcome is None and self.world.warnings:
            self.episode.outcome, self.episode.reason = "unstable", ", ".join(self.world.warnings)
        self.episode.judge()
        self.episode.begin()

    def _object_sensors(self) -> dict[str, Callable[[Any], NDArray[np.float64]]]:
        """Sensors of all readings of `object-state`, and of the positions where pictures show movable bodies [m]."""

        def reading(where: slice) -> Callable[[Any], NDArray[np.float64]]:
            @sensor(modality="object")
            def part(_: Any) -> NDArray[np.float64]:
                if self._object_state is None:  # read once for all readings of a moment
                    reading = self.objects.read(self.world)
                    self._object_state = self._senses.reading(NAME, self.objects.names, self._moment, reading)
                return self._object_state[where]

            return part

        def shown(body: str) -> Callable[[Any], NDArray[np.float64]]:
            @sensor(modality="seen")
            def seen(_: Any) -> NDArray[np.float64]:
                return self.scenario.orientation.seen_at(rounded(self.world.pos(body), "pos"))

            return self._perceived(f"seen_{body}_pos", seen, lambda reading: reading)

        readings = {name: reading(where) for name, where in self.objects.segments.items()}
        turned = [body for body, moves in self.objects.bodies.items() if moves and turns_pictures(self.task.family)]
        return {**readings, **{f"seen_{body}_pos": shown(body) for body in turned}}


del REGISTERED_ENVS[RobosuiteEnv.__name__]  # only its subclasses have a task


def env_class(task: str, search: tuple[str, ...] = ()) -> type[RobosuiteEnv]:
    """The environment class of a task, registered in robosuite under the task's name in CamelCase.

    Args:
        task: name of the task.
        search: folders of other packages, see `task_files.search_path`.

    Raises:
        BadConfig: robosuite has another environment of that name.
    """
    name = "".join(part.capitalize() for part in task.split("_"))
    known = REGISTERED_ENVS.get(name, RobosuiteEnv)
    if not issubclass(known, RobosuiteEnv):
        raise BadConfig(f"task {task}: robosuite has its own environment {name}; rename the task")
    if (task, search) == (known.NAME, known.SEARCH):
        return known
    about = f"Scenarios of the task {task}; see {RobosuiteEnv.__name__}."
    return type(name, (RobosuiteEnv,), {"NAME": task, "SEARCH": search, "__doc__": about, "__module__": __name__})


def _rendering_in_any_thread(sim: Any) -> Callable[..., Any]:
    """`sim.render` with its own context. robosuite draws with the context that happens to be current in a thread."""
    render, lock = sim.render, threading.Lock()

    def in_this_thread(*arguments: Any, **named: Any) -> Any:
        if (context := sim._render_context_offscreen) is None:
            return render(*arguments, **named)  # robosuite refuses it
        with lock, current(context.gl_ctx):
            return render(*arguments, **named)

    return in_this_thread


def _check_filter_rate(action_filter: str | None, control_freq: int) -> None:
    """Raise `ScengenError` if there is no such filter, or if it is not defined for this rate."""
    check_filter(action_filter)
    if action_filter and control_freq != round(1 / Loop.PERIOD):
        raise BadConfig(f"action_filter = {action_filter}; it is defined for control_freq=100, not {control_freq}")


def _listed(names: str | Sequence[str]) -> list[str]:
    return [names] if isinstance(names, str) else list(names)


def _choice(task: str, scenario: PoolRow | str | None, pool: Folders | None) -> Sequence[SceneRow]:
    """The scenarios to draw from: one row, one scenario of some pools, or all scenarios of the pools.

    Raises:
        ScengenError: there is no such scenario, or it is of another task, or was made with other versions.
    """
    if isinstance(scenario, PoolRow) and pool is None:
        where = f"scenario {scenario.name}"
        check_versions(scenario.certificate.versions, where)
        if scenario.task != task:
            raise PoolError(f"{where} belongs to {scenario.task}, not to {task}")
        return [scenario]
    if pool is None or isinstance(scenario, PoolRow):
        raise BadConfig(
            "no scenario was given; give scenario=Pool.open(folder).row(id), or pool=folder and scenario=id"
        )
    return chosen(scenes_of(pool, task), scenario)


def _scenes(rows: Sequence[SceneRow]) -> Iterator[str]:
    """Texts of the scenes of some rows."""
    if isinstance(rows, Library):
        return (scene for (scene,) in rows.columns("scene_xml"))
    return (row.scene_xml for row in rows)


for _name in task_files.tasks():
    env_class(_name)
