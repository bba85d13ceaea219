"""Write a task: a scene, a goal, a solution, a shortcut that must fail, and an axis. Prints the checks of a scenario.
`scengen new` writes a complete task as a package, with its tests and a tutorial."""

from dataclasses import dataclass

import scengen
from scengen.assets import box, patch, prop
from scengen.predicates import rests_on
from scengen.samplers.task import load
from scengen.skills.jaw import pick, put


@dataclass(frozen=True, kw_only=True)
class Deliver(scengen.Scenario):
    NO_ABLATIONS = "the hand carries the cube; there is no other means to take away"
    y: float = scengen.param(0.15, "m", -0.3, 0.3)  # the place of the patch

    def build(self):
        scene = prop.table()
        prop.place(scene, box.Cube(edge=0.04), "cube", [-0.05, -0.10, prop.TABLE_TOP])
        prop.place(scene, patch.Patch(size=0.10), "patch", [0.0, self.y, prop.TABLE_TOP], free=False)
        return scene

    def success(self, world):
        return abs(world.pos("cube") - world.pos("patch")).max() < 0.03 and rests_on(world, "cube", "table")

    def oracle(self, world, share=1.0):
        start, way = world.com("cube"), world.pos("patch") - world.pos("cube")
        yield from pick(world.arm, start, closing=[0, 1, 0])
        yield from put(world.arm, "cube", start + share * way, on="table")

    def shortcuts(self):
        return {"put_it_down_halfway": scengen.Shortcut(lambda world: self.oracle(world, share=0.5))}


splits = {"id": {"y": ["uniform", 0.1, 0.15]}, "axes": {"far": {"replace": {"y": ["uniform", 0.2, 0.25]}}}}
about = {"family": "__main__.Deliver", "code": "X01", "category": "M", "instruction": "Put the cube on the patch."}
draw = load("deliver", {**about, **splits, "horizon": 10.0}).draw("far", seed=0, index=0)
for check in scengen.certify(draw.scenario, horizon=10.0).certificate.checks:
    print(f"{check.name:10} {'passed' if check.passed else check.reason}")
