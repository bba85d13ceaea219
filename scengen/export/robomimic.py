"""Recordings in robomimic's format: one HDF5 file, as its loaders and its robosuite environments expect it.

    data                    attributes: total (rows), env_args (the robosuite environment and its arguments)
    data/demo_0             attributes: num_samples, model_file (MJCF), ep_meta (the scenario, its parameters, `lang`)
      actions  states  rewards  dones
      obs/<key>  next_obs/<key>
    mask/<split>            names of the demonstrations of a split; mask/success: those that reach the goal

Observations have robosuite's names: `object` is `object-state`, pictures are `<camera>_image`, first row on top. Each
row is a control period of 10 ms with the action that the controller received, so that robosuite can replay the actions.
States are time, `qpos` and `qvel`. They do not contain bodies that events have moved, such as marks, nor the memory of
events, such as a count of jumps.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..control.loop import Loop
from ..envs import object_state
from ..envs.observations import Stream, cameras_of
from ..envs.robomimic import OBJECT
from ..envs.robosuite import ROBOT, RobosuiteEnv, env_class
from ..errors import BadConfig
from ..installation import versions
from ..pool.row import DemonstrationRow
from ..robots.panda import Names
from ..sim.embodiment import hands
from ..sim.world import World
from .hdf5 import Output
from .replay import Snapshot, WitnessReplay

ROBOSUITE_TYPE = 1
"""robomimic's number for robosuite environments."""
SUCCESS = "success"
"""Name of the mask of the demonstrations that reach the goal."""


def streams_of(streams: Mapping[str, Stream], embodiment: str) -> dict[str, Stream]:
    """Streams under robosuite's names. Its `eef_quat` is that of the hand's body; ours is its `eef_quat_site`."""
    found = {OBJECT if name == object_state.NAME else name: stream for name, stream in streams.items()}
    for number in range(len(hands(embodiment))):
        arm = Names(number).arm
        found[f"{arm}eef_quat_site"] = found[f"{arm}eef_quat"]
        found[f"{arm}eef_quat"] = Stream(object_state.POSE["quat"], 1.0, _hand_quat_reader(arm))
    return found


def _hand_quat_reader(arm: str) -> Callable[[World], NDArray[np.float64]]:
    return lambda world: world.data.xquat[world.body(f"{arm}right_hand")][[1, 2, 3, 0]]


