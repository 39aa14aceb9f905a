"""A watertight part from a broken scan
====================================

A whole application: a scan with holes, noise and turned faces becomes a closed solid, and says where it had to guess.
"""

from pathlib import Path

import signedheat as sh
from signedheat import samples, view

EXPECTED = (1.0, 0.06)
"""Its volume beside that of the part before it was damaged."""


def main(folder: Path) -> float:
    """Write the closed part and a picture; return the quotient of the volumes."""
    part = samples.torus(1.0, 0.4)
    scan = samples.without_patches(part, 6, 0.3, seed=1)
    scan = samples.with_flipped_faces(samples.with_noise(scan, 0.008, seed=2), 0.1, seed=3)

    phi = sh.signed_distance(scan, resolution=72)
    closed = phi.contour()
    closed.save(folder / "part.stl")
    confidence = sh.GridField(phi.grid, phi.values.clip(max=0.3))

    view.save_row(
        folder / "watertight_scan.png",
        ("in: holes, noise, turned faces", scan, {"view": (40, -58)}),
        ("signed distance", confidence, {"shape": scan, "across": (2,)}),
        ("out: closed", closed, {"view": (40, -58)}),
    )
    return float(closed.to_trimesh().volume / part.to_trimesh().volume)


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
