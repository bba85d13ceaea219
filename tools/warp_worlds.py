"""Witnesses in mujoco_warp and in C MuJoCo: how often goal and end agree.

    python tools/warp_worlds.py [TASK ...]

For each task, scenarios are certified under MuJoCo 4 and exported with `scengen export format=batch`. mujoco_warp, on
the processor, plays every witness by its joint targets: the torques of C MuJoCo, and springs and dampers to its joint
angles. Events, goals and rules are judged in C MuJoCo, at the states of mujoco_warp. The results are stored in
records/warp. The environment is below build/stacks; the first task compiles mujoco_warp for some minutes.
"""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from stacks import FOLDER, ROOT, Stack, of_stack, runner

from scengen.compose import load_task
from scengen.episode import Episode
from scengen.export import batch
from scengen.pool import Pool, PoolRow
from scengen.robots import panda
from scengen.sim.world import World

RECORDS = ROOT / "records" / "warp"
STACK = Stack("warp", "", ("mujoco==4.0.0", "numpy>=2", "mujoco-warp==4.0.0"))
TASKS = ("domino_single", "mirror_pick_place", "edge_slide", "tool_retrieve", "mass_sort")
DRAWN = 6
"""Number of scenarios that are certified for a task; those of the most frequent layout are played."""
MOST = 4
"""Largest number of worlds that are played."""
NEAR = 0.01
"""Largest distance between the ends of a body that agree [m]."""
PLAY = "play"
"""First word of the command that plays in the environment."""
RATE = 30.0
"""Natural frequency of the springs to the joint angles [rad/s], critically damped: six times as stiff as the
controller, and far below the rate of the physics steps (500 Hz)."""


def main(*tasks: str) -> None:
    """Certify, export and play scenarios of tasks, and end with status 1 if a step fails."""
    if tasks[:1] == (PLAY,):
        play(tasks[1], *map(Path, tasks[2:]))
        return
    python = of_stack(sys.executable, STACK)
    run, failed = runner(python, STACK), []
    for task in tasks or TASKS:
        pool, worlds = FOLDER / f"warp-{task}", FOLDER / f"warp-{task}-worlds"
        done = (
            run("scengen", "generate", f"task={task}", f"n={DRAWN}", f"pool={pool}")
            and run("scengen", "export", f"pool={pool}", f"to={worlds}", "format=batch", "layout=1")
            and subprocess.run([python, __file__, PLAY, task, pool, worlds], cwd=ROOT).returncode == 0
        )
        failed += [] if done else [task]
    sys.exit(f"failed: {', '.join(failed)}" if failed else 0)


def play(task: str, pool: Path, folder: Path) -> None:
    """Play the witnesses of an export, and store the results."""
    names = np.load(folder / batch.WORLDS)["id"][:MOST].tolist()
    rows = [Pool.open(pool).row(name) for name in names]
    family = load_task(task)
    usual = [Played.of(row, World.load(row.scene_xml, row.embodiment), family.scenario(row.params)) for row in rows]
    targets = [one.recorded() for one in usual]
    others = []
    for number, row in enumerate(rows):
        model, _ = batch.opened(folder, number)
        others.append(Played.of(row, World.of(model, usual[number].world.scripted), family.scenario(row.params)))
    Warp(folder, len(rows)).play(others, targets)
    apart = [max(one.apart(other)) for one, other in zip(usual, others, strict=True)]
    goals = [(one.episode.outcome, other.episode.outcome) for one, other in zip(usual, others, strict=True)]
    record = {
        "task": task,
        "version": family.version,
        "mujoco": mujoco.__version__,
        "n": len(rows),
        "goals": sum(here == "success" for _, here in goals),
        "verdicts": sum(one == here for one, here in goals),
        "near": sum(distance <= NEAR for distance in apart),
        "median": round(float(np.median(apart)), 4),
        "reasons": sorted({other.episode.reason for other in others} - {""}),
    }
    RECORDS.mkdir(parents=True, exist_ok=True)
    (RECORDS / f"{task}.json").write_text(json.dumps(record, indent=1) + "\n")
    print(json.dumps(record), flush=True)


@dataclass(frozen=True)
class Target:
    """A witness as the joints see it, at each physics step."""

    ctrl: NDArray[np.float64]
    """Controls, shape (steps, nu)."""
    angle: NDArray[np.float64]
    """Angles of the arms' joints before the step [rad], shape (steps, 7 * arms)."""
    speed: NDArray[np.float64]
    """Their rates [rad/s]."""


