"""A coastline with gaps, on the globe
===================================

A whole application: distance from a coast given in lines of longitude and latitude, with gaps between them: positive
on land, to the left of the coast, negative at sea.
"""

import numpy as np

import signedheat as sh
from signedheat import samples, view


def direction(longitude: float, latitude: float) -> np.ndarray:
    """The unit vector to a point, from angles in degrees."""
    lon, lat = np.radians([longitude, latitude])
    return np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


globe = samples.sphere(4)
angle = np.linspace(0, 2 * np.pi, 181)
reach = np.degrees(0.6) * (1 + 0.12 * np.cos(5 * angle))  # with bays
coast = np.stack([-60 + reach * np.cos(angle) / np.cos(np.radians(15)), 15 + reach * np.sin(angle)], axis=1)
points = np.array([direction(*place) for place in coast])
lines = [globe.polyline(points[a : a + 16]) for a in range(0, 170, 22)]  # six of 22 steps are missing

phi = sh.signed_distance(lines, globe)
whole = sh.close_curves(lines, globe)

eye = direction(-50.0, 25.0)
view.save_row(
    [
        ("the lines, and distance from the coast", phi, {"sources": lines, "view": eye}),
        ("the coast, closed", phi, {"sources": whole, "view": eye}),
    ],
    "coastline.png",
)
middle = direction(-60.0, 15.0)
away = np.arccos([direction(*place) @ middle for place in coast])

# %%
# Distance from the coast to the middle of the island, beside the least great-circle distance:
measured = float(phi([middle])[0] / away.min())
print(f"{measured:.4g}")
