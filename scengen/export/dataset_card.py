"""The card of a LeRobot recording: what it holds, for people, and the head that the Hugging Face Hub reads."""

from collections.abc import Iterable, Mapping
from typing import Any

HEAD = """---
task_categories:
- robotics
tags:
- LeRobot
- scengen
- {robot}
configs:
- config_name: default
  data_files: data/*/*.parquet
---
"""
"""Head of a card. The Hub shows a preview of data sets with the tag LeRobot."""


def card(info: Mapping[str, Any], instructions: Iterable[str], source: Mapping[str, Any]) -> str:
    """The card of a recording, Markdown.

    Args:
        info: content of `meta/info.json`.
        instructions: instructions of its tasks.
        source: content of `meta/scengen.json`.
    """
    robot, seconds = info["robot_type"], info["total_frames"] / info["fps"]
    lines = [
        HEAD.format(robot=robot),
        f"# {info['total_episodes']} episodes of `{robot}`",
        "",
        f"LeRobot {info['codebase_version']}, {info['total_frames']} rows at {info['fps']} per second "
        f"({seconds / max(1, info['total_episodes']):.1f} s an episode), recorded from simulation by scengen.",
        "",
        *(f"* {' '.join(text.split())}" for text in instructions),
        "",
        "## What to know before training",
        "",
        "* `action` is the mean action of a row; `control.actions` holds those of all its control periods (100 Hz), "
        "as the controller received them, behind the teleoperation filter. Play them without a filter.",
        "* `waiting` marks rows in which the robot waits on purpose: their action commands no arm to move.",
        "* `meta/stats.json` has smallest spreads: 1 mm, 0.5 deg, 1 N. Constant dimensions are not divided by 1e-8.",
        "* `scengen/...` columns of the table of episodes name scenario, parameters, seed and index of each episode; "
        "`scengen/absent` lists bodies of `observation.environment_state` that the scene lacks, whose entries read 0.",
    ]
    if made := source.get("task_versions"):
        told = ", ".join(f"{name} {version}" for name, version in made.items())
        lines.append(f"* Versions of the tasks: {told}. The column `scengen/task_version` has that of each episode.")
    if styles := source.get("styles"):
        told = ", ".join(f"{count} {style}" for style, count in sorted(styles.items()))
        lines.append(f"* Styles: {told}. The column `scengen/style` names the style of each episode.")
    if constant := source.get("constant"):
        lines.append(f"* Dimensions that never change here: {len(constant)}, listed in `meta/scengen.json`.")
    return "\n".join([*lines, ""])
