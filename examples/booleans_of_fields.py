"""Union, intersection and difference
==================================

Fields are combined like sets: the sign is right at once, and sharpening makes the result distance again.
"""

import signedheat as sh
from signedheat import samples, view

grid = sh.Grid((-1.6, -1.4, -1.4), 0.05, (75, 57, 57))
left, right = (sh.signed_distance(samples.sphere(4, center=(x, 0, 0)), grid) for x in (-0.25, 0.25))
sets = {"a | b": left | right, "a & b": left & right, "a - b": left - right}

view.save_row(((title, field, {"across": (1,)}) for title, field in sets.items()), "booleans_of_fields.png")

# %%
# Volume common to two unit balls 0.5 apart: two caps of height 0.75:
measured = float(sets["a & b"].contour().to_trimesh().volume)
print(f"{measured:.4g}")
