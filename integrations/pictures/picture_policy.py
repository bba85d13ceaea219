"""A small policy that sees: two cameras and the robot's own pose to the next two thirds of a second, with PyTorch.

    python picture_policy.py collect DEMONSTRATIONS FRAMES [processes] [looks]    # play demonstrations, take pictures
    python picture_policy.py train FRAMES WEIGHTS.pt [steps]

`scengen evaluate policy=picture_policy:make_policy` plays it, see README.md. Rows have 25 Hz. Every `PLAYED` rows the
policy looks. Its network (four convolutions and a spatial softmax for each camera, a head of two layers) gets the
pictures, the pose and the time, and gives the actions of the rows until the next look and where the hand is at each
of them; a hand that is elsewhere is pulled there. With `looks`, each demonstration is filmed clean, and once more under
one of so many mixtures of perturbations.
"""

import multiprocessing
import os
import sys
from copy import copy
from pathlib import Path

import numpy as np
import torch
from torch import nn

from scengen.compose import load_task
from scengen.envs.observations import cameras_of, streams_of
from scengen.export.replay import Snapshot, WitnessReplay
from scengen.export.sources import open_source
from scengen.look.looks import ROOM
from scengen.perturb.kinds import LEVELS, kinds
from scengen.perturb.language import Words
from scengen.perturb.perturbation import Perturbation
from scengen.pictures.render import Camera, Picture
from scengen.pool.row import SceneRow
from scengen.validate.playable import stored_world

