"""Scenarios of scengen for inspect-robots: the robot as an embodiment, and the splits of pools as tasks.

inspect-robots run --task scengen -T pool=generated/id --embodiment scengen -E pool=generated/id --policy ...
"""

import numpy as np
from inspect_robots.embodiment import PRIVILEGED_SUCCESS, RENDERABLE, RESETTABLE, EmbodimentBase, EmbodimentInfo
from inspect_robots.scene import Scene
from inspect_robots.spaces import ActionSemantics, Box, CameraSpec, ObservationSpace, StateField, StateSpec
from inspect_robots.task import Task
from inspect_robots.types import Action, Observation, StepResult

from scengen.agents.scene import robot, streams
from scengen.assets.prop import TABLE_TOP
from scengen.control.osc import STEP, TURN
from scengen.envs.gym import PoolEnv, action_repeat_at
from scengen.envs.pools import rows_of
from scengen.evaluate.recorder import Player, Recorder
from scengen.perturb.language import Words
from scengen.perturb.perturbation import Perturbation
from scengen.pool import Pool
from scengen.pool.row import SceneRow
from scengen.sim.embodiment import hands

ARM = ("dx", "dy", "dz", "rx", "ry", "rz", "gripper")
"""Entries of the action of one arm."""
UNITS = np.array([STEP] * 3 + [TURN] * 3 + [1.0])
"""Size of an action of 1 [m, rad, gripper]."""


class ScengenEmbodiment(EmbodimentBase):
    """The robot in the scenarios of some pools. An action is a displacement of the hand [m, rad] and the gripper."""

    def __init__(
        self,
        pool: str,
        *,
        hz: int = 10,
        width: int = 256,
        cameras: bool = True,
        settle: bool = True,
        rules: str = "strict",
        perturb: str | None = None,
        perturb_seed: int = 0,
        lines: str | None = None,
        policy: str = "policy",
    ):
        """
        Args:
            pool: folder of a pool, or several folders separated by commas, of one task.
            hz: rate of the actions [Hz], which divides 100 Hz. An action is repeated for its whole step.
            width: width and height of pictures [pixels].
            cameras: whether the policy gets pictures; they need OpenGL.
            settle: whether a reached goal must still hold after a second with the robot idle.
            rules: `strict` or `paper`.
            perturb: kinds of perturbation at their levels, such as `light_direction@3+noise@1`.
            perturb_seed: another number draws other perturbations for the same scenarios.
            lines: folder for lines as those of `scengen evaluate`, which `scengen verify results=` rebuilds.
            policy: name of the policy in the lines.

        Raises:
            ScengenError: a setting or a pool is not valid.
        """
        self.pools = folders(pool)
        task = first_task(self.pools)
        embodiment = rows_of(self.pools, task)[0].embodiment
        self.env = PoolEnv(
            task,
            self.pools,
            streams(embodiment, cameras),
            width=width,
            height=width,
            action_repeat=action_repeat_at(hz, "hz"),
            settle=settle,
            rules=rules,
            perturb=perturb,
            perturb_seed=perturb_seed,
        )
        self.recorder = Recorder(lines, Player("inspect-robots", policy), self.env) if lines else None
        arms = len(hands(embodiment))
        sides = [""] if arms == 1 else ["right_", "left_"]
        self.units = np.tile(UNITS, arms)
        space = self.env.observation_space
        self.info = EmbodimentInfo(
            name="scengen",
            action_space=Box(
                shape=(7 * arms,),
                low=-self.units,
                high=self.units,
                semantics=ActionSemantics(
                    control_mode="eef_delta_pose",
                    rotation_repr="axis_angle",
                    gripper="binary",
                    frame="world",
                    dim_labels=tuple(side + entry for side in sides for entry in ARM),
                ),
            ),
            observation_space=ObservationSpace(
                cameras=tuple(CameraSpec(name, width, width) for name in self.env.cameras),
                state=StateSpec(
                    tuple(StateField(name, space[name].shape, dtype="float32") for name in self.env.streams)
                ),
            ),
            control_hz=float(hz),
            is_simulated=True,
            capabilities=frozenset({RESETTABLE, PRIVILEGED_SUCCESS, RENDERABLE}),
            docs=(
                f"{robot(embodiment)} The robot stands at the near edge of the table and faces the middle of it. x "
                "points away from the robot, y to its left, z up; the table's top is at z = "
                f"{TABLE_TOP:.2f} m. An action displaces the target of the hand, from where the hand is, by dx, dy, dz "
                "[m] and turns it by the rotation vector rx, ry, rz [rad], in the axes of the robot, at 100 Hz for one "
                "step; a gripper above 0 closes the jaw or switches suction on. Forces are felt at the wrist."
            ),
        )

    def reset(self, scene: Scene, *, seed: int | None = None) -> Observation:
        """Start the scenario with the id of the scene. Scenarios are stored, so the seed has no effect."""
        observation, _ = self.env.reset(options={"scenario": scene.id})
        if self.recorder:
            self.recorder.begin(self.env, observation)
        return self._observed(observation)

    def step(self, action: Action) -> StepResult:
        """Play one action, cut to the bounds."""
        given = np.clip(np.asarray(action.data, float) / self.units, -1.0, 1.0)
        observation, reward, terminated, truncated, info = self.env.step(given)
        success, ended = bool(info["success"]), terminated or truncated
        if self.recorder and (success or ended):
            self.recorder.end(self.env, info)
        reason = ("success" if success else info["reason"] or "failure") if ended else None
        return StepResult(
            self._observed(observation),
            reward,
            terminated=success or terminated,
            termination_reason=reason,
            truncated=truncated and not success,
            info={"success": success, "perturb": self.env.drawn.plain()},
        )

    def close(self) -> None:
        """Free the renderer, and write the tables of the lines."""
        self.env.close()
        if self.recorder:
            self.recorder.finish()

    def _observed(self, seen: dict) -> Observation:
        return Observation(
            images={name: np.asarray(seen[name], np.uint8) for name in self.env.cameras},
            state={name: np.asarray(seen[name]) for name in self.env.streams},
            instruction=self.env.task_description,
        )


