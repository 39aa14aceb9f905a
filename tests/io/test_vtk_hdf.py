"""VTKHDF files, as VTK itself reads them."""

import numpy as np
import pytest

import signedheat as sh
from shapes.grid_cases import sphere
from signedheat.tets.tetrahedralize import tetrahedralize

pytest.importorskip("h5py")
VALUES = "signed_distance"


def read_by_vtk(path):
    pyvista = pytest.importorskip("pyvista")
    hdf = pytest.importorskip("vtkmodules.vtkIOHDF")
    reader = hdf.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.Update()
    return pyvista.wrap(reader.GetOutputDataObject(0))


@pytest.mark.parametrize("shape", [(4, 5, 6), (4, 5)])
def test_fields_on_grids(tmp_path, shape):
    values = np.random.default_rng(0).normal(size=shape)
    phi = sh.GridField(sh.Grid((1.0, 2.0, 3.0)[: len(shape)], (0.1, 0.2, 0.3)[: len(shape)], shape), values)
    phi.save(tmp_path / "phi.vtkhdf")
    back = read_by_vtk(tmp_path / "phi.vtkhdf")
    places = [phi.grid.points[..., axis].ravel(order="F") for axis in range(len(shape))]
    np.testing.assert_allclose(back.points[:, : len(shape)], np.stack(places, axis=1), rtol=1e-15)
    np.testing.assert_array_equal(back.point_data[VALUES], values.ravel(order="F"))


def test_surfaces_with_values(tmp_path):
    ball = sphere(200)
    field = sh.VertexField(ball, ball.vertices[:, 0] ** 2)
    field.save(tmp_path / "phi.vtkhdf")
    back = read_by_vtk(tmp_path / "phi.vtkhdf")
    np.testing.assert_array_equal(back.points, ball.vertices)
    np.testing.assert_array_equal(back.faces.reshape(-1, 4)[:, 1:], ball.faces)
    np.testing.assert_array_equal(back.point_data[VALUES], field.values)


def test_polygons_and_oriented_points(tmp_path):
    mesh = sh.PolygonMesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 2, 0]], [[0, 1, 2, 3], [3, 2, 4]])
    mesh.save(tmp_path / "mesh.vtkhdf")
    assert read_by_vtk(tmp_path / "mesh.vtkhdf").faces.tolist() == [4, 0, 1, 2, 3, 3, 3, 2, 4]
    cloud = sh.PointCloud(mesh.vertices, np.tile([0.0, 0.0, 1.0], (5, 1)))
    cloud.save(tmp_path / "cloud.vtkhdf")
    back = read_by_vtk(tmp_path / "cloud.vtkhdf")
    np.testing.assert_array_equal(back.points, cloud.points)
    np.testing.assert_array_equal(back.point_data["Normals"], cloud.normals)


def test_fields_on_tets(tmp_path):
    mesh = tetrahedralize(sphere(200), resolution=5)
    sh.TetField(mesh, mesh.vertices[:, 2]).save(tmp_path / "phi.vtkhdf")
    back = read_by_vtk(tmp_path / "phi.vtkhdf")
    np.testing.assert_array_equal(back.cells_dict[10], mesh.tets)
    np.testing.assert_array_equal(back.point_data[VALUES], mesh.vertices[:, 2])
    with pytest.raises(sh.errors.FileFormatError):
        sh.load_field(tmp_path / "phi.vtkhdf")
