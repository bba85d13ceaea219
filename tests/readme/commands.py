"""The commands of README.md and docs/ as they are written there, and those that are not run by default."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

PAGES = tuple(
    ROOT / page
    for page in (
        "README.md",
        "docs/generate.md",
        "docs/view.md",
        "docs/demonstrations.md",
        "docs/policies.md",
        "docs/adversary.md",
        "docs/axis-evaluation.md",
    )
)
"""Pages whose commands are run one after the other: later pages use the pools of earlier ones."""

APART = {
    "make demo": "continuous integration runs it separately",
    "make test": "continuous integration runs it separately",
    ".venv/bin/python examples/": "tests/test_examples.py runs them",
    "scengen generate task=domino_single split=diagonal+wide_gaps certify=full": "certifies at level full: 5 minutes",
    "scengen generate task=seesaw_balance": "64 scenarios: 10 minutes",
    "scengen generate task=domino_single split=slick": "20 scenarios more: 2 minutes",
    "scengen generate task=domino_single split=id,diagonal seed=0,1": "20 scenarios more: 2 minutes",
    "scengen generate task=domino_single n=100 attack=500": "100 scenarios, and 500 rollouts: 15 minutes",
    "scengen show pool=generated/id,generated/low_starter": "40 pictures: a minute without a graphics card",
    "scengen show view": "needs a display",
    "scengen attack": "200 rollouts: 2 minutes",
    "scengen show film hit=": "the name is that of a hit, which differs from machine to machine",
    "scengen verify hits=": "the hits are those of scengen attack",
    "scengen record pool=generated/id to=recordings/id ": "four cameras: a quarter of an hour without a graphics card",
    "scengen record pool=generated/domino_single-id-demos": "the demonstrations are not made",
    "scengen verify robosuite": "10 episodes under robosuite's own controller: 2 minutes",
    "pip install": "it would change the environment",
    "pytest --scengen-task": "wants the package of scengen new to be installed",
    "scengen demos task=domino_single n=200": "200 demonstrations: a minute",
    "scengen demos task=domino_single,packing": "40 demonstrations: a minute",
    "scengen verify pool=generated/domino_single-id-demos": "the demonstrations are not made",
    "scengen curate data=recordings/domino": "the recording is not made",
    "scengen train policy=bc data=generated/domino-demos": "200 demonstrations are recorded: minutes",
    "scengen evaluate policy=policies/domino": "the policy is not trained",
    "scengen evaluate policy=replay edition=v1": "certifies 40 scenarios: minutes",
    "scengen evaluate threshold": "certifies 50 scenarios: 3 minutes of processor time",
    "scengen edition edition=mine.yaml": "certifies 40 scenarios: minutes",
    "scengen curate stats": "the recording is not made",
    "scengen evaluate policy=lerobot_env_scengen": "needs an environment with LeRobot",
    "scengen evaluate policy=ws://": "needs a server of policies",
    "scengen evaluate policy=zmq://": "needs a server of policies",
    "scengen studio": "runs until it is interrupted",
    ". .venv/bin/activate": "commands are found on the path of the runner",
    "scengen site": "films and pictures of all axes: 2 minutes",
    "scengen axis card": "an hour",
    "scengen axis discover": "an hour",
    "scengen axis shrink": "certifies some hundred scenarios: 10 minutes",
}
"""Prefixes of commands that `make readme` omits, with the reason. `make readme ALL=all` runs them too."""


def commands(*pages: Path) -> list[str]:
    """Every command in the `sh` blocks of some pages, in order. A backslash at the end joins the next line."""
    blocks = [
        block for page in pages or PAGES for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.M | re.S)
    ]
    return [line for block in blocks for line in block.replace("\\\n", " ").splitlines() if line.strip()]


QUOTED = re.compile(r"'[^']*'|\"[^\"]*\"")
"""What a shell takes as it is, but for `$` and backquotes."""
GLOBBED = re.compile(r"[\[\]{}()*?<>^!;&|]|(?<!\S)[~=]|(?<==)~")
"""What zsh or bash expands, or takes for itself, outside quotes."""


def globbed(command: str) -> str:
    """What a shell would change in a command before it runs; empty if nothing. Comments do not count."""
    found = GLOBBED.search(QUOTED.sub("", command).split(" #")[0])
    return found[0] if found else ""


def why_apart(command: str) -> str:
    """Why a command is not run as a matter of course; empty for one that is."""
    return next((why for start, why in APART.items() if command.startswith(start)), "")
