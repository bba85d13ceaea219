"""Recipes for LeRobot. The names of the settings are those of LeRobot 0.6.1."""

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from ...errors import BadConfig
from ...robots.files import INSTALL
from ..dataset import Recording
from ..streams import ENVIRONMENT
from .settings import EPISODES, SMOKE_BATCHES, RecipeSettings, Scripts, script

LEROBOT = "0.6.1"
"""Version of LeRobot whose settings the recipes name."""
SMOKE = {"steps": SMOKE_BATCHES, "batch_size": 2, "save_freq": SMOKE_BATCHES, "log_freq": 1, "num_workers": 0}
"""Settings of the short run."""
PICTURES = "observation.images."
"""Beginning of LeRobot's names of cameras."""
SMOLVLA_CAMERAS = 3
"""Number of cameras of the pretrained SmolVLA, which calls them camera1 to camera3."""

Value = str | int | float


@dataclass(frozen=True)
class Recipe:
    """Training of a policy."""

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
class Order:
    """A recipe for a recording."""

    recipe: Recipe
    """The recipe."""
    recording: Recording
    """The recording."""
    settings: RecipeSettings
    """Requested settings."""

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


def scripts(settings: RecipeSettings) -> Scripts:
    """The scripts of a recipe for a recording.

    Raises:
        ScengenError: there is no such recording, or the policy cannot be trained on it.
    """
    recipe = RECIPES[settings.train]
    order = Order(recipe, Recording.open(settings.data), settings)
    _check(order)
    trial, origin = {**SMOKE, "policy.device": "cpu"}, f"{settings.train}, LeRobot {LEROBOT}. {recipe.origin}"
    parts = {
        "smoke.sh": (f"Trains for {SMOKE_BATCHES} batches on the processor.", _training(order, "smoke", trial)),
        "train.sh": ("Trains the policy.", _training(order, "training", {})),
        "evaluate.sh": ("Evaluates the policy: sh evaluate.sh POOL[,POOL]", _evaluation(order)),
    }
    written = {name: script(title, origin, " \\\n".join(lines)) for name, (title, lines) in parts.items()}
    install = (
        f"with Python 3.12 in a separate environment: pip install -r {Path(settings.to, 'requirements.txt')} "
        f"(LeRobot {LEROBOT})"
    )
    return Scripts(recipe.origin, install, {"requirements.txt": _requirements(order), **written})


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
        f"# {order.settings.train}: Python 3.12 or newer, in an environment without robosuite's requirements\n"
        f"lerobot[{order.recipe.extras}]=={LEROBOT}\n"
        "# To play checkpoints, in a checkout of scengen: pip install . ./integrations/lerobot_env_scengen\n"
        f"# and the robot's files: {INSTALL}\n"
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
            "output_dir": order.settings.path(output),
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
            "policy.path": order.settings.path("training/checkpoints/last/pretrained_model"),
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
            "output_dir": order.settings.path("evaluation"),
        },
    )
    yield '    --env.pool="$1"'


def _command(program: str, settings: Mapping[str, Value]) -> Iterator[str]:
    """A command with a setting in each line."""
    yield program
    for name, value in settings.items():
        yield f"    --{name}={shlex.quote(str(value))}"
