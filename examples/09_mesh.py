"""Turn a mesh file into a body of a task: a weight that is set down on the left. Prints how the mesh is cut, and the
verdict on the scenario; its film is generated/examples/weight.webp."""

import dataclasses
from pathlib import Path

import trimesh

import scengen
from scengen.assets import mesh_prop, prop
from scengen.cli import run
from scengen.pictures import film
from scengen.predicates import rests_on
from scengen.skills import jaw


@dataclasses.dataclass(frozen=True, kw_only=True)
class SetDownLeft(scengen.Scenario):
    weight: mesh_prop.MeshProp  # in a package, with its file as default: = MeshProp.load("assets/weight", __file__)

    def build(self):
        scene = prop.table()
        prop.place(scene, self.weight, "weight", [0.0, -0.1, prop.TABLE_TOP])
        return scene

    def success(self, world):
        return world.pos("weight")[1] > 0.08 and rests_on(world, "weight", "table")

    def oracle(self, world, distance=0.2):
        x, y, z = world.com("weight")
        yield from jaw.pick(world.arm, [x, y, z + 0.02], closing=[0, 1, 0])  # by its handle
        yield from jaw.put(world.arm, "weight", [x, y + distance, z], on="table")

    def shortcuts(self):
        return {"set_it_down_halfway": scengen.Shortcut(lambda world: self.oracle(world, distance=0.1))}


if __name__ == "__main__":  # the mesh is cut in a new process, which imports this file
    weight = Path("generated/examples/weight")
    outline = [(0, 0), (25, 0), (25, 10), (12, 16), (12, 52), (0, 54)]  # radius and height [mm]
    weight.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.revolve(outline).export(f"{weight}.stl")  # any closed mesh of yours will do
    run(["asset", f"mesh={weight}.stl", f"to={weight}", "units=mm", "mass=0.15"])  # the command scengen asset
    scenario = SetDownLeft(weight=mesh_prop.MeshProp.load(weight))
    certified = scengen.certify(scenario, horizon=10.0)
    print(f"the scenario is {certified.certificate.verdict}")
    take = film.Take(scenario, certified.scene_xml, "panda_jaw", certified.witness)
    Path(f"{weight}.webp").write_bytes(film.inline(take).content)
