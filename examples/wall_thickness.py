"""Where walls are thin
====================

A duck, a third of whose faces look inwards: the thickness behind every face is the diameter of the largest ball that
fits in there.
"""

import signedheat as sh
from signedheat import samples

scan = samples.with_flipped_faces(samples.duck(28), 0.3)
walls = sh.wall_thickness(scan)
least, place = walls.thinnest
print(f"{least:.3g} at {place.round(2)}; {walls.below(0.2):.1%} of the area thinner than 0.2")
walls.save("walls.ply")
walls.save("wall_thickness.png")

# %%
# Median thickness after the duck was hollowed with walls of 0.1:
hollow = sh.morphology.shell(scan, -0.1, 0.0, resolution=52)
measured = float(sh.wall_thickness(hollow).percentiles([50])[0])
print(f"{measured:.4g}")