CAMERAS = ("rgb_exo_right_cam", "rgb_gripper_cam")
POSE = ("robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
HAND = 7
"""Entries of the pose that say where the hand is: position [m] and quaternion."""
SIZE = 96
"""Edge of the pictures [pixels]."""
PERIODS = 4
"""Control periods in a row: 25 Hz."""
PLAYED = 16
"""Rows from one look to the next."""
LONG = 100.0
"""Rows that the network's clock counts as 1."""
PULL = 0.3
"""Share of the way to where the hand should be that is added to the actions of a row."""
STEP, TURN = 0.0122, 0.122
"""How far an action of 1 moves the hand in a row [m] and turns it [rad]: STEP and TURN of `scengen.control.osc`, times
kp / kd, times 0.04 s."""
MIXTURE = (
    ("light_direction", "camera_position", "noise"),
    ("light_intensity", "table_texture", "wrist_camera"),
    ("light_colour", "camera_angle", "blur"),
    ("ambient", "table_colour", "distractors"),
    ("shadow", "camera_fov", "compression"),
    ("room_colour", "exposure", "patch"),
    ("thing_colour", "dropped", "proprioception_bias"),
    ("thing_texture", "late", "proprioception_noise"),
)
"""Kinds that a film joins: each kind of what this policy reads once."""
FLOOR = np.array([1e-3] * 3 + [8.7e-3] * 4 + [1e-3] * 2, np.float32)
"""Smallest standard deviation of the entries of the pose: 1 mm, and 0.5 deg as an entry of a quaternion."""


def collect(demonstrations: str, to: str, processes: str = "1", looks: str = "0") -> None:
    """Play all demonstrations of a folder and store pictures, poses and actions of each film as `.npz`."""
    Path(to).mkdir(parents=True, exist_ok=True)
    count = len(open_source(demonstrations))
    jobs = [(demonstrations, to, int(looks), first, int(processes)) for first in range(int(processes))]
    with multiprocessing.get_context("spawn").Pool(int(processes)) as workers:
        workers.starmap(_collect, jobs)
    print(f"{len(list(Path(to).glob('*.npz')))} films of {count} demonstrations in {to}")


def look_of(number: int, looks: int, words: Words) -> Perturbation:
    """The perturbation of a demonstration: a part of `MIXTURE` without the kinds that the task lacks."""
    turn, level = number % looks, 1 + number // looks % LEVELS
    joined = [name for name in MIXTURE[turn % len(MIXTURE)] if not kinds()[name].lacks(words)]
    return Perturbation(tuple((name, level) for name in joined))


def _collect(demonstrations: str, to: str, looks: int, first: int, step: int) -> None:
    for number, row in enumerate(open_source(demonstrations).rows()):
        if number % step != first:
            continue
        _film(row, Perturbation(()), number, Path(to, f"{number:05d}-clean.npz"))
        if looks:
            look = look_of(number, looks, Words.of(row.task, row.instruction))
            _film(row, look, number, Path(to, f"{number:05d}-look.npz"))


def _film(row: SceneRow, perturbation: Perturbation, seed: int, path: Path) -> None:
    """Play a demonstration, and store what is perceived of it if it reaches its goal."""
    world, scenario = stored_world(row, perturbation.dressed(ROOM)), load_task(row.task).scenario(row.params)
    senses = perturbation.senses(world.model, row.id, row.task, row.instruction, seed)
    camera, views = Camera(world, SIZE, SIZE), cameras_of(row.embodiment)
    streams = {name: streams_of(row.embodiment)[name] for name in POSE}
    count = 0

    def pictures() -> dict[str, Picture]:
        nonlocal count
        found = {}
        for name in CAMERAS:
            shown = senses.arriving(views[name], world.time, copy(world.data))
            if count % PLAYED == 0:
                taken = scenario.orientation.apply(camera.take(views[name], shown))
                found[name] = senses.arrived(views[name], world.time, taken)
        count += 1
        return found

    def observe() -> Snapshot:
        return Snapshot.of(world, streams, pictures, senses)

    rows = list(WitnessReplay(row, scenario, world, PERIODS, observe).rows())
    camera.close()
    if rows[-1].success:
        np.savez(
            path,
            pictures=np.array([[r.observed.pictures[name] for name in CAMERAS] for r in rows[::PLAYED]]),
            pose=np.array([np.concatenate([r.observed.streams[name] for name in POSE]) for r in rows]),
            actions=np.array([r.action for r in rows]),
        )


class Eye(nn.Module):
    """Where in a picture the features of a small convolutional network lie: (n, 3, SIZE, SIZE) to (n, 128)."""

    def __init__(self):
        super().__init__()
        layers, before = [], 3
        for width, stride in ((32, 2), (64, 2), (64, 1), (64, 1)):
            layers += [nn.Conv2d(before, width, 5 if stride == 2 else 3, stride, 2 if stride == 2 else 1)]
            layers += [nn.GroupNorm(8, width), nn.ReLU()]
            before = width
        self.features = nn.Sequential(*layers[:-1])

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """Expected place of each feature (spatial softmax)."""
        maps = self.features(pictures).float()
        count, width, high, wide = maps.shape
        weight = maps.flatten(2).softmax(2).view(count, width, high, wide)
        rows = torch.linspace(-1.0, 1.0, high, device=maps.device)
        columns = torch.linspace(-1.0, 1.0, wide, device=maps.device)
        return torch.cat([(weight.sum(3) * rows).sum(2), (weight.sum(2) * columns).sum(2)], 1)


class Network(nn.Module):
    """Pictures, shape (n, cameras, 3, SIZE, SIZE) in [0, 1], and own pose and clock, shape (n, 10), to a plan."""

    def __init__(self, numbers: int):
        super().__init__()
        self.eyes = nn.ModuleList(Eye() for _ in CAMERAS)
        self.head = nn.Sequential(
            *(nn.Linear(128 * len(CAMERAS) + len(FLOOR) + 1, 512), nn.ReLU(), nn.Linear(512, 512), nn.ReLU()),
            nn.Linear(512, PLAYED * numbers),
        )
        self.numbers = numbers

    def forward(self, pictures: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
        """For each row until the next look the action and the hand's pose, standardized, shape (n, PLAYED, numbers)."""
        seen = [eye(pictures[:, i]) for i, eye in enumerate(self.eyes)]
        return self.head(torch.cat([*seen, own], 1)).view(-1, PLAYED, self.numbers)


def train(frames: str, weights: str, steps: str = "2400") -> None:
    """Train on nine tenths of the stored demonstrations, and report the error on the others."""
    torch.manual_seed(0)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    paths = sorted(Path(frames).glob("*.npz"))
    found = [dict(np.load(path)) for path in paths]
    poses, actions = (np.concatenate([film[name] for film in found]) for name in ("pose", "actions"))
    own_scale = np.stack([poses.mean(0), np.maximum(poses.std(0), FLOOR)])
    plans = np.concatenate([actions, poses[:, :HAND]], 1)
    plan_scale = np.stack([plans.mean(0), np.maximum(plans.std(0), 1e-3)])
    pictures, own, plan, apart = [], [], [], []
    for path, film in zip(paths, found, strict=True):
        length = len(film["pose"])
        ahead = np.concatenate([film["actions"], film["pose"][:, :HAND]], 1)
        for look, row in enumerate(range(0, length, PLAYED)):
            pictures.append(film["pictures"][look].transpose(0, 3, 1, 2))
            own.append([*((film["pose"][row] - own_scale[0]) / own_scale[1]), row / LONG])
            plan.append((ahead[np.minimum(np.arange(row, row + PLAYED), length - 1)] - plan_scale[0]) / plan_scale[1])
            apart.append(path.stem.partition("-")[0].endswith("9"))
    seen = torch.from_numpy(np.array(pictures)).to(device)
    known, wanted = (torch.from_numpy(np.array(each, np.float32)).to(device) for each in (own, plan))
    held_out = torch.from_numpy(np.array(apart)).to(device)
    table, tests = (held_out == 0).nonzero()[:, 0], held_out.nonzero()[:, 0]
    network = Network(plans.shape[1]).to(device)
    optimizer = torch.optim.AdamW(network.parameters(), 1e-3, weight_decay=1e-3)

    def loss_of(batch: torch.Tensor) -> torch.Tensor:
        with torch.autocast(device, torch.bfloat16):
            guess = network(seen[batch].float() / 255, known[batch])
        return (guess.float() - wanted[batch]).abs().mean()

    rate = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, int(steps))
    for step in range(1, int(steps) + 1):
        loss = loss_of(table[torch.randint(len(table), (64,), device=device)])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        rate.step()
        if step % 250 == 0:
            with torch.no_grad():
                missed = np.mean([float(loss_of(part)) for part in tests.split(64)])
            print(f"step {step}: loss {float(loss.detach()):.4f}, held out {missed:.4f}", flush=True)
    told = {"own": torch.from_numpy(own_scale), "plan": torch.from_numpy(plan_scale), "look": str(ROOM)}
    torch.save({"network": network.state_dict(), **told, "rows": max(len(film["pose"]) for film in found)}, weights)
    print(f"{steps} steps on {len(table)} looks in {weights}")


class Policy:
    """The trained network, played from one look to the next."""

    def __init__(self, weights: str):
        torch.set_num_threads(1)
        self.device = "cuda" if torch.cuda.is_available() else "cpu"
        stored = torch.load(weights, map_location=self.device, weights_only=True)
        self.own, self.plan = (stored[name].cpu().numpy() for name in ("own", "plan"))
        self.network = Network(self.plan.shape[1]).to(self.device).eval()
        self.network.load_state_dict(stored["network"])
        self.look, self.last = stored["look"], stored["rows"]
        self.version = f"{Path(weights).stat().st_size} {Path(weights).stat().st_mtime_ns}"

    def reset(self, observation, info, seed) -> None:
        """Start an episode."""
        self.rows, self.queue = 0, []

    def act(self, observation) -> np.ndarray:
        """The next action of the plan, with a pull to where the hand should be; no motion once demonstrations end."""
        if self.rows == self.last:
            return self.still
        pose = np.concatenate([np.ravel(observation[name]) for name in POSE])
        if not self.queue:
            pictures = np.stack([observation[name] for name in CAMERAS]).transpose(0, 3, 1, 2)
            own = np.array([*((pose - self.own[0]) / self.own[1]), self.rows / LONG], np.float32)
            with torch.no_grad():
                seen = torch.from_numpy(np.ascontiguousarray(pictures)).to(self.device)[None].float() / 255
                plan = self.network(seen, torch.from_numpy(own).to(self.device)[None])[0].cpu().numpy()
            self.queue = list(plan * self.plan[1] + self.plan[0])
        self.rows += 1
        action, hand = np.split(self.queue.pop(0), [-HAND])
        action[:3] += PULL * (hand[:3] - pose[:3]) / STEP
        action[3:6] += PULL * turned(pose[3:HAND], hand[3:]) / TURN
        action[6] = np.sign(action[6])
        self.still = np.array([*[0.0] * 6, action[6]], np.float32)
        return np.clip(action, -1.0, 1.0).astype(np.float32)

    def looks(self) -> bool:
        """Whether the next `act` uses pictures: it makes a new plan."""
        return not self.queue and self.rows < self.last


def turned(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The small rotation vector from one orientation to another [rad], of quaternions with the real part last."""
    other = other / np.linalg.norm(other)
    vector = one[3] * other[:3] - other[3] * one[:3] - np.cross(other[:3], one[:3])
    return 2.0 * vector * np.sign(one @ other)


def make_policy(env) -> Policy:
    """The policy with the weights that the variable `WEIGHTS` names."""
    return Policy(os.environ["WEIGHTS"])


make_policy.observations = (*CAMERAS, "robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
make_policy.action_repeat = 4
make_policy.language = False


if __name__ == "__main__":
    {"collect": collect, "train": train}[sys.argv[1]](*sys.argv[2:])
