"""Recipes: scripts that train and evaluate policies of LeRobot on a recording, in an environment of their own.

Every setting that decides the result is written out, so that a default which changes with a version changes nothing.
The names of the settings are those of LeRobot 0.6.1.
"""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..errors import BadConfig, UnknownName
from ..work.targets import try_folder, write
from .dataset import Recording
from .streams import ENVIRONMENT

LEROBOT = "0.6.1"
"""Version of LeRobot whose settings the recipes name."""
SMOKE = {"steps": 20, "batch_size": 2, "save_freq": 20, "log_freq": 1, "num_workers": 0}
"""Settings of the short run that shows whether the environment works."""
EPISODES = 20
"""Number of evaluation episodes in each split, as in the paper."""
PICTURES = "observation.images."
"""Beginning of LeRobot's names of cameras."""
SMOLVLA_CAMERAS = 3
"""Number of cameras of the pretrained SmolVLA, which calls them camera1 to camera3."""

Value = str | int | float


@dataclass(frozen=True)
class Recipe:
    """How a policy is trained."""

    origin: str
    """Source of the numbers, as a sentence."""
    extras: str
    """Extras of LeRobot that the training needs."""
    batch_size: int
    """Number of rows in a batch."""
    steps: int
    """Number of batches."""
    save_freq: int
    """Number of batches between two checkpoints."""
    settings: Mapping[str, Value]
    """Other settings of lerobot-train."""
    cameras: bool = False
    """Whether the policy needs pictures."""


RECIPES: Mapping[str, Recipe] = {
    "lerobot_act": Recipe(
        "The paper trains no ACT; these are the defaults of LeRobot, which follow the authors of ACT.",
        "training",
        batch_size=8,
        steps=100_000,
        save_freq=20_000,
        settings={
            "policy.type": "act",
            "policy.n_obs_steps": 1,
            "policy.chunk_size": 100,
            "policy.n_action_steps": 100,
            "policy.vision_backbone": "resnet18",
            "policy.pretrained_backbone_weights": "ResNet18_Weights.IMAGENET1K_V1",
            "policy.dim_model": 512,
            "policy.n_heads": 8,
            "policy.dim_feedforward": 3200,
            "policy.n_encoder_layers": 4,
            "policy.n_decoder_layers": 1,
            "policy.use_vae": "true",
            "policy.latent_dim": 32,
            "policy.n_vae_encoder_layers": 4,
            "policy.dropout": 0.1,
            "policy.kl_weight": 10.0,
            "policy.optimizer_lr": 1e-5,
            "policy.optimizer_lr_backbone": 1e-5,
            "policy.optimizer_weight_decay": 1e-4,
        },
    ),
    "lerobot_diffusion": Recipe(
        "Optimizer, schedule, batch size, steps and checkpoints are the paper's (App. G, Diffusion Policy). It says "
        "nothing of the network and of AdamW's other numbers, which are the defaults of LeRobot.",
        "training,diffusion",
        batch_size=32,
        steps=50_000,
        save_freq=5_000,
        settings={
            "policy.type": "diffusion",
            "policy.n_obs_steps": 2,
            "policy.horizon": 64,
            "policy.n_action_steps": 32,
            "policy.vision_backbone": "resnet18",
            "policy.down_dims": "[512,1024,2048]",
            "policy.noise_scheduler_type": "DDPM",
            "policy.num_train_timesteps": 100,
            "use_policy_training_preset": "false",
            "optimizer.type": "adamw",
            "optimizer.lr": 1e-4,
            "optimizer.betas": "[0.95,0.999]",
            "optimizer.eps": 1e-8,
            "optimizer.weight_decay": 1e-6,
            "optimizer.grad_clip_norm": 10.0,
            "scheduler.type": "diffuser",
            "scheduler.name": "cosine",
            "scheduler.num_warmup_steps": 500,
        },
    ),
    "lerobot_smolvla": Recipe(
        "The paper trains no SmolVLA; these are the numbers of LeRobot for finetuning its pretrained policy.",
        "training,smolvla",
        batch_size=64,
        steps=20_000,
        save_freq=5_000,
        settings={
            "policy.path": "lerobot/smolvla_base",
            "policy.n_action_steps": 50,
            "policy.freeze_vision_encoder": "true",
            "policy.train_expert_only": "true",
            "policy.optimizer_lr": 1e-4,
            "policy.optimizer_betas": "[0.9,0.95]",
            "policy.optimizer_weight_decay": 1e-10,
            "policy.optimizer_grad_clip_norm": 10,
            "policy.scheduler_warmup_steps": 1_000,
            "policy.scheduler_decay_steps": 30_000,
            "policy.scheduler_decay_lr": 2.5e-6,
        },
        cameras=True,
    ),
}
"""Recipes by name."""


@dataclass(frozen=True)
class RecipeSettings:
    """Settings of `scengen recipe`; conf/command/recipe.yaml explains them."""

    train: str = ""
    data: str = ""
    to: str = ""
    device: str = "cuda"
    seed: int = 1000


