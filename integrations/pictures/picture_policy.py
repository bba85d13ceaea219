"""A small policy that sees: behaviour cloning of two cameras and the robot's own pose with PyTorch.

    python picture_policy.py collect DEMONSTRATIONS FRAMES [processes] [looks]    # play demonstrations, take pictures
    python picture_policy.py train FRAMES WEIGHTS.pt [minutes]

`scengen evaluate policy=picture_policy:make_policy` plays it, see README.md. Rows have 25 Hz. The network (four
convolutions and a spatial softmax for each camera, a head of two layers) gets the pictures and the pose of now and of
the row before, and gives the next `CHUNK` actions, of which `PLAYED` are played. With `looks`, each demonstration is
filmed clean and so many times more, each time under the next perturbation of `MIXTURE`.
"""

import multiprocessing
import os
import sys
import time
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
SIZE = 96
"""Edge of the pictures [pixels]."""
CROP = 88
"""Edge of the part that the network sees: a random one in training, the middle one in evaluation [pixels]."""
PERIODS = 4
"""Control periods in a row: 25 Hz."""
CHUNK = 8
"""Number of actions that the network predicts."""
PLAYED = 4
"""Number of them that are played before it looks again."""
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


def look_of(number: int, look: int, words: Words) -> Perturbation:
    """The perturbation of a film: none in look 0, then a part of `MIXTURE` without the kinds that the task lacks."""
    if look == 0:
        return Perturbation(())
    turn = number + look
    level = 1 + turn // len(MIXTURE) % LEVELS
    joined = [name for name in MIXTURE[turn % len(MIXTURE)] if not kinds()[name].lacks(words)]
    return Perturbation(tuple((name, level) for name in joined))


def _collect(demonstrations: str, to: str, looks: int, first: int, step: int) -> None:
    for number, row in enumerate(open_source(demonstrations).rows()):
        for look in range(looks + 1) if number % step == first else ():
            _film(
                row,
                look_of(number, look, Words.of(row.task, row.instruction)),
                look,
                Path(to, f"{number:05d}-{look}.npz"),
            )


def _film(row: SceneRow, perturbation: Perturbation, seed: int, path: Path) -> None:
    """Play a demonstration, and store what is perceived of it if it reaches its goal."""
    world, scenario = stored_world(row, perturbation.dressed(ROOM)), load_task(row.task).scenario(row.params)
    senses = perturbation.senses(world.model, row.id, row.task, row.instruction, seed)
    camera, views = Camera(world, SIZE, SIZE), cameras_of(row.embodiment)
    streams = {name: streams_of(row.embodiment)[name] for name in POSE}

    def pictures() -> dict[str, Picture]:
        taken = {name: scenario.orientation.apply(camera.take(views[name])) for name in CAMERAS}
        return {name: senses.picture(views[name], world.time, picture) for name, picture in taken.items()}

    def observe() -> Snapshot:
        return Snapshot.of(world, streams, pictures, senses)

    rows = list(WitnessReplay(row, scenario, world, PERIODS, observe).rows())
    camera.close()
    if rows[-1].success:
        np.savez(
            path,
            pictures=np.array([[r.observed.pictures[name] for name in CAMERAS] for r in rows]),
            pose=np.array([np.concatenate([r.observed.streams[name] for name in POSE]) for r in rows]),
            actions=np.array([r.action for r in rows]),
        )


class Eye(nn.Module):
    """Where in a pair of pictures the features of a small convolutional network lie: (n, 6, CROP, CROP) to (n, 128)."""

    def __init__(self):
        super().__init__()
        layers, before = [], 6
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
    """Pictures of two moments, shape (n, 2, cameras, 3, CROP, CROP) in [0, 1], and poses (n, 2, 9), to actions."""

    def __init__(self, actions: int):
        super().__init__()
        self.eyes = nn.ModuleList(Eye() for _ in CAMERAS)
        self.head = nn.Sequential(
            *(nn.Linear(128 * len(CAMERAS) + 2 * len(FLOOR), 512), nn.ReLU(), nn.Linear(512, 512), nn.ReLU()),
            nn.Linear(512, CHUNK * actions),
        )
        self.actions = actions

    def forward(self, pictures: torch.Tensor, pose: torch.Tensor) -> torch.Tensor:
        """Actions in [-1, 1], shape (n, CHUNK, actions)."""
        seen = [eye(pictures[:, :, i].flatten(1, 2)) for i, eye in enumerate(self.eyes)]
        return self.head(torch.cat([*seen, pose.flatten(1)], 1)).view(-1, CHUNK, self.actions)


