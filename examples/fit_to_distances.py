"""A mesh fitted to distances
=============================

Distances were measured at 2,000 points around a body that nobody has seen. A ball takes its shape: PyTorch descends
along the gradient of the misfit by the vertices of the ball, which `sh.torch.distance` knows.
"""

import numpy as np
import torch

import signedheat as sh
from signedheat import samples, view

STEPS = 80

ball = samples.sphere(3)
bumps = 1 + 0.15 * np.sin(4 * ball.vertices[:, :1]) * np.cos(3 * ball.vertices[:, 1:2] + ball.vertices[:, 2:])
hidden = sh.TriangleMesh(ball.vertices * bumps * [1.0, 0.8, 0.7], ball.faces)
places = np.random.default_rng(0).uniform(-1.2, 1.2, (2000, 3))
points, measured = torch.tensor(places), torch.tensor(sh.complete(hidden).distance(places))

start = samples.sphere(2, 0.6)
vertices = torch.tensor(np.array(start.vertices), requires_grad=True)
optimizer = torch.optim.Adam([vertices], lr=0.02)
schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.97)
for _ in range(STEPS):
    solid = sh.complete((vertices.detach().numpy(), start.faces), as_oriented=True)
    misfit = ((sh.torch.distance(solid, points, vertices) - measured) ** 2).mean()
    optimizer.zero_grad()
    misfit.backward()
    optimizer.step()
    schedule.step()

fitted = sh.TriangleMesh(vertices.detach().numpy(), start.faces)
view.save_row(
    [("it starts as a ball", start), (f"after {STEPS} steps", fitted), ("what was measured", hidden)],
    "fit_to_distances.png",
)

# %%
# Root mean square of what the fitted mesh is off the measured distances by:
measured = float(misfit.detach().sqrt())
print(f"{measured:.4g}")
