"""Triangles cut where they cross others, or lie in them."""

import numpy as np
import pytest

from signedheat.geometry.cut_faces import cut_faces


def flat_square(low: float, high: float, cells: int, first_id: int) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3, 3) corners and (m, 3) vertices of a square in the plane z = 0, of cells of two triangles each."""
    at = np.linspace(low, high, cells + 1)
    points = np.array([(x, y, 0.0) for x in at for y in at])
    corner = np.array([i * (cells + 1) + j for i in range(cells) for j in range(cells)])
    one = np.stack([corner, corner + cells + 1, corner + cells + 2], axis=1)
    other = np.stack([corner, corner + cells + 2, corner + 1], axis=1)
    faces = np.concatenate([one, other])
    return points[faces], faces + first_id


@pytest.mark.parametrize("turned", [False, True])
def test_flat_parts_in_a_plane_cut_each_other_along_their_outlines(turned):
    outer, outer_ids = flat_square(-1.0, 1.0, 8, 0)
    inner, inner_ids = flat_square(-0.53, 0.45, 13, 1000)
    if turned:
        inner, inner_ids = inner[:, ::-1], inner_ids[:, ::-1]
    pieces, origins, met = cut_faces(outer, outer_ids, inner, inner_ids)
    slack = 1e-7
    corners = pieces[:, :, :2]
    within = ((corners > -0.53 - slack) & (corners < 0.45 + slack)).all(axis=(1, 2))
    areas = 0.5 * np.linalg.norm(np.cross(pieces[:, 1] - pieces[:, 0], pieces[:, 2] - pieces[:, 0]), axis=1)
    assert areas.sum() == pytest.approx(4.0)
    assert areas[within].sum() == pytest.approx(0.98**2)
    # edges within the inner square do not cut: triangles that lie in it stay whole
    inside = ((outer > -0.53).all(axis=1) & (outer < 0.45).all(axis=1))[:, :2].all(axis=1)
    assert inside.any()
    assert met[inside].all()
    assert (np.bincount(origins)[inside] == 1).all()
