"""Shapes of trimesh, PyVista and NumPy
====================================

Objects of other packages are shapes: pass them as they are. Fields go back to PyVista with `to_pyvista()`.
"""

import numpy as np
import trimesh

import signedheat as sh
from signedheat import view

part = trimesh.creation.annulus(r_min=0.5, r_max=1.0, height=0.8)
forms = {
    "trimesh": part,
    "arrays": (np.asarray(part.vertices), np.asarray(part.faces)),
    "a scene": trimesh.Scene([part]),
}
fields = {name: sh.signed_distance(form, resolution=48) for name, form in forms.items()}

view.save_row(
    [
        ("a trimesh.Trimesh", sh.as_shape(part)),
        *((f"from {name}", field, {"across": (1,)}) for name, field in list(fields.items())[:2]),
    ],
    "shapes_of_other_packages.png",
)
first = fields["trimesh"].values

# %%
# Largest difference of the distances to one shape in several forms:
measured = float(max(np.abs(field.values - first).max() for field in fields.values()))
print(f"{measured:.4g}")
