"""Turn a mesh file into an asset of convex pieces, put it into a scene, and let it fall. Prints where it ends."""

import math
import sys
from pathlib import Path

import mujoco

from scengen.assets.prop import TABLE_TOP, place, table
from scengen.cli import run
from scengen.intake.asset import IntakeRequest, make_asset

MESH = Path("generated/examples/l_piece.stl")


def main():
    MESH.parent.mkdir(parents=True, exist_ok=True)
    if status := run(["asset", "name=l_piece", f"to={MESH}"]):  # any closed mesh of yours will do
        return status
    asset = make_asset(IntakeRequest(str(MESH), mass=0.2))  # the command: scengen asset mesh=FILE to=FOLDER mass=0.2
    error = 1000 * max(asset.figures()["error"][way] for way in ("outward", "inward"))
    print(f"{len(asset.prop.corners)} convex pieces, at most {error:.2f} mm from the mesh")

    scene = table()
    place(scene, asset.prop, "thing", [0.0, 0.0, TABLE_TOP + 0.02])
    model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=round(2.0 / model.opt.timestep))
    x, y, z = data.body("thing").xpos
    aside, off = 1000 * math.hypot(x, y), 1000 * abs(z - TABLE_TOP)
    print(f"dropped from 20 mm, it rests {off:.1f} mm off the table top, {aside:.1f} mm beside the place of the drop")
    return 0


if __name__ == "__main__":  # the mesh is cut in a new process, which imports this file
    sys.exit(main())
