"""Solids at points: signs by the nearest triangle's normal are those of winding numbers."""

import functools

import numpy as np
import pytest
import scipy
import trimesh
from scipy.spatial.transform import Rotation

import signedheat as sh
from refusals import refused
from shapes.bodies import box, sheet
from signedheat import samples
from signedheat.io.solid_arrays import _key
from signedheat.search.face_tree import FaceFeatures
from signedheat.solids.completion import complete
from signedheat.solids.winding import Windings, open_edges_of


def two_cones():
    """Pyramids that touch at their tips, one of them sharp."""
    base = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1.0]])
    faces = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])[:, ::-1]
    upper = sh.TriangleMesh(np.concatenate([base, np.zeros((1, 3))]), faces)
    lower = sh.TriangleMesh(upper.vertices * [0.1, 0.1, -1], faces[:, ::-1])
    return samples.union(upper, lower)


SHAPES = {
    "ball": lambda: samples.sphere(3),
    "lids": lambda: samples.without_patches(samples.sphere(3), 4, 0.4, seed=1),
    "cut faces": lambda: samples.union(samples.sphere(3), samples.sphere(2, 0.6, (0.9, 0.2, 0))),
    "box in a box": lambda: samples.union(box((-1, -1, -1), (1, 1, 1)), box((-0.5, -0.2, -0.3), (0.5, 0.2, 0.3))),
    "with a sheet": lambda: samples.union(
        box((-1, -1, -1), (1, 1, 1)), sheet([[0, 0, 0], [0, 3, 0], [0, 3, 1], [0, 0, 1]])
    ),
    "noise": lambda: samples.with_noise(samples.torus(0.8, 0.3, 40, 20), 0.02),
    "two cones": two_cones,
    "points": lambda: samples.oriented_points(samples.sphere(3), 500),
    "copies that rounding parts": lambda: samples.union(
        samples.torus(0.8, 0.3, 20, 10), samples.with_noise(samples.torus(0.8, 0.3, 20, 10), 3e-7)
    ),
}


def points_around(solid):
    rng = np.random.default_rng(0)
    lower, upper = solid.bounds
    size = float((upper - lower).max())
    far = rng.uniform(lower - 0.3 * size, upper + 0.3 * size, (3000, 3))
    corners = solid.triangles.reshape(-1, 3)
    near = corners[rng.integers(0, len(corners), 3000)]
    weights = rng.dirichlet([0.5] * 3, 3000)
    on_faces = np.einsum("nk,nki->ni", weights, solid.triangles[rng.integers(0, len(solid.triangles), 3000)])
    return np.concatenate(
        [
            far,
            *(near + rng.normal(0, off * size, near.shape) for off in (1e-1, 1e-3, 1e-6)),
            *(on_faces + rng.normal(0, off * size, near.shape) for off in (1e-4, 1e-7, 1e-8, 1e-9)),
        ]
    )


@pytest.mark.parametrize(
    ("name", "keep_overlaps"),
    [
        *((name, False) for name in SHAPES),
        *((name, True) for name in ("lids", "cut faces", "box in a box", "with a sheet")),
    ],
)
def test_signs_are_those_of_winding_numbers(name, keep_overlaps):
    solid = complete(SHAPES[name](), keep_overlaps=keep_overlaps)
    points = points_around(solid)
    numbers = solid.windings.numbers(points)
    clear = np.abs(numbers - 0.5) > 0.2  # not on the surface, nor as near as the tree errs
    assert clear.mean() > 0.9
    np.testing.assert_array_equal((solid.distance(points) < 0)[clear], (numbers > 0.5)[clear])
    np.testing.assert_array_equal(solid.closest(points).distances, solid.distance(points))


@pytest.mark.parametrize("completion", ["lids", "heat"])
def test_what_closes_is_a_cycle_and_signs_are_those_of_its_winding_number(completion):
    solid = complete(SHAPES["lids"](), completion=completion)
    assert not len(open_edges_of(solid.windings.triangles))
    points = points_around(solid)
    np.testing.assert_array_equal(solid.distance(points) < 0, solid.inside(points))


