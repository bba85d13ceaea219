"""Recipe for robomimic 0.3.0: behaviour cloning with a recurrent network, on a recording in robomimic's format.

The numbers are those of `robomimic/scripts/generate_paper_configs.py`, for poses or, if the file has pictures, for
pictures. Rollouts during training are off: `scengen evaluate` plays the checkpoints.
"""

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...compose import load_task
from ...envs import robomimic as keys
from ...errors import BadConfig, PoolError, ScengenError, cut
from ...robots.files import INSTALL
from ..hdf5 import check_target
from .settings import EPISODES, SMOKE_BATCHES, RecipeSettings, Scripts, script

NAME = "robomimic_bc_rnn"
"""Name of the recipe."""
ROBOMIMIC = "0.3.0"
"""Version of robomimic whose settings the recipe names."""
ORIGIN = (
    "The paper trains no recurrent network; these are the numbers of robomimic's study (arXiv 2108.03298) for "
    "demonstrations of proficient people."
)
HORIZON = 10
"""Number of rows of a training sequence, after which the network's state is also reset when it plays."""
DEVICES = ("cuda", "cpu")
"""Devices that robomimic's settings can name."""
CROP = 76 / 84
"""Share of the height and of the width of a picture that a random crop keeps."""
POLICY = "robomimic_scengen.checkpoint:policy"
"""The policy that plays a checkpoint, in integrations/robomimic_scengen."""


@dataclass(frozen=True)
class Data:
    """Data of a recording that a recipe needs."""

    low: tuple[str, ...]
    """Keys of vectors that the policy sees."""
    pictures: tuple[str, ...]
    """Keys of pictures that the policy sees."""
    size: tuple[int, int]
    """Width and height of the pictures [pixels]; 0 and 0 if there are none."""
    names: Mapping[str, str]
    """The environment's names of streams and cameras, by key."""

    @property
    def streams(self) -> list[str]:
        """The environment's names of what the policy sees."""
        return [self.names[key] for key in (*self.low, *self.pictures)]


def scripts(settings: RecipeSettings) -> Scripts:
    """The scripts of the recipe for a recording.

    Raises:
        ScengenError: there is no such device or recording, or it has nothing that a policy could see.
    """
    if settings.device not in DEVICES:
        told = f"robomimic trains on {' or '.join(DEVICES)}; CUDA_VISIBLE_DEVICES chooses a card"
        raise BadConfig(f"device = {cut(repr(settings.device))}; {told}")
    data = _read(settings.data)
    requirements = Path(settings.to, "requirements.txt")
    install = f"in a separate environment: pip install -r {requirements} (robomimic {ROBOMIMIC})"
    origin = f"{NAME}, robomimic {ROBOMIMIC}. {ORIGIN}"
    smoke = {"experiment": {"epoch_every_n_steps": SMOKE_BATCHES, "save": {"every_n_epochs": 1}}}
    smoke |= {"train": {"batch_size": 2, "num_epochs": 1, "num_data_workers": 0, "cuda": False}}
    files = {
        "requirements.txt": _requirements(),
        "train.json": _text(_config(settings, data, "training")),
        "smoke.json": _text(_merged(_config(settings, data, "smoke"), smoke)),
        "smoke.sh": script(
            f"Trains for {SMOKE_BATCHES} batches on the processor.", origin, _training(settings, "smoke", "smoke")
        ),
        "train.sh": script("Trains the policy.", origin, _training(settings, "train", "training")),
        "evaluate.sh": script(
            "Evaluates the newest checkpoint: sh evaluate.sh POOL[,POOL]", origin, _evaluation(settings, data)
        ),
    }
    return Scripts(ORIGIN, install, files)


def _read(path: str) -> Data:
    """Description of a recording in its own files.

    Raises:
        BadConfig: it has nothing that a policy could see.
        PoolError: it is not a recording of scengen in robomimic's format.
    """
    check_target(path, "data")
    import h5py

    wrong = f"{path} is not a recording of scengen in robomimic's format; make one with scengen record format=robomimic"
    try:
        with h5py.File(path) as file:
            demo: Any = file["data/demo_0"]
            task = load_task(str(json.loads(demo.attrs["ep_meta"])["task"]))
            shapes = {name: column.shape[1:] for name, column in demo["obs"].items()}
        names = {key: name for key, name in keys.names(task.embodiment).items() if key in shapes}
        pictures = tuple(key for key in names if key.endswith(keys.IMAGE))
        height, width, _ = shapes[pictures[0]] if pictures else (0, 0, 3)
    except FileNotFoundError:
        raise PoolError(f"no recording at {path}; see scengen record format=robomimic") from None
    except ScengenError:
        raise
    except (OSError, KeyError, AttributeError, TypeError, ValueError):
        raise PoolError(wrong) from None
    poses = ("eef_pos", f"eef_quat{keys.SITE}", "gripper_qpos")
    low = tuple(key for key in names if key.endswith(poses) or (key == keys.OBJECT and not pictures))
    if not pictures and keys.OBJECT not in low:
        remedy = "record it with cameras, or with environment_state=true"
        raise BadConfig(f"{path} has neither pictures nor {keys.OBJECT}, and a policy needs one; {remedy}")
    return Data(low, pictures, (width, height), names)


