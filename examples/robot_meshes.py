"""The meshes of a robot
=====================

A robot's description (URDF) refers to meshes, each with a scale. One call makes a distance field of each, for planners,
and a closed mesh beside it, however broken the meshes are. `signedheat batch robot.urdf` does the same.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, view

Path("arm/meshes").mkdir(parents=True, exist_ok=True)
base = samples.torus(1.0, 0.45, n_around=64, n_across=32)
for name, mesh, holes in (("base", base, 5), ("link", samples.sphere(4), 4)):
    samples.without_patches(mesh, holes, 0.3, seed=1).save(f"arm/meshes/{name}.stl")

Path("arm/arm.urdf").write_text("""<robot name="arm">
  <link name="base"><visual><geometry><mesh filename="meshes/base.stl"/></geometry></visual></link>
  <link name="lower"><visual><geometry>
    <mesh filename="package://arm/meshes/link.stl" scale="0.35 0.35 1"/>
  </geometry></visual></link>
  <link name="upper"><visual><geometry>
    <mesh filename="package://arm/meshes/link.stl" scale="0.25 0.25 0.8"/>
  </geometry></visual></link>
</robot>""")

job = sh.batches.Job(volume=".npz", offsets=(0.0,), resolution=64)
batch = sh.batches.run("arm/arm.urdf", "arm/made", job, workers=1)
fields = [sh.read_field(f"arm/made/{outcome.name}.npz") for outcome in batch.outcomes]
base, lower, upper = (sh.read(f"arm/made/{outcome.name}_+0.stl") for outcome in batch.outcomes)


def placed(mesh: sh.TriangleMesh, height: float, turn: float) -> sh.TriangleMesh:
    """A mesh that leans, moved along z."""
    c, s = np.cos(turn), np.sin(turn)
    return sh.transform(mesh, [[c, 0, s, s * height], [0, 1, 0, 0], [-s, 0, c, c * height], [0, 0, 0, 1]])


robot = samples.union(base, placed(lower, 0.9, 0.2), placed(upper, 2.2, 0.45))
view.save_row(
    [
        ("in: base.stl", sh.read("arm/meshes/base.stl"), {"view": (25, -60)}),
        ("in: link.stl, used twice", sh.read("arm/meshes/link.stl"), {"view": (25, -60)}),
        ("the field of a link", fields[1], {"across": (1,)}),
        ("closed, and put together", robot, {"view": (15, -60)}),
    ],
    "robot_meshes.png",
)

# %%
# Volume of the second link beside that of an ellipsoid with half axes 0.25, 0.25 and 0.8:
measured = sh.complete(upper).volume / (4 / 3 * np.pi * 0.25 * 0.25 * 0.8)
print(f"{measured:.4g}")
