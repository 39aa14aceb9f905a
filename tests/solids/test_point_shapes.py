"""Points of any leading shape: results keep it, and one point gives one number."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

BALL = samples.sphere(2)
SOLID = sh.complete(BALL)
EXACT = SOLID.field(resolution=12)
FIELD = sh.Field(EXACT.domain, EXACT.values, confidence=EXACT.confidence)
BAND = SOLID.field(spacing=0.04, band=0.1)
TETS = sh.Field(sh.TetMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]), np.arange(4.0))
SURFACE = sh.Field(BALL, BALL.vertices[:, 2])

QUERIES = {
    "solid distance": (SOLID.distance, ()),
    "solid inside": (SOLID.inside, ()),
    "exact field": (EXACT, ()),
    "exact gradient": (EXACT.gradient, (3,)),
    "exact confidence": (EXACT.confidence_at, ()),
    "field": (FIELD, ()),
    "interpolated": (FIELD.interpolate, ()),
    "gradient": (FIELD.gradient, (3,)),
    "confidence": (FIELD.confidence_at, ()),
    "band": (BAND.interpolate, ()),
    "tets": (TETS, ()),
    "gradient on tets": (TETS.gradient, (3,)),
    "surface": (SURFACE, ()),
    "gradient on a surface": (SURFACE.gradient, (3,)),
    **{
        f"closest {name}": (lambda points, name=name: getattr(SOLID.closest(points), name), size)
        for name, size in {
            "distances": (),
            "points": (3,),
            "faces": (),
            "barycentric": (3,),
            "gradients": (3,),
            "confidence": (),
            "completed": (),
        }.items()
    },
}


@pytest.mark.parametrize("name", QUERIES)
@pytest.mark.parametrize("shape", [(), (1,), (4, 5), (2, 1, 3), (0,), (2, 0)])
def test_results_have_the_shape_of_the_points(name, shape):
    query, size = QUERIES[name]
    points = np.random.default_rng(0).uniform(0.1, 0.9, (*shape, 3))
    found = query(points)
    assert np.shape(found) == (*shape, *size)
    rows = query(points.reshape(-1, 3))
    np.testing.assert_array_equal(np.reshape(found, rows.shape), rows)


@pytest.mark.parametrize("name", QUERIES)
def test_points_without_three_coordinates_are_refused(name):
    for points in (np.zeros((3, 2)), 1.0, np.zeros(0)):
        with refused(sh.errors.GeometryError, element="points"):
            QUERIES[name][0](points)