@dataclass(frozen=True)
class Order:
    """A recipe for a recording."""

    recipe: Recipe
    """The recipe."""
    recording: Recording
    """The recording."""
    settings: RecipeSettings
    """What was asked for."""

    @property
    def cameras(self) -> list[str]:
        """Names of the recorded cameras."""
        return [name.removeprefix(PICTURES) for name in self.recording.cameras]

    @property
    def renamed(self) -> dict[str, Value]:
        """The setting that gives cameras the names of a pretrained policy; empty for a policy without."""
        if not self.recipe.cameras:
            return {}
        pairs = [f'"{PICTURES}{name}": "{PICTURES}camera{k}"' for k, name in enumerate(self.cameras, 1)]
        return {"rename_map": f"{{{', '.join(pairs)}}}"}

    def path(self, name: str) -> str:
        """Absolute path of something below the folder of the scripts."""
        return str(Path(self.settings.to).resolve() / name)


def write_recipe(settings: RecipeSettings) -> tuple[Recipe, list[str]]:
    """Write the scripts of a recipe for a recording.

    Returns:
        The recipe, and the names of the files.

    Raises:
        ScengenError: there is no such recipe or recording, the policy cannot be trained on it, or it cannot be written.
    """
    if settings.train not in RECIPES:
        raise UnknownName("recipe", settings.train, RECIPES)
    order = Order(RECIPES[settings.train], Recording.open(settings.data), settings)
    _check(order)
    folder = Path(settings.to)
    try_folder(folder)
    trial = {**SMOKE, "policy.device": "cpu"}
    files = {
        "requirements.txt": _requirements(order),
        "smoke.sh": _script(order, "Trains for 20 batches on the processor.", _training(order, "smoke", trial)),
        "train.sh": _script(order, "Trains the policy.", _training(order, "training", {})),
        "evaluate.sh": _script(order, "Evaluates the policy: sh evaluate.sh POOL[,POOL]", _evaluation(order)),
    }
    for name, text in files.items():
        write(folder / name, text)
    return order.recipe, list(files)


def _check(order: Order) -> None:
    """Raise `BadConfig` if the policy cannot be trained on the recording."""
    data, count = order.settings.data, len(order.cameras)
    if order.recipe.cameras and not 0 < count <= SMOLVLA_CAMERAS:
        accepted = f"it needs 1 to {SMOLVLA_CAMERAS}: scengen record cameras=[rgb_ego_cam,rgb_exo_right_cam]"
        raise BadConfig(f"train = {order.settings.train}; {data} has {count} cameras, {accepted}")
    if not count and ENVIRONMENT not in order.recording.info["features"]:
        remedy = "record it with cameras, or with environment_state=true"
        raise BadConfig(f"{data} has neither pictures nor {ENVIRONMENT}, and a policy needs one of them; {remedy}")


def _requirements(order: Order) -> str:
    return (
        f"# {order.settings.train}: Python 3.12 or newer, in an environment of its own, without robosuite\n"
        f"lerobot[{order.recipe.extras}]=={LEROBOT}\n"
        "scengen\n"
        "# From a checkout of scengen, for lerobot-eval: pip install integrations/lerobot_env_scengen\n"
    )


def _training(order: Order, output: str, changed: Mapping[str, Value]) -> Iterator[str]:
    """The lines of the command that trains."""
    recipe, data = order.recipe, Path(order.settings.data).resolve()
    yield from _command(
        "lerobot-train",
        {
            "dataset.repo_id": f"local/{data.name}",
            "dataset.root": str(data),
            **recipe.settings,
            **order.renamed,
            "policy.device": order.settings.device,
            "policy.push_to_hub": "false",
            "seed": order.settings.seed,
            "batch_size": recipe.batch_size,
            "steps": recipe.steps,
            "save_freq": recipe.save_freq,
            "log_freq": 200,
            "num_workers": 4,
            "env_eval_freq": 0,
            "wandb.enable": "false",
            "output_dir": order.path(output),
            **changed,
        },
    )


def _evaluation(order: Order) -> Iterator[str]:
    """The lines of the command that evaluates."""
    features, cameras = order.recording.info["features"], order.cameras
    pictures: dict[str, Value] = {}
    if cameras:
        height, width, _ = features[PICTURES + cameras[0]]["shape"]
        pictures = {"env.cameras": ",".join(cameras), "env.width": width, "env.height": height}
    yield from _command(
        "lerobot-eval",
        {
            "policy.path": order.path("training/checkpoints/last/pretrained_model"),
            "policy.device": order.settings.device,
            "env.type": "scengen",
            "env.task": order.recording.episodes[0]["scengen/task"],
            "env.fps": int(order.recording.fps),
            "env.environment_state": str(ENVIRONMENT in features).lower(),
            **pictures,
            **order.renamed,
            "eval.n_episodes": EPISODES,
            "eval.batch_size": EPISODES // 2,
            "seed": order.settings.seed,
            "output_dir": order.path("evaluation"),
        },
    )
    yield '    --env.pool="$1"'


def _script(order: Order, title: str, lines: Iterator[str]) -> str:
    """A shell script with one command."""
    origin = f"# {order.settings.train}, LeRobot {LEROBOT}. {order.recipe.origin}\n"
    return f"#!/bin/sh\n# {title}\n{origin}set -eu\n" + " \\\n".join(lines) + "\n"


def _command(program: str, settings: Mapping[str, Value]) -> Iterator[str]:
    """A command with a setting in each line."""
    yield program
    for name, value in settings.items():
        yield f"    --{name}={shlex.quote(str(value))}"
