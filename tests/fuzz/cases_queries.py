"""Exact distance to curves, fields in bands, nearest places, samples, tiles, and images of labels."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import signedheat as sh
from fuzz.cases_space import shape, size_of
from fuzz.cases_surfaces import constraint, embedded, source, surface
from fuzz.frame import family
from fuzz.inputs import chance, one_of, spoiled
from fuzz.judging import Subject, announced, judge, length_of_edges, subject


def check_curves(given: Subject) -> str:
    """Exact distance to curves along a surface."""
    random = given.random
    domain = surface(random)
    sources = [source(random, domain) for _ in range(random.integers(1, 3))]
    asked = one_of(random, (None, None, sh.Free(), sh.ZeroSet(), constraint(random)))
    phi, warned = announced(
        lambda: sh.curve_distance(domain, sources, constraint=asked, as_oriented=chance(random, 0.3))
    )
    judge(phi.values, warned, length_of_edges(embedded(domain)))
    return "in part" if warned else "curves"


def check_queries(given: Subject) -> str:
    """Bands, nearest places and samples of a solid."""
    random = given.random
    own = shape(random)
    size = size_of(own.bounds, None)
    resolution = int(random.integers(6, 16))
    band = one_of(random, (None, 0.1 * size, size, spoiled(random, np.array([0.3 * size]), 0.5)[0]))
    kind = int(random.integers(3))
    if kind == 0 and band is not None:
        with tempfile.TemporaryDirectory() as folder:
            grid = sh.Grid.around(own.bounds, resolution)
            phi, _ = announced(lambda: sh.tiled_distance(own, Path(folder) / "tiles", grid, band=band))
        return f"tiles: {type(phi).__name__}"
    grid = sh.Grid.around(own.bounds, resolution)
    phi, warned = announced(lambda: sh.solid_distance(own, grid, band=band))
    places = spoiled(random, own.bounds.mean(axis=0) + size * random.normal(size=(4, 3)))
    if kind == 1:
        found, _ = announced(lambda: phi.closest_points(places))
        judge(found.distances, warned, 100 * size, "distances of nearest places")
        return "nearest places"
    made, _ = announced(lambda: sh.sample(phi, int(random.integers(1, 50))))
    judge(made.distances, warned, 100 * size, "distances of samples")
    judge(made.gradients, warned, 10.0, "gradients of samples")
    return "samples"


family("surface curves", subject, check_curves)
family("space queries", subject, check_queries)
