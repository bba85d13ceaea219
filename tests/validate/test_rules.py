"""What `scengen.conformance` asks of controls and names, each rule with a task that breaks it."""

from dataclasses import dataclass, replace

import pytest

from scengen import conformance, load_task
from scengen.conformance import rules
from scengen.conformance.rules import Nonconformity
from scengen.scenario import Shortcut
from scengen.tasks.domino_single import DominoSingle

TASK = load_task("domino_single")


@dataclass(frozen=True, kw_only=True)
class NoShortcuts(DominoSingle):
    """Nothing shows that its bottleneck is real."""

    def shortcuts(self):
        return {}


@dataclass(frozen=True, kw_only=True)
class NoAblations(DominoSingle):
    """Nothing shows that the chain is needed."""

    def ablations(self):
        return {}


@dataclass(frozen=True, kw_only=True)
class EmptyAblation(DominoSingle):
    """Its ablation is the scene itself."""

    def ablations(self):
        return {"no_chain": self.build()}


@dataclass(frozen=True, kw_only=True)
class SpelledShortcut(DominoSingle):
    """A name that a shell would take apart."""

    def shortcuts(self):
        return {**super().shortcuts(), "push the slab": Shortcut(self._push_slab)}


@dataclass(frozen=True, kw_only=True)
class SpelledFeature(DominoSingle):
    """A name that cannot stand in a comma list."""

    def features(self):
        return {"gap over height, least": 1.0}


@dataclass(frozen=True, kw_only=True)
class SpelledAblation(DominoSingle):
    """A name in another style."""

    def ablations(self):
        return {f"{name}-Gone": scene for name, scene in super().ablations().items()}


@pytest.mark.parametrize(
    ("family", "says"),
    [
        (NoShortcuts, "domino_single/id/0 has 0 shortcuts; at least 2"),
        (NoAblations, "domino_single/id/0 has no ablations"),
        (EmptyAblation, "the ablation 'no_chain' does not change the scene"),
        (SpelledShortcut, "the shortcut 'push the slab' must have a name in snake_case"),
        (SpelledFeature, "the feature 'gap over height, least' must have a name in snake_case"),
        (SpelledAblation, "the ablation 'no_chain-Gone' must have a name in snake_case"),
    ],
)
def test_what_shows_nothing_or_is_spelled_badly_is_caught(family, says):
    with pytest.raises(Nonconformity, match=says):
        rules._scenes_have_controls(replace(TASK, family=family), "id", 1, 0)


def test_all_rules_are_asked_of_every_split_but_certificates_only_where_wanted():
    names = [str(rule) for rule in conformance.checks("domino_single", certified=("id",))]
    for split in ("id", *TASK.axes):
        asked = {name.partition(": ")[2] for name in names if name.startswith(f"{split}: ")}
        assert {"draws are keyed", "scenes have controls"} <= asked
        assert ("scenarios are certified" in asked) == (split == "id")
    assert "scenarios are certified" in str([str(rule) for rule in conformance.checks("domino_single")][-1])