@pytest.mark.parametrize("seed", [3, 26, 32, 40, 58, 109])
def test_volume_inside_and_surface_agree_on_boxes_that_touch_and_overlap(seed):
    """Boxes between whole places, some without a side: faces cover each other in part."""
    rng = np.random.default_rng(seed)
    boxes = []
    for _ in range(rng.integers(3, 9)):
        lower = rng.integers(0, 4, 3)
        whole = box(lower, lower + rng.integers(1, 3, 3))
        gone = rng.choice(6, rng.integers(0, 2), replace=False)
        boxes.append(sh.TriangleMesh(whole.vertices, whole.faces[~np.isin(np.arange(12) // 2, gone)]))
    shape = samples.union(*boxes)
    turned = rng.random(shape.n_faces) < 0.2
    faces = np.where(turned[:, None], shape.faces[:, ::-1], shape.faces)
    solid = complete(sh.TriangleMesh(shape.vertices, faces))
    lattice = np.stack(np.meshgrid(*[np.arange(-0.9, 6, 0.2)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    assert solid.volume == pytest.approx(solid.inside(lattice).sum() * 0.2**3, rel=0.02)
    assert complete(solid.surface()).volume == pytest.approx(solid.volume, rel=1e-9)
    order, rotation = rng.permutation(len(faces)), scipy.spatial.transform.Rotation.random(random_state=seed + 1)
    moved = shape.vertices @ rotation.as_matrix().T + 1e3 * np.ptp(shape.vertices)
    assert complete(sh.TriangleMesh(moved, faces[order])).volume == pytest.approx(solid.volume, rel=1e-9)


def test_no_solid_is_made_of_what_is_open():
    ball = samples.sphere(2)
    with refused(sh.errors.GeometryError, "triangles"):
        Windings(ball.vertices[ball.faces[1:]])


@pytest.mark.parametrize("rounding", [1e-5, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 1e-9, 1e-11, 1e-13])
@pytest.mark.parametrize("kind", ["row", "shared sides", "cells"])
def test_boxes_whose_common_sides_rounding_parts_are_one_solid(kind, rounding):
    """As files with five to thirteen digits make them, turned so that no coordinate is round."""
    rng = np.random.default_rng(3)
    if kind == "row":
        sizes = rng.uniform(0.3, 1.0, (4, 3))
        starts = np.column_stack([np.cumsum(sizes[:, 0]) - sizes[:, 0], rng.uniform(-0.1, 0.1, (4, 2))])
        volume = float(sizes.prod(axis=1).sum())
    elif kind == "shared sides":
        sizes, starts, volume = np.ones((2, 3)), np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]]), 1.4
    else:
        starts = 0.5 * np.array(list(np.ndindex(2, 2, 2)))[[0, 1, 2, 4, 5, 7]]
        sizes, volume = np.full((6, 3), 0.5), 0.75
    boxes = [trimesh.creation.box(bounds=[start, start + size]) for start, size in zip(starts, sizes, strict=True)]
    mesh = trimesh.util.concatenate(boxes)
    turned = mesh.vertices @ Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix().T
    vertices = turned + rounding * rng.uniform(-0.5, 0.5, turned.shape)
    solid = sh.complete((vertices, mesh.faces))
    points = rng.uniform(vertices.min(axis=0) - 0.1, vertices.max(axis=0) + 0.1, (4000, 3))
    assert solid.volume == pytest.approx(volume, rel=20 * rounding + 1e-9)
    assert (solid.inside(points) == (solid.distance(points) < 0)).all()
    if rounding <= 1e-8:  # beyond, slits between them are kept or contoured, with a warning
        kept = solid.surface()
        assert trimesh.Trimesh(kept.vertices, kept.faces).volume == pytest.approx(volume, rel=20 * rounding + 1e-9)


@pytest.mark.parametrize("rounding", [0.0, 1e-13, 1e-11, 1e-9, 1e-8, 3e-8])
def test_cells_whose_sides_are_apart_by_rounding_are_one_solid(rounding):
    """As files that hold each face as a mesh of its own: walls between cells are there twice."""
    rng = np.random.default_rng(5)
    cell = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]]).subdivide().triangles
    corners = np.concatenate([cell + cell_at for cell_at in np.ndindex(2, 2, 1)][:3])
    sides = sh.TriangleMesh(corners.reshape(-1, 3), np.arange(9 * len(corners) // 3).reshape(-1, 3))
    turned = sides.vertices @ Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix().T
    solid = sh.complete((turned + rounding * rng.uniform(-1, 1, turned.shape), sides.faces))
    assert solid.volume == pytest.approx(3, rel=20 * rounding + 1e-9)


def test_vertices_at_which_cones_touch_are_not_regular():
    cones = two_cones()
    features = FaceFeatures.of(cones.vertices, cones.faces)
    assert features.edge_regular.all()
    np.testing.assert_array_equal(features.vertex_regular, np.linalg.norm(features.vertices, axis=1) > 0)


@pytest.mark.parametrize("name", ["lids", "cut faces", "with a sheet"])
def test_what_is_saved_is_the_same_solid(tmp_path, name):
    solid = complete(SHAPES[name]())
    solid.save(tmp_path / "solid.npz")
    again, points = sh.read(tmp_path / "solid.npz"), points_around(solid)
    for one, other in zip(vars(solid.closest(points)).values(), vars(again.closest(points)).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(solid.inside(points), again.inside(points))


def test_files_that_hold_no_solid_are_refused(tmp_path):
    solid = complete(box((-1, -1, -1), (1, 1, 1)))
    solid.save(tmp_path / "solid.npz")
    arrays = dict(np.load(tmp_path / "solid.npz"))
    np.savez(tmp_path / "later.npz", **{**arrays, "solid_version": 99})
    np.savez(tmp_path / "short.npz", **{**arrays, "origins": arrays["origins"][1:]})
    with refused(sh.errors.FileFormatError, file="later.npz"):
        sh.read(tmp_path / "later.npz")
    with refused(sh.errors.FileFormatError, file="short.npz"):
        sh.read(tmp_path / "short.npz")


CHANGES = {
    "zeros": {"triangles": lambda a: a * 0},
    "one zero": {"triangles": lambda a: np.concatenate([a[:1] * 0, a[1:]])},
    "flat": {"triangles": lambda a: a * [1, 1, 0]},
    "huge": {"triangles": lambda a: a * 1e300},
    "tiny": {"triangles": lambda a: a * 1e-320},
    "nan": {"triangles": lambda a: a * np.nan},
    "whole numbers": {"triangles": lambda a: a.astype(int)},
    "nothing closes": {"closing": lambda a: a * 0},
    "none close": {"closing": lambda a: a[:0]},
    "open": {"closing": lambda a: a[:-3]},
    "huge closing": {"closing": lambda a: a * 1e300},
    "faces below": {"origins": lambda a: a - 7},
    "faces beyond": {"origins": lambda a: a + 7},
    "no confidence": {"confidence": lambda a: a * np.nan},
    "too confident": {"confidence": lambda a: a + 7},
    "numbers that bound": {"bounding": lambda a: a.astype(float)},
    "a single number": {"triangles": lambda a: np.float64(1.0)},
    "vertices": {"source_vertices": lambda a: np.where(a > 0.5, np.inf, a)},
    "source": {"source_faces": lambda a: a + 1000},
}


@functools.cache
def holed_ball(kind):
    solid = complete(samples.without_patches(samples.sphere(1), 1, 0.5))
    return solid if kind == "solid" else solid.field(resolution=8)


@pytest.mark.parametrize("new_key", [False, True], ids=["changed", "forged"])
@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("kind", ["solid", "field"])
def test_what_is_no_solid_is_not_believed(tmp_path, name, new_key, kind):
    """Whether arrays are changed behind the key that tells it, or with a key that fits."""
    path, prefix = tmp_path / "one.npz", "" if kind == "solid" else "solid_"
    holed_ball(kind).save(path)
    arrays = dict(np.load(path))
    for part, change in CHANGES[name].items():
        arrays[prefix + part] = np.asarray(change(arrays[prefix + part]))
    if new_key:
        arrays[prefix + "key"] = _key({k.removeprefix(prefix): v for k, v in arrays.items()})
    np.savez(path, **arrays)
    if new_key and name in ("one zero", "flat", "faces beyond", "open"):  # of which some make a solid of another kind
        try:
            again = (sh.read if kind == "solid" else sh.read_field)(path)
        except sh.errors.FileFormatError:
            return
        queried = again if kind == "solid" else again.solid
        assert np.isfinite(queried.distance(points_around(queried))).all()
        return
    with refused(sh.errors.FileFormatError, file="one.npz"):
        (sh.read if kind == "solid" else sh.read_field)(path)