@dataclass
class Played:
    """The witness of a scenario in a world."""

    row: PoolRow
    world: World
    episode: Episode
    motors: list[int]
    """Motors of the arms' joints."""
    angles: list[int]
    """Places of their angles in qpos."""
    rates: list[int]
    """Places of their rates in qvel."""

    @classmethod
    def of(cls, row: PoolRow, world: World, scenario: Any) -> "Played":
        """The start of a scenario."""
        model = world.model
        joints = [model.joint(name) for names in panda.arms(model) for name in names.joints]
        motors = [model.actuator(name).id for names in panda.arms(model) for name in names.motors]
        places = [int(joint.qposadr[0]) for joint in joints], [int(joint.dofadr[0]) for joint in joints]
        return cls(row, world, Episode(scenario, world, row.horizon), motors, *places)

    def recorded(self) -> Target:
        """Play the witness in C MuJoCo, and record what the joints do."""
        world, before, found = self.world, mujoco.MjData(self.world.model), list[tuple[Any, ...]]()
        controls = np.zeros((world.loop.substeps, world.model.nu))
        for action in self.row.witness:
            self.episode.begin()
            mujoco.mj_copyData(before, world.model, world.data)
            world.loop.replay(world.with_partner_actions(action)[None], controls)
            world.record_grip(action)
            for ctrl in controls:
                found.append((ctrl.copy(), before.qpos[self.angles].copy(), before.qvel[self.rates].copy()))
                before.ctrl[:] = ctrl
                mujoco.mj_step(world.model, before)
            assert np.array_equal(before.qpos, world.data.qpos), "the controls alone repeat the bits"
            self.episode.judge()
        return Target(*(np.array(part) for part in zip(*found, strict=True)))

    def apart(self, other: "Played") -> Iterator[float]:
        """Distances between the places of each free body here and in another world of the scenario [m]."""
        for body in self.world.free_bodies:
            yield float(np.linalg.norm(self.world.pos(body) - other.world.pos(body)))


class Warp:
    """Worlds of an export in mujoco_warp."""

    def __init__(self, folder: Path, count: int):
        """Load the first `count` worlds."""
        import mujoco_warp  # pyright: ignore[reportMissingImports]
        import warp  # pyright: ignore[reportMissingImports]

        self.warp, self.step = warp, mujoco_warp.step
        worlds, host = np.load(folder / batch.WORLDS), mujoco.MjModel.from_xml_path(str(folder / batch.SCENE))
        self.model = mujoco_warp.put_model(host)
        self.data = mujoco_warp.make_data(host, nworld=count, naconmax=400 * count, njmax=1200)
        for name in batch.PER_WORLD:
            assert getattr(self.model, name).shape[0] == 1, f"mujoco_warp holds one {name} for each world"
        for key in worlds.files:
            part, _, name = key.partition(".")
            if target := {"model": self.model, "state": self.data}.get(part):
                values = warp.array(worlds[key][:count], dtype=getattr(target, name).dtype)
                setattr(target, name, values)

    def play(self, worlds: Sequence[Played], targets: Sequence[Target]) -> None:
        """Play witnesses, each in its world. Those that are over hold their last angles."""
        substeps = worlds[0].world.loop.substeps
        for period in range(max(len(one.row.witness) for one in worlds)):
            going = [k for k, one in enumerate(worlds) if period < len(one.row.witness)]
            for k in going:
                worlds[k].episode.begin()
                worlds[k].world.record_grip(worlds[k].row.witness[period])
            self._push(worlds)
            for step in range(substeps):
                self._steer(worlds, targets, period * substeps + step, step == 0)
                self.step(self.model, self.data)
                self._pull(worlds)
            for k in going:
                mujoco.mj_forward(worlds[k].world.model, worlds[k].world.data)
                worlds[k].episode.judge()
            print(f"\r{period} {time_of(worlds)}", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)

    def _push(self, worlds: Sequence[Played]) -> None:
        """Take over what events have changed: speeds, forces, and the places of marks."""
        for name in ("qvel", "xfrc_applied", "mocap_pos", "mocap_quat"):
            values = np.array([getattr(one.world.data, name) for one in worlds])
            if values.size:
                self._write(name, values)

    def _steer(self, worlds: Sequence[Played], targets: Sequence[Target], step: int, first: bool) -> None:
        """Write the controls of a physics step: the torques of C MuJoCo, and springs to its joint angles."""
        controls = []
        for one, target in zip(worlds, targets, strict=True):
            world, now = one.world, min(step, len(target.ctrl) - 1)
            mujoco.mj_step1(world.model, world.data)
            inertia = world.model.dof_armature[one.rates]
            pull = target.angle[now] - world.data.qpos[one.angles]
            slow = target.speed[now] - world.data.qvel[one.rates]
            world.data.ctrl[:] = target.ctrl[now]
            world.data.ctrl[one.motors] += inertia * (RATE**2 * pull + 2 * RATE * slow)
            if step < len(target.ctrl):
                world.loop.watch(first)
            controls.append(world.data.ctrl.copy())
        self._write("ctrl", np.array(controls))

    def _pull(self, worlds: Sequence[Played]) -> None:
        """Put the states into the worlds of C MuJoCo, which look for contacts and judge."""
        states = {name: getattr(self.data, name).numpy() for name in ("time", "qpos", "qvel", "act")}
        for k, one in enumerate(worlds):
            data = one.world.data
            data.time = float(states["time"][k])
            for name in ("qpos", "qvel", "act"):
                getattr(data, name)[:] = states[name][k]

    def _write(self, name: str, values: NDArray[np.float64]) -> None:
        own = getattr(self.data, name)
        own.assign(self.warp.array(values, dtype=own.dtype))


def time_of(worlds: Sequence[Played]) -> str:
    """Outcomes so far, for the terminal."""
    return " ".join(one.episode.outcome or "open" for one in worlds)


if __name__ == "__main__":
    main(*sys.argv[1:])