def scengen_task(
    pool: str, *, split: str = "id", n: int = 20, perturb: str | None = None, perturb_seed: int = 0
) -> Task:
    """The first `n` scenarios of a split as scenes. Their ids are hashes, which reveal nothing to a policy.

    Args:
        pool: folder of a pool, or several folders separated by commas, of one task.
        split: the split.
        n: number of scenarios.
        perturb: the perturbation of the embodiment, which may change the instruction. It is part of the name.
        perturb_seed: that of the embodiment.

    Raises:
        ScengenError: the pools have no such split, or there is no such perturbation.
    """
    pools = folders(pool)
    own = rows_of(pools, first_task(pools)).of_split(split)
    chosen = [own[i] for i in range(min(n, len(own)))]
    longest = max(row.horizon for row in chosen)
    perturbation = Perturbation.parse(perturb)

    def instruction(row: SceneRow) -> str:
        words = Words.of(row.task, row.instruction)
        return perturbation.of(row.id, perturb_seed, words=words).instruction or row.instruction

    return Task(
        name="/".join(["scengen", chosen[0].task, split, *([str(perturbation)] if perturbation else [])]),
        scenes=[Scene(id=row.id, instruction=instruction(row)) for row in chosen],
        scorer="success_at_end",
        max_seconds=longest + 1.0,
    )


def folders(pool: str) -> list[str]:
    """Folders of pools."""
    return [each for each in pool.split(",") if each]


def first_task(pools: list[str]) -> str:
    """Name of the task of the first scenario."""
    return next(Pool.open(pools[0]).rows(witness=False)).task
