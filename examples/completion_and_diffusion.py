"""Completion and diffusion time
=============================

The longer normals diffuse, the more roundly curves are completed (Fig. 18): a square without its corners, on triangles.
"""

import numpy as np

import signedheat as sh
from signedheat import view


def disk(n_rings: int) -> sh.TriangleMesh:
    """The unit disk in rings of equal width."""
    points, faces = [[0.0, 0.0, 0.0]], []
    for ring in range(1, n_rings + 1):
        turn = np.arange(6 * ring) * np.pi / (3 * ring)
        points += (ring / n_rings * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)).tolist()
        inner, outer = 1 + 3 * (ring - 1) * (ring - 2), 1 + 3 * ring * (ring - 1)
        for k in range(6 * ring):
            side, step = divmod(k, ring)
            near = 0 if ring == 1 else inner + (side * (ring - 1) + step) % (6 * (ring - 1))
            faces.append([near, outer + k, outer + (k + 1) % (6 * ring)])
            if step < ring - 1:
                after = inner + (side * (ring - 1) + step + 1) % (6 * (ring - 1))
                faces.append([near, outer + (k + 1) % (6 * ring), after])
    return sh.TriangleMesh(points, faces)


def rotation(quarter: int) -> np.ndarray:
    return np.linalg.matrix_power(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), quarter)


mesh = disk(40)
sides = [np.array([[0.6, -0.3, 0], [0.6, 0.3, 0]]) @ rotation(quarter).T for quarter in range(4)]
broken = [mesh.polyline(side) for side in sides]
fields = [sh.SignedHeatSolver(mesh, diffusion).distance(broken) for diffusion in (1, 10, 100, 1000)]
view.save_row(
    (
        (f"diffusion = {diffusion}", phi, {"sources": broken, "view": np.array([0.0, 0.0, 1.0])})
        for diffusion, phi in zip((1, 10, 100, 1000), fields, strict=True)
    ),
    "completion_and_diffusion.png",
)
phi = fields[-1]
(whole, *_) = sorted(phi.contour(0.0), key=lambda curve: -curve.n_points)
points = np.einsum("ik,ikj->ij", whole.barycentric, mesh.vertices[mesh.faces[whole.faces]])

# %%
# how far the roundest completion goes from the centre; the corners are at 0.849:
measured = float(np.linalg.norm(points, axis=1).max())
print(f"{measured:.4g}")