def _config(settings: RecipeSettings, data: Data, name: str) -> dict[str, Any]:
    """robomimic's settings."""
    seen = bool(data.pictures)
    return {
        "algo_name": "bc",
        "experiment": {
            "name": name,
            "validate": False,
            "logging": {"terminal_output_to_txt": True, "log_tb": False, "log_wandb": False},
            "save": {"enabled": True, "every_n_epochs": 20 if seen else 50},
            "epoch_every_n_steps": 500 if seen else 100,
            "rollout": {"enabled": False},
            "render_video": False,
        },
        "train": {
            "data": str(Path(settings.data).resolve()),
            "output_dir": str(Path(settings.to).resolve()),
            "num_data_workers": 2 if seen else 0,
            "hdf5_cache_mode": "low_dim" if seen else "all",
            "hdf5_load_next_obs": False,
            "hdf5_normalize_obs": False,
            "hdf5_filter_key": "success",
            "seq_length": HORIZON,
            "pad_seq_length": True,
            "frame_stack": 1,
            "cuda": settings.device == "cuda",
            "batch_size": 16 if seen else 100,
            "num_epochs": 600 if seen else 2000,
            "seed": settings.seed,
        },
        "algo": {
            "optim_params": {
                "policy": {
                    "optimizer_type": "adam",
                    "learning_rate": {"initial": 1e-4, "decay_factor": 0.1, "epoch_schedule": []},
                    "regularization": {"L2": 0.0},
                }
            },
            "loss": {"l2_weight": 1.0, "l1_weight": 0.0, "cos_weight": 0.0},
            "actor_layer_dims": [],
            "gmm": {
                "enabled": True,
                "num_modes": 5,
                "min_std": 1e-4,
                "std_activation": "softplus",
                "low_noise_eval": True,
            },
            "rnn": {
                "enabled": True,
                "horizon": HORIZON,
                "hidden_dim": 1000 if seen else 400,
                "rnn_type": "LSTM",
                "num_layers": 2,
                "open_loop": False,
            },
        },
        "observation": {
            "modalities": {"obs": {"low_dim": list(data.low), "rgb": list(data.pictures)}},
            **({"encoder": {"rgb": _encoder(*data.size)}} if seen else {}),
        },
    }


def _encoder(width: int, height: int) -> dict[str, Any]:
    """robomimic's network for pictures."""
    crop = {"crop_height": round(CROP * height), "crop_width": round(CROP * width), "num_crops": 1, "pos_enc": False}
    return {
        "core_class": "VisualCore",
        "core_kwargs": {
            "feature_dimension": 64,
            "backbone_class": "ResNet18Conv",
            "backbone_kwargs": {"pretrained": False, "input_coord_conv": False},
            "pool_class": "SpatialSoftmax",
            "pool_kwargs": {"num_kp": 32, "learnable_temperature": False, "temperature": 1.0, "noise_std": 0.0},
        },
        "obs_randomizer_class": "CropRandomizer",
        "obs_randomizer_kwargs": crop,
    }


def _merged(settings: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Nested settings with changes."""
    return {
        **settings,
        **{k: _merged(settings[k], value) if isinstance(value, dict) else value for k, value in changes.items()},
    }


def _text(config: Mapping[str, Any]) -> str:
    return json.dumps(config, indent=2) + "\n"


def _requirements() -> str:
    return (
        f"# {NAME}: Python 3.11 or newer, in a separate environment. cmake builds its requirement egl_probe.\n"
        f"robomimic=={ROBOMIMIC}\n"
        "# To play checkpoints, in a checkout of scengen: pip install . ./integrations/robomimic_scengen\n"
        f"# and the robot's files: {INSTALL}\n"
    )


def _training(settings: RecipeSettings, config: str, name: str) -> str:
    """The command that trains. robomimic asks whether to remove earlier runs, and ends with status 0 if it failed."""
    path = shlex.quote(settings.path(f"{config}.json"))
    folder = shlex.quote(settings.path(name))
    return f"echo n | python -m robomimic.scripts.train --config {path}\nls {folder}/*/models/*.pth"


def _evaluation(settings: RecipeSettings, data: Data) -> str:
    """The command that evaluates."""
    newest = f'"$(ls -t {shlex.quote(settings.path("training"))}/*/models/*.pth | head -n 1)"'
    told: dict[str, str | int] = {"policy": POLICY, "seeds": EPISODES, "rollouts": 1, "action_repeat": 1}
    told["observations"] = f"[{','.join(data.streams)}]"
    if data.pictures:
        told |= {"width": data.size[0], "height": data.size[1]}
    words = [shlex.quote(f"{name}={value}") for name, value in told.items()]
    return " \\\n    ".join([f"ROBOMIMIC_CHECKPOINT={newest}", 'scengen evaluate "pool=$1"', *words])
