"""A coastline with gaps, on the globe
===================================

A whole application: distance from a coast given in pieces of longitude and latitude, with gaps between them: positive
on land, to the left of the coast, negative at sea.
"""

from pathlib import Path

import numpy as np

import signedheat as sh
from signedheat import samples, visualization

EXPECTED = (1.0, 0.08)
"""Distance from the coast to the middle of the island, beside the least great-circle distance."""


def on_globe(longitude: np.ndarray, latitude: np.ndarray) -> np.ndarray:
    """Positions on the unit sphere, from angles in degrees."""
    lon, lat = np.radians(longitude), np.radians(latitude)
    return np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)


def main(folder: Path) -> float:
    """Write a picture; return the distance at the middle of the island over the least great-circle distance."""
    globe = samples.sphere(4)
    angle = np.linspace(0, 2 * np.pi, 181)
    reach = np.degrees(0.6) * (1 + 0.12 * np.cos(5 * angle))  # with bays
    coast = on_globe(-60 + reach * np.cos(angle) / np.cos(np.radians(15)), 15 + reach * np.sin(angle))
    pieces = [globe.polyline(coast[a : a + 16]) for a in range(0, 170, 22)]  # six of 22 steps are missing

    phi = sh.sharpen(sh.signed_distance(pieces, globe, constraint=sh.Free()))
    whole = sh.close_curves(globe, pieces)

    view = on_globe(np.array(-50.0), np.array(25.0))
    visualization.save_row(
        folder / "coastline.png",
        ("the pieces, and distance from the coast", phi, {"sources": pieces, "view": view}),
        ("the coast, closed", phi, {"sources": whole, "view": view}),
    )
    middle = on_globe(np.array(-60.0), np.array(15.0))
    return float(phi([middle])[0] / np.arccos(coast @ middle).min())


if __name__ == "__main__":
    print(f"{main(Path('.')):.4f}, expected {EXPECTED[0]:.4f}")
