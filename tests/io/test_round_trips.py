"""What is written reads back the same, whatever it is."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import signedheat as sh
from shapes.strategies import in_space, meshes, seeds, surface_points


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("round-trips")


scales = st.sampled_from([1e-30, 1e-3, 1.0, 1e6, 1e30])


@pytest.mark.parametrize("ending", ["ply", "obj", "off", "vtp"])
@given(mesh=meshes, scale=scales)
def test_meshes(folder, ending, mesh, scale):
    mesh = sh.TriangleMesh(scale * mesh.vertices, mesh.faces)
    mesh.save(folder / f"mesh.{ending}")
    back = sh.read(folder / f"mesh.{ending}")
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    np.testing.assert_array_equal(back.faces, mesh.faces)


@given(mesh=meshes, scale=st.sampled_from([1e-3, 1.0, 1e6]))
def test_stl_keeps_facets_to_single_precision(folder, mesh, scale):
    corners = scale * mesh.vertices[mesh.faces]
    sh.TriangleMesh(scale * mesh.vertices, mesh.faces).save(folder / "mesh.stl")
    back = sh.read(folder / "mesh.stl")
    np.testing.assert_array_equal(back.vertices[back.faces], corners.astype(np.float32))


@pytest.mark.parametrize("ending", ["ply", "obj", "off", "vtp"])
@given(seed=seeds, sides=st.lists(st.integers(3, 7), min_size=1, max_size=6))
def test_polygons(folder, ending, seed, sides):
    rng = np.random.default_rng(seed)
    polygons = [rng.choice(12, n, replace=False).tolist() for n in [*sides, 4]]  # one that is no triangle
    mesh = sh.PolygonMesh(rng.normal(size=(12, 3)), polygons)
    mesh.save(folder / f"polygons.{ending}")
    back = sh.read(folder / f"polygons.{ending}")
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    assert [list(p) for p in back.polygons] == polygons


@pytest.mark.parametrize("ending", ["npz", "npy", "vti", "nrrd"])
@given(seed=seeds, shape=st.lists(st.integers(2, 6), min_size=2, max_size=3), scale=scales)
def test_fields_on_grids(folder, ending, seed, shape, scale):
    rng, dimension = np.random.default_rng(seed), len(shape)
    grid = sh.Grid(scale * rng.normal(size=dimension), scale * rng.uniform(0.1, 1, dimension), shape)
    field = sh.Field(grid, scale * rng.normal(size=shape))
    field.save(folder / f"field.{ending}")
    back = sh.read_field(folder / f"field.{ending}")
    np.testing.assert_array_equal(back.values, field.values)
    np.testing.assert_array_equal(back.domain.origin, grid.origin)
    np.testing.assert_array_equal(back.domain.spacing, grid.spacing)
    assert back.domain.shape == grid.shape


@given(data=st.data(), mesh=meshes, closed=st.booleans())
def test_curves(folder, data, mesh, closed):
    at = data.draw(surface_points(mesh, 3, 8))
    curve = sh.Curve(at.faces, at.barycentric, closed=closed)
    sh.io.write_curves(curve, folder / "curve.json", mesh)
    [back] = sh.io.read_curves(folder / "curve.json", mesh)
    assert back.closed == closed
    np.testing.assert_allclose(in_space(mesh, back), in_space(mesh, curve), atol=1e-12 * np.abs(mesh.vertices).max())