class Demonstrations:
    """Writer of a robomimic file."""

    def __init__(
        self, path: Path, streams: Mapping[str, Stream], environment: RobosuiteEnv, arguments: Mapping[str, Any]
    ):
        """Start a file.

        Args:
            streams: streams to observe, by robosuite's names.
            environment: environment that composes the models of the scenarios; it does not simulate.
            arguments: robomimic's `env_args`, with which it makes this environment again.

        Raises:
            BadConfig: the file cannot be written.
        """
        import h5py

        self._output = Output(path)
        self._file = h5py.File(self._output, "w")
        self.streams, self.episodes, self.rows = streams, 0, 0
        self._environment, self._arguments = environment, arguments
        self._data = self._file.create_group("data")
        self._masks: dict[str, list[str]] = defaultdict(list)

    def episode(self, replay: WitnessReplay, origin: Mapping[str, str]) -> bool:
        """Add one scenario's demonstration, and return whether it reached the goal.

        Raises:
            BadConfig: the file cannot grow.
        """
        row, name, success = replay.row, f"demo_{self.episodes}", False
        group, columns, seen = self._data.create_group(name), defaultdict[str, list[Any]](list), list[Snapshot]()
        views = {camera: f"{view}_image" for camera, view in cameras_of(row.embodiment).items()}
        for dataset_row in replay.rows():
            columns["actions"].append(dataset_row.action)
            columns["states"].append(dataset_row.observed.physics)
            columns["rewards"].append(np.float32(dataset_row.success))
            columns["dones"].append(np.int64(dataset_row.done))
            self._add(group, "obs", dataset_row.observed, views)
            if seen:
                self._add(group, "next_obs", dataset_row.observed, views)
            seen.append(replace(dataset_row.observed, pictures={}))
            success = dataset_row.success
        last = replay.observe()
        self._add(group, "next_obs", last, views)
        for key in last.streams:
            values = np.array([view.streams[key] for view in (*seen, last)])
            group.create_dataset(f"obs/{key}", data=values[:-1])
            group.create_dataset(f"next_obs/{key}", data=values[1:])
        for key, values in columns.items():
            group.create_dataset(key, data=np.array(values))
        group.attrs["num_samples"] = len(seen)
        group.attrs["model_file"] = self._environment.model_text(row)
        metadata = {
            "scenario": row.id,
            "lang": row.instruction,
            "task": row.task,
            "task_version": replay.scenario.VERSION,
            "split": row.split,
            "success": success,
        }
        demonstrated = {name: getattr(row, name) for name in ("run", "style") if isinstance(row, DemonstrationRow)}
        place = {"axes": list(row.axes), "seed": row.seed, "index": row.index, "id_twin": row.id_twin}
        group.attrs["ep_meta"] = json.dumps({**metadata, **place, **demonstrated, **origin, "params": dict(row.params)})
        style = [f"style_{row.style}"] if isinstance(row, DemonstrationRow) else []
        for mask in (row.split, *style, *([SUCCESS] if success else [])):
            self._masks[mask].append(name)
        self._output.check()
        self.episodes, self.rows = self.episodes + 1, self.rows + len(seen)
        return success

    def finish(self, source: Mapping[str, Any]) -> None:
        """Write the metadata. `source` describes the origin of the data."""
        self._data.attrs["total"] = self.rows
        self._data.attrs["env_args"] = json.dumps(self._arguments, indent=4)
        self._data.attrs["scengen"] = json.dumps(source)
        for mask, names in self._masks.items():
            self._file.create_dataset(f"mask/{mask}", data=np.array(names, dtype="S"))

    def __enter__(self) -> "Demonstrations":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._output:
            self._file.close()
        if kind is None or not issubclass(kind, BadConfig):  # an error of HDF5 may come from what was not written
            self._output.check()

    def _add(self, group: Any, what: str, seen: Snapshot, views: Mapping[str, str]) -> None:
        """Append the pictures of a moment to the file: those of a whole episode would not fit into memory."""
        for camera, picture in seen.pictures.items():
            key, shape = f"{what}/{views[camera]}", picture.shape
            if key not in group:
                packed = {"maxshape": (None, *shape), "chunks": (1, *shape), "compression": "gzip"}
                group.create_dataset(key, (0, *shape), np.uint8, **packed)
            group[key].resize(len(group[key]) + 1, axis=0)
            group[key][-1] = picture
            self._output.check()


def stored_source(path: Path) -> dict[str, Any]:
    """What a file says of its origin, see `Demonstrations.finish`; nothing if scengen has not written it."""
    import h5py

    try:
        with h5py.File(path, "r") as file:
            found = json.loads(str(file["data"].attrs["scengen"]))
    except (OSError, KeyError, ValueError, TypeError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def environment(
    task: str, pools: Sequence[str], cameras: Sequence[str], size: tuple[int, int], search: tuple[str, ...]
) -> tuple[RobosuiteEnv, dict[str, Any]]:
    """The robosuite environment for replaying demonstrations, and robomimic's `env_args` of it.

    Args:
        pools: folders of the pools.
        cameras: the paper's names of the observed cameras.
        size: width and height of the pictures [pixels].
        search: folders of other packages with tasks, see `task_files.search_path`.
    """
    kind, rate = env_class(task, search), round(1 / Loop.PERIOD)
    blind: dict[str, Any] = {
        "use_object_obs": False,
        "use_camera_obs": False,
        "has_renderer": False,
        "has_offscreen_renderer": False,
    }
    made = kind(pool=pools, control_freq=rate, **blind)
    views = [cameras_of(made.task.embodiment)[camera] for camera in cameras]
    arguments = {
        "robots": [ROBOT] * len(made.robots),
        "pool": [str(Path(pool).resolve()) for pool in pools],  # so that it plays from any working folder
        "control_freq": rate,
        "reward_shaping": False,
        "ignore_done": True,
        "use_object_obs": True,
        "use_camera_obs": bool(views),
        "has_renderer": False,
        "has_offscreen_renderer": bool(views),
        **({"camera_names": views, "camera_widths": size[0], "camera_heights": size[1]} if views else {}),
    }
    identity = {"env_name": kind.__name__, "env_version": versions()["robosuite"], "type": ROBOSUITE_TYPE}
    return made, {**identity, "env_kwargs": arguments}
