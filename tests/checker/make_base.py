"""Make the pools that the corpus of the checker is forged from: `python tests/checker/make_base.py`.

Each is made by the command line, as a user would, with one or two scenarios. All tasks are there, with training
splits, axes, severities, composed splits, an axis of the command line's own, overridden ranges and settings, other
samplers, and scenarios that were kept although they failed. Most have one jittered run instead of four, and so settings
of their own: what the corpus tests does not depend on that, and they are made in seconds.

Those of `KEPT` lie in the repository, so that the small corpus is there at once; they are made anew when a family
changes what its scenarios are. The others are made when the whole corpus is, in two minutes, and stay until the code
that their certificates depend on changes.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

BASE = Path(__file__).parent / "base"

QUICKLY = ("certify.robust.runs=1", "certify.robust.bound=0.04")
"""Settings that keep every check, with one jittered run."""
EDGE = (
    "+task.axes.edge={why: the gap is as wide as a falling tile is high, replace: {gap_ratio: [uniform, 1.85, 1.95]}}"
)
"""An axis on which the oracle of `domino_single` fails now and then."""
HEAVY = "+task.axes.heavy={why: tiles weigh more than in training, replace: {tile: {mass: [uniform, 0.065, 0.075]}}}"

TRAINING = {
    "select_id": "domino_select",
    "galileo_id": "galileo_ramp_drop",
    "cage_id": "ball_cage_escape",
    "seesaw_id": "seesaw_balance",
    "tool_id": "tool_retrieve",
    "packing_id": "packing",
    "shelf_id": "plate_shelf_hetbi",
    "mirror_id": "mirror_pick_place",
    "pendulum_id": "pendulum_grasp",
    "ball_id": "linear_intercept",
    "sorted_balls_id": "ramp_sort",
    "slip_id": "slip_recovery",
    "ycb_id": "pick_place_ycb",
    "rack_id": "sheltered_grasp",
    "sort_id": "mass_sort",
    "balance_id": "balance_medium",
    "balance_hard_id": "balance_hard",
    "across_id": "rod_across",
    "edge_id": "edge_slide",
    "box_by_cup_id": "cracker_box_suction",
    "box_by_jaw_id": "cracker_box_jaw",
    "push_id": "indirect_push",
    "gap_id": "gap_funnel",
    "extract_id": "cup_extract",
    "lids_id": "occluder_push",
    "stack_id": "shape_stack",
    "peg_id": "recover_peg_insert",
    "inverted_cup_id": "cup_inversion",
    "shelf_by_jaws_id": "plate_shelf_hobi",
    "bowl_id": "bowl_table",
    "toss_id": "cube_toss",
    "bounce_id": "bounce_intercept",
    "slide_id": "slide_catch",
    "collapse_id": "stack_collapse_recovery",
    "typing_id": "keyboard_typing",
}
"""A pool of the training split of every task but the first, by its name."""

PAPER = {
    "rack_paper": ("sheltered_grasp", "opposite_side"),
    "pendulum_paper": ("pendulum_grasp", "plane_45"),
    "single_paper": ("domino_single", "diagonal"),
    "tool_paper": ("tool_retrieve", "mirrored_hook"),
    "lids_paper": ("occluder_push", "stacked_lids"),
    "slip_paper": ("slip_recovery", "two_slips"),
    "balance_paper": ("balance_medium", "turned"),
    "typing_paper": ("keyboard_typing", "unseen_words"),
}
"""A pool of each OOD condition of the paper (App. I)."""

POOLS: dict[str, tuple[str, ...]] = {
    # at the known settings
    "single_quick": ("task=domino_single", "n=2"),
    "single_full": ("task=domino_single", "n=1", "certify=full"),
    # splits
    "single_axis": ("task=domino_single", "split=diagonal", "n=1", *QUICKLY),
    "single_severity": ("task=domino_single", "split=wide_gaps@2", "n=1", *QUICKLY),
    "single_composed": ("task=domino_single", "split=diagonal+wide_gaps@1", "n=1", *QUICKLY),
    "single_composed_of_three": ("task=domino_single", "split=turned_slab+light_tiles+wide_gaps@3", "n=1", *QUICKLY),
    # what a command line may change
    "single_own_axis": ("task=domino_single", "split=heavy", "n=1", HEAVY, *QUICKLY),
    "single_own_range": ("task=domino_single", "n=1", "task.id.gap_ratio=[uniform,0.7,1.0]", *QUICKLY),
    "single_own_horizon": ("task=domino_single", "n=1", "task.horizon=9", *QUICKLY),
    "single_own_instruction": ("task=domino_single", "n=1", "task.instruction='Knock it over.'", *QUICKLY),
    "single_own_settings": ("task=domino_single", "n=1", "certify.rest.seconds=1", "certify.settle=0.5", *QUICKLY),
    # samplers and runs
    "single_sobol": ("task=domino_single", "n=1", "sampler=sobol", *QUICKLY),
    "single_hypercube": ("task=domino_single", "n=1", "sampler=lhs:4", *QUICKLY),
    "single_grid": ("task=domino_single", "n=1", "sampler=grid:2", "split=turned_slab", *QUICKLY),
    "single_workers": ("task=domino_single", "n=2", "seed=9", "workers=2", *QUICKLY),
    "single_kept": ("task=domino_single", "split=edge", "n=1", "keep=unknown,refuted", "certify=full", EDGE),
    # the other tasks
    **{name: (f"task={task}", "n=1", *QUICKLY) for name, task in TRAINING.items()},
    **{name: (f"task={task}", f"split={split}", "n=1", *QUICKLY) for name, (task, split) in PAPER.items()},
    "select_composed": ("task=domino_select", "split=diagonal+narrow_lanes@2", "n=1", *QUICKLY),
    "galileo_severity": ("task=galileo_ramp_drop", "split=high_patch@2", "n=1", *QUICKLY),
    "cage_severity": ("task=ball_cage_escape", "split=low_stool@1", "n=1", *QUICKLY),
    "seesaw_axis": ("task=seesaw_balance", "split=heavy_target", "n=1", *QUICKLY),
    "tool_composed": ("task=tool_retrieve", "split=long_handle@1+turned_hook@1", "n=1", *QUICKLY),
    "packing_axis": ("task=packing", "split=thin_heavy", "n=1", *QUICKLY),
}
"""Arguments of `scengen generate`, by the name of the pool."""


KEPT = ("single_quick", "single_severity", *TRAINING, *PAPER)
"""Those in the repository."""


def found(name: str, others: Path) -> Path:
    """The folder of a base pool, in the repository or among the others, which are made as they are needed."""
    return (BASE if name in KEPT else others) / name


def make(name: str, folder: Path) -> None:
    """Make one pool.

    Raises:
        SystemExit: it could not be made; the text says why.
    """
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch, name)
        command = [sys.executable, "-m", "scengen", "generate", *POOLS[name], f"pool={made}"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{name}: {done.stderr.strip()}")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(made, folder)


def outdated(folder: Path) -> bool:
    """Whether a pool is not there, cannot be read, or belongs to another version of its task than the installed one."""
    from scengen import load_task
    from scengen.errors import PoolError
    from scengen.pool import Pool

    try:
        pool = Pool.open(folder)
    except PoolError:
        return True
    return pool.manifest.task_version != load_task(pool.task).version


if __name__ == "__main__":
    for name in sys.argv[1:] or KEPT:
        make(name, BASE / name)
        print(f"{name}: {sum(path.stat().st_size for path in (BASE / name).iterdir()) // 1000} kB", flush=True)
