"""Fields on grids, to files and back, exact to the last bit."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.io import read_field

FORMATS = ["npz", "npy", "nrrd", "vti"]


def field(dimension=3):
    shape = (3, 4, 5)[:dimension]
    grid = sh.Grid((0.1 + 0.2, -1e7 / 3, 1e-9)[:dimension], (0.1, 1 / 3, np.pi)[:dimension], shape)
    return sh.Field(grid, np.random.default_rng(1).normal(size=shape))


@pytest.mark.parametrize("ending", ["npz", "vti"])
def test_confidence_comes_back(tmp_path, ending):
    phi = field()
    told = sh.Field(phi.domain, phi.values, confidence=np.linspace(0, 1, phi.values.size).reshape(phi.values.shape))
    told.save(tmp_path / f"phi.{ending}")
    back = read_field(tmp_path / f"phi.{ending}")
    np.testing.assert_array_equal(back.values, phi.values)
    np.testing.assert_array_equal(back.confidence, told.confidence)
    with refused(sh.errors.GeometryError, element="confidence"):
        sh.Field(phi.domain, phi.values, confidence=np.ones(3))


def test_npz_needs_no_pickle_and_says_what_it_holds(tmp_path):
    field().save(tmp_path / "phi.npz")
    with np.load(tmp_path / "phi.npz", allow_pickle=False) as file:
        assert set(file) == {"values", "origin", "spacing", "convention"}
        assert "negative inside" in str(file["convention"])


def test_npy_has_its_transform_beside_it(tmp_path):
    field().save(tmp_path / "phi.npy")
    about = json.loads((tmp_path / "phi.json").read_text())
    assert about["spacing"] == field().domain.spacing.tolist()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["phi.json", "phi.npy"]


@pytest.mark.filterwarnings("ignore")
def test_vtk_reads_our_vti_with_the_same_axes(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    phi = field()
    phi.save(tmp_path / "phi.vti")
    image = pyvista.read(tmp_path / "phi.vti")
    values = np.asarray(image.point_data["signed_distance"])
    nodes = phi.domain.points.reshape(-1, 3)
    order = [image.FindPoint(node) for node in nodes]
    np.testing.assert_array_equal(values[order], phi.values.ravel())
    np.testing.assert_allclose(np.asarray(image.points)[order], nodes, rtol=1e-14, atol=1e-12)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("mode", ["Ascii", "Binary", "Appended"])
@pytest.mark.parametrize("compressor", ["None", "ZLib"])
def test_we_read_vti_of_vtk(tmp_path, mode, compressor):
    pyvista = pytest.importorskip("pyvista")
    from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

    phi = field()
    image = pyvista.ImageData(dimensions=phi.domain.shape, spacing=phi.domain.spacing, origin=phi.domain.origin)
    image.point_data["values"] = phi.values.ravel(order="F")
    writer = vtkXMLImageDataWriter()
    writer.SetInputData(image)
    writer.SetFileName(str(tmp_path / "a.vti"))
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.Write()
    back = read_field(tmp_path / "a.vti")
    np.testing.assert_array_equal(back.values, phi.values)
    np.testing.assert_allclose(back.domain.spacing, phi.domain.spacing, rtol=1e-5)


def test_nrrd_is_read_by_its_own_library_with_the_same_axes(tmp_path):
    nrrd = pytest.importorskip("nrrd")
    phi = field()
    phi.save(tmp_path / "phi.nrrd")
    values, header = nrrd.read(str(tmp_path / "phi.nrrd"), index_order="F")
    np.testing.assert_array_equal(values, phi.values)
    np.testing.assert_array_equal(np.diag(header["space directions"]), phi.domain.spacing)


def test_nrrd_along_turned_axes_is_refused(tmp_path):
    nrrd = pytest.importorskip("nrrd")
    turned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
    header = {"space dimension": 3, "space directions": turned, "space origin": np.zeros(3)}
    nrrd.write(str(tmp_path / "turned.nrrd"), field().values, header, index_order="F")
    with refused(sh.errors.FileFormatError):
        read_field(tmp_path / "turned.nrrd")


@pytest.mark.parametrize("ending", FORMATS)
def test_truncated_fields_are_refused_by_name(tmp_path, ending):
    phi = field()
    phi.save(tmp_path / f"phi.{ending}")
    data = (tmp_path / f"phi.{ending}").read_bytes()
    for length in (0, 10, len(data) // 2, len(data) - 60):
        (tmp_path / f"phi.{ending}").write_bytes(data[:length])
        with refused(sh.errors.FileFormatError, file=f"phi.{ending}"):
            read_field(tmp_path / f"phi.{ending}")


def test_files_that_hold_no_field_are_refused(tmp_path):
    np.savez(tmp_path / "other.npz", a=1)
    np.savez(tmp_path / "pickled.npz", values=np.array([{}]), origin=[0], spacing=[1])
    np.save(tmp_path / "alone.npy", np.zeros((2, 2)))
    np.savez(tmp_path / "spacing.npz", values=np.zeros((2, 2)), origin=[0, 0], spacing=[1, -1])
    np.savez(tmp_path / "words.npz", values=np.array([["a", "b"]] * 2), origin=[0, 0], spacing=[1, 1])
    for name in ("other.npz", "pickled.npz", "spacing.npz", "words.npz", "missing.vti", "field.stl"):
        with refused(sh.errors.FileFormatError, file=name):
            read_field(tmp_path / name)
    with refused(sh.errors.FileFormatError):
        read_field(tmp_path / "alone.npy")


def test_fields_of_four_dimensions_fit_npz_only(tmp_path):
    phi = sh.Field(sh.Grid((0, 0, 0, 0), 1.0, (2, 3, 2, 4)), np.arange(48.0).reshape(2, 3, 2, 4))
    phi.save(tmp_path / "phi.npz")
    np.testing.assert_array_equal(read_field(tmp_path / "phi.npz").values, phi.values)
    with refused(sh.errors.FileFormatError):
        phi.save(tmp_path / "phi.vti")


@pytest.mark.parametrize("places", [[[-1, 0, 0]], [[0, 0, 99]], [[0.0, 0.0, 0.0]], [[0, 0]], [0, 0, 0]])
def test_bands_whose_blocks_lie_nowhere(tmp_path, places):
    band = sh.complete(sh.samples.sphere(1)).field(spacing=0.2, band=0.2)
    band.save(tmp_path / "band.npz")
    with np.load(tmp_path / "band.npz") as file:
        arrays = dict(file)
    arrays["places"] = np.array(places, dtype=np.array(places).dtype)
    np.savez(tmp_path / "band.npz", **arrays)
    with refused(sh.errors.FileFormatError):
        read_field(tmp_path / "band.npz")


def test_bands_in_another_order_of_bytes(tmp_path):
    band = sh.complete(sh.samples.sphere(1)).field(spacing=0.2, band=0.2)
    band.save(tmp_path / "band.npz")
    with np.load(tmp_path / "band.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "band.npz", **arrays | {"values": arrays["values"].astype(">f8")})
    points = band.domain.points.reshape(-1, 3)[::50]
    np.testing.assert_array_equal(read_field(tmp_path / "band.npz")(points), band(points))


@pytest.mark.parametrize("version", [np.nan, np.inf, -1, "one", [1, 2]])
def test_solids_of_odd_versions(tmp_path, version):
    sh.complete(sh.samples.sphere(1)).save(tmp_path / "solid.npz")
    with np.load(tmp_path / "solid.npz") as file:
        arrays = dict(file)
    np.savez(tmp_path / "solid.npz", **arrays | {"solid_version": version})
    with refused(sh.errors.FileFormatError):
        sh.read(tmp_path / "solid.npz")
