"""Where a distance is sure
========================

Distance knows how far the surface that is nearest was there, and how far it had to be completed.
"""

import signedheat as sh
from signedheat import samples, view

ball = samples.sphere(5)
hole = ball.vertices[ball.faces].mean(axis=1)[:, 0] > 0.75
shape = sh.TriangleMesh(ball.vertices, ball.faces[~hole])
phi = sh.signed_distance(shape, resolution=72)
sure = sh.Field(phi.domain, phi.confidence.astype(float))

figure = view.new_figure(12, 4.2)
left, middle, right = (figure.add_subplot(1, 3, k + 1) for k in range(3))
view.draw_shape(shape, left, view=(15, -40))
view.draw_slices(phi, [middle], shape, across=(1,))
node = phi.domain.shape[1] // 2
picture = right.pcolormesh(
    phi.domain.axes[0], phi.domain.axes[2], sure.values[:, node].T, cmap="cividis", vmin=0, vmax=1
)
right.set(aspect="equal", xlabel="x", ylabel="z", title="confidence")
figure.colorbar(picture, ax=right)
left.set_title("a ball without a cap")
figure.savefig("confidence.png")
assert sure([1.2, 0.0, 0.0]) < 0.9

# %%
# Confidence on the side where no face is missing:
measured = float(sure([-1.2, 0.0, 0.0]))
print(f"{measured:.4g}")
