"""Exact distance to curves, fields in bands, nearest places, samples, tiles, and images of labels."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

import signedheat as sh
from fuzz.cases_space import shape, size_of
from fuzz.cases_surfaces import constraint, embedded, source, surface
from fuzz.frame import Wrong, family
from fuzz.inputs import chance, one_of, spoiled
from fuzz.judging import Subject, announced, judge, length_of_edges, subject
from signedheat.solids.completion import complete


def check_curves(given: Subject) -> str:
    """Exact distance to curves along a surface."""
    random = given.random
    domain = surface(random)
    sources = [source(random, domain) for _ in range(random.integers(1, 3))]
    asked = one_of(random, (None, None, sh.constraints.Free(), sh.constraints.ZeroSet(), constraint(random)))
    phi, warned = announced(
        lambda: sh.signed_distance(sources, domain, constraint=asked, as_oriented=chance(random, 0.3))
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
            phi, _ = announced(lambda: complete(own).field(grid=grid, band=band, store=Path(folder) / "tiles"))
        return f"tiles: {type(phi).__name__}"
    grid = sh.Grid.around(own.bounds, resolution)
    phi, warned = announced(lambda: complete(own).field(grid=grid, band=band))
    places = spoiled(random, own.bounds.mean(axis=0) + size * random.normal(size=(4, 3)))
    if kind == 1:
        found, _ = announced(lambda: phi.closest(places))
        judge(found.distances, warned, 100 * size, "distances of nearest places")
        return "nearest places"
    made, _ = announced(lambda: sh.sample_distances(phi, int(random.integers(1, 50))))
    judge(made.distances, warned, 100 * size, "distances of samples")
    judge(made.gradients, warned, 10.0, "gradients of samples")
    return "samples"


def check_labels(given: Subject) -> str:
    """Images of labels with turned axes: distance of one of them, at its place in the world, and read again."""
    random = given.random
    counts = random.integers(1, 8, 3)
    labels = one_of(random, (np.zeros, np.ones, random.random))(tuple(counts)) * one_of(random, (1, 2, 300, -3))
    with np.errstate(invalid="ignore", over="ignore"):
        labels = spoiled(random, labels).astype(one_of(random, (float, np.float32, np.int16, np.uint8)))
    turned = np.linalg.qr(random.normal(size=(3, 3)))[0] if chance(random, 0.7) else np.eye(3)
    steps = one_of(random, (1.0, 1e-12, 1e12, 10.0 ** random.uniform(-2, 2, 3)))
    image = sh.io.LabelImage(labels, turned * steps, spoiled(random, random.normal(size=3)), None)
    label = one_of(random, (None, 0, 1, *labels.ravel()[:2].tolist()))
    own = image.surface(label)
    grid = image.grid if chance(random, 0.5) else sh.Grid.around(own.bounds, int(random.integers(4, 12)))
    phi, warned = announced(lambda: sh.signed_distance(own, grid))
    size = size_of(np.concatenate([own.bounds, [grid.origin, grid.upper]]), None)
    judge(phi.values, warned, size, "distance to a label")
    world, _ = announced(lambda: image.to_world(phi.contour()))
    judge(world.vertices, False, np.inf, "contour in the world")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / one_of(random, ("phi.nrrd", "phi.nii", "phi.nii.gz", "phi.vti"))
        image.save(phi, path)
        again = sh.io.read_labels(path)
    if not (np.array_equal(again.labels, phi.values) and np.allclose(np.abs(again.axes), np.abs(turned * steps
            * (grid.spacing / image.spacing)), rtol=1e-5, atol=1e-5 * float(grid.spacing.max()))):  # fmt: skip
        raise Wrong("other values or axes when read again", path.name)
    return "labels"


family("surface curves", subject, check_curves)
family("space queries", subject, check_queries)
family("space labels", subject, check_labels)