def train(frames: str, weights: str, minutes: str = "5") -> None:
    """Train for some minutes on nine tenths of the stored demonstrations, and report the error on the others."""
    torch.manual_seed(0)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    pictures, pose, actions, rows, held_out = [], [], [], [], []
    for path in sorted(Path(frames).glob("*.npz")):
        found, first, number = np.load(path), sum(map(len, pose)), int(path.stem.partition("-")[0])
        length = len(found["pose"])
        pictures.append(torch.from_numpy(found["pictures"]))
        pose.append(found["pose"])
        actions.append(found["actions"])
        for t in range(length):
            later = [first + min(t + k, length - 1) for k in range(CHUNK)]
            (held_out if number % 10 == 9 else rows).append([first + max(t - 1, 0), first + t, *later])
    own, acts = np.concatenate(pose), torch.from_numpy(np.concatenate(actions)).to(device)
    mean, spread = own.mean(0), np.maximum(own.std(0), FLOOR)
    own = torch.from_numpy((own - mean) / spread).to(device)
    seen = torch.cat(pictures).permute(0, 1, 4, 2, 3).contiguous().to(device)
    del pictures
    network = Network(acts.shape[1]).to(device)
    optimizer = torch.optim.AdamW(network.parameters(), 3e-4, weight_decay=1e-3)
    end, begun, step = time.time() + 60 * float(minutes), time.time(), 0
    table, tests = torch.tensor(rows, device=device), torch.tensor(held_out, device=device)

    def loss_of(batch: torch.Tensor, place: tuple[int, int]) -> torch.Tensor:
        top, left = place
        looked = seen[batch[:, :2], :, :, top : top + CROP, left : left + CROP].float() / 255
        with torch.autocast(device, torch.bfloat16):
            guess = network(looked, own[batch[:, :2]])
        return (guess.float() - acts[batch[:, 2:]]).abs().mean()

    while time.time() < end:
        share = (time.time() - begun) / (end - begun)
        for group in optimizer.param_groups:
            group["lr"] = 3e-4 * 0.5 * (1 + np.cos(np.pi * min(1.0, share)))
        place = tuple(np.random.default_rng(step).integers(0, SIZE - CROP + 1, 2).tolist())
        loss = loss_of(table[torch.randint(len(table), (256,), device=device)], place)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        step += 1
        if step % 500 == 0:
            network.eval()
            with torch.no_grad():
                middle = ((SIZE - CROP) // 2,) * 2
                apart = np.mean([float(loss_of(part, middle)) for part in tests.split(256)])
            network.train()
            print(f"step {step}: loss {float(loss.detach()):.4f}, held out {apart:.4f}", flush=True)
    pose_scale = torch.from_numpy(np.stack([mean, spread]))
    torch.save(
        {"network": network.state_dict(), "pose": pose_scale, "actions": acts.shape[1], "look": str(ROOM)}, weights
    )
    print(f"{step} steps on {len(rows)} rows in {weights}")


class Policy:
    """The trained network, played in chunks."""

    def __init__(self, weights: str):
        torch.set_num_threads(1)
        self.device = "cuda" if torch.cuda.is_available() else "cpu"
        stored = torch.load(weights, map_location=self.device, weights_only=True)
        self.network = Network(stored["actions"]).to(self.device).eval()
        self.network.load_state_dict(stored["network"])
        self.mean, self.spread = stored["pose"].cpu().numpy()
        self.look = stored["look"]
        self.version = f"{Path(weights).stat().st_size} {Path(weights).stat().st_mtime_ns}"

    def reset(self, observation, info, seed) -> None:
        """Start an episode."""
        self.before, self.queue = None, []

    def act(self, observation) -> np.ndarray:
        """The next action of the chunk; a new chunk after `PLAYED` of them."""
        if len(self.queue) <= 1:
            now = self._seen(observation)
            before, self.before = self.before or now, now
        if not self.queue:
            pictures, pose = (
                torch.from_numpy(np.stack(pair)).to(self.device)[None] for pair in zip(before, now, strict=True)
            )
            with torch.no_grad():
                self.queue = list(self.network(pictures, pose)[0, :PLAYED].float().cpu().numpy())
        return np.clip(self.queue.pop(0), -1.0, 1.0)

    def looks(self) -> bool:
        """Whether the next `act` uses pictures: it gives a new chunk, or the next one does."""
        return len(self.queue) <= 1

    def _seen(self, observation) -> tuple[np.ndarray, np.ndarray]:
        margin = (SIZE - CROP) // 2
        pictures = np.stack([observation[name] for name in CAMERAS])[:, margin : margin + CROP, margin : margin + CROP]
        pose = np.concatenate([np.ravel(observation[name]) for name in POSE])
        return (
            np.ascontiguousarray(pictures.transpose(0, 3, 1, 2), np.float32) / 255,
            ((pose - self.mean) / self.spread).astype(np.float32),
        )


def make_policy(env) -> Policy:
    """The policy with the weights that the variable `WEIGHTS` names."""
    return Policy(os.environ["WEIGHTS"])


make_policy.observations = (*CAMERAS, "robot0_eef_pos", "robot0_eef_quat", "robot0_gripper_qpos")
make_policy.action_repeat = 4
make_policy.language = False


if __name__ == "__main__":
    {"collect": collect, "train": train}[sys.argv[1]](*sys.argv[2:])
