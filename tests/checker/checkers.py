"""What the corpus is put to: scengen's own verification, and controls that must do badly.

A checker is given the folder of a pool and a level, and returns an exit status: 0 sound, 1 refuted, 2 not a pool,
3 declined. It says why on standard output.
"""

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

Checker = Callable[[Path, str, tuple[str, ...]], int]
SOUND, REFUTED = 0, 1


def scengen(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """`scengen verify`, as on the command line."""
    from scengen import cli

    if (folder / "meta").exists():  # a recording, which `scengen curate` judges; it writes into it
        shutil.copytree(folder, "out")
        return cli.run(["curate", "data=out"])
    junit = ["junit=out.xml"] if (folder / "manifest.json").exists() else []
    return cli.run(["verify", f"pool={folder}", f"level={level}", "json=out.json", *junit, *arguments])


def robosuite(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """`scengen verify robosuite`, a second checker with another simulation loop and robosuite's own controller.

    It judges what the witness does in the scene of the file, and nothing else.
    """
    from scengen import cli

    return cli.run(["verify", "robosuite", f"pool={folder}", "limit=1"])


def always(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """Accepts everything."""
    return SOUND


def parse(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """Accepts what can be read."""
    try:
        _rows(folder, json.loads((folder / "manifest.json").read_text()))
    except Exception as error:  # whatever a parser has to say
        return _no(repr(error))
    return SOUND


def hashes(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """Accepts what can be read and has the hashes that it says it has."""
    try:
        manifest = json.loads((folder / "manifest.json").read_text())
        for shard in manifest["shards"]:
            if hashlib.sha256((folder / shard["file"]).read_bytes()).hexdigest() != shard["sha256"]:
                return _no(f"{shard['file']} has another sha256")
        for row in _rows(folder, manifest):
            if hashlib.sha256(row["scene_xml"].encode()).hexdigest() != row["scene_sha256"]:
                return _no(f"{row['id']}: the scene has another sha256")
    except Exception as error:
        return _no(repr(error))
    return SOUND


def replay(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
    """Accepts what has right hashes, belongs to its parameters and is solved by its witness, as the file says.

    This was all that `scengen verify` did once. It believes every label, and the scene that stands in the file.
    """
    import numpy as np

    from scengen import load_task
    from scengen.sim.world import World
    from scengen.validate.rollout import replay as play

    if hashes(folder, level, arguments):
        return REFUTED
    try:
        for row in _rows(folder, json.loads((folder / "manifest.json").read_text())):
            scenario = load_task(row["task"]).scenario(json.loads(row["params"]))
            certificate = row["certificate"]
            witness = next(check for check in certificate["checks"] if check["name"] == "witness")
            settle = json.loads(witness["settings"])["settle"]
            if row["id"] != scenario.id or any(check["passed"] is False for check in certificate["checks"]):
                return _no("the id does not belong to the parameters, or a check has failed")
            world = World.load(row["scene_xml"], row["embodiment"])
            actions = np.array(row["witness"], np.float32).reshape(-1, world.size)
            if not play(scenario, world, actions, row["horizon"], settle).solved:
                return _no("the witness fails")
    except Exception as error:
        return _no(repr(error))
    return SOUND


def _rows(folder: Path, manifest: dict) -> list[dict]:
    import pyarrow.parquet as pq

    rows = []
    for shard in manifest["shards"]:
        rows += pq.read_table(folder / shard["file"]).to_pylist()
    for row in rows:
        json.loads(row["params"])
    return rows


def _no(why: str) -> int:
    print(" ".join(why.split())[:300])
    return REFUTED


SECONDS, MEGABYTES = 8, 1200
"""What a command may take for a scenario, instead of minutes and thousands: that it ends is tested, and not when."""


def _command(*command: str) -> Checker:
    """A command that opens pools: it judges nothing, and is only asked to end properly."""

    def run(folder: Path, level: str, arguments: tuple[str, ...]) -> int:
        from scengen import cli
        from scengen.cli.commands import export
        from scengen.validate import playable
        from scengen.work.parallel import Limits

        playable.UNTRUSTED_LIMITS = export.UNTRUSTED_LIMITS = Limits(SECONDS, MEGABYTES)
        return cli.run([command[0], f"pool={folder}", *command[1:]])

    return run


ANY = "id=8"
"""The beginning of an id in the pools that hostile ones are made from."""
LIMITED = (f"limit_seconds={SECONDS}", f"limit_mb={MEGABYTES}")
COMMANDS: dict[str, Checker] = {
    "show": _command("show"),
    "show_one": _command("show", ANY),
    "show_sheet": _command("show", "to=out.html", "images=2"),
    "export": _command("export", "to=out"),
    "film": _command("film", ANY, "to=out.png", "frames=2", "width=64", "height=64"),
    "record": _command("record", "to=out", "cameras=none", "n=1"),
    "evaluate": _command("evaluate", "policy=idle", "seeds=1", "rollouts=1", "to=out"),
    "attack": _command("attack", "n=1", "budget=2", "to=out", *LIMITED),
    "bias": _command("audit"),
    "compare": _command("compare"),
    "report": _command("report", "to=out.html"),
    "subset": _command("subset", "n=1", "to=out"),
    "robosuite_one": _command("verify", "robosuite", "first=1", *LIMITED),
}
CHECKERS: dict[str, Checker] = {f.__name__: f for f in (scengen, robosuite, always, parse, hashes, replay)} | COMMANDS
CONTROLS = ("always", "parse", "hashes")
"""Checkers that know nothing of the claims: if one of them does well, the corpus is too easy."""
EASY = 0.30
"""Soundness that no control may reach."""
