"""Images of labels: turned and mirrored axes, spaces, NIfTI, and distances that end up where the image is."""

import gzip
import json

import nrrd
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat.cli import main
from signedheat.shapes.inspection import inspect
from signedheat.solids.completion import complete

pytestmark = pytest.mark.usefixtures("forked_parsers")

nibabel = pytest.importorskip("nibabel")

CENTER = np.array([6.0, 7.0, 5.0])
STEPS = np.array([0.5, 0.7, 0.6])
RADIUS = 2.0
TURN = np.linalg.qr(np.array([[2.0, 1, 0.3], [-0.5, 1.5, 1], [0.2, -1, 2]]))[0]
AXES = {
    "straight": np.diag(STEPS),
    "flipped": np.diag([-1.0, -1, 1]) @ np.diag(STEPS),
    "mirrored": np.diag([1.0, -1, 1]) @ np.diag(STEPS),
    "permuted": np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]) @ np.diag(STEPS),
    "turned": TURN @ np.diag(STEPS),
}
ORIGIN = np.array([10.0, -20.0, 5.0])


def test_an_image_is_taken_for_a_shape_in_the_world():
    image = sh.io.LabelImage(np.pad(np.full((6, 6, 6), 7), 3), AXES["turned"], ORIGIN)
    middle = ORIGIN + AXES["turned"] @ [5.5, 5.5, 5.5]
    solid = sh.complete(image)
    assert solid.inside(middle) and not solid.inside(ORIGIN)
    assert sh.signed_distance(image, resolution=16)(middle) == solid.distance(middle)
    assert repr(image) == "LabelImage(12 × 12 × 12 voxels of [0.5, 0.7, 0.6], the labels 0, 7)"


@pytest.fixture(scope="module")
def labels():
    """A ball of label 3 in a sea of 7 with an island of 1."""
    places = np.stack(np.meshgrid(*(np.arange(n) for n in (17, 15, 14)), indexing="ij"), axis=-1)
    result = np.full(places.shape[:3], 0, dtype=np.int16)
    result[np.linalg.norm((places - CENTER) * STEPS, axis=-1) < RADIUS] = 3
    result[14:, 12:, 11:] = 1
    return result


def write_nrrd(path, labels, axes, space="left-posterior-superior"):
    header = {"space": space, "space directions": axes.T, "space origin": ORIGIN, "kinds": ["domain"] * 3}
    nrrd.write(str(path), labels, header, index_order="F")


@pytest.mark.parametrize("kind", AXES)
def test_fields_keep_directions_origin_and_space(tmp_path, labels, capsys, kind):
    mask, output = tmp_path / "mask.nrrd", tmp_path / "phi.nrrd"
    write_nrrd(mask, labels, AXES[kind])
    assert main(["volume", str(mask), "--label", "3", "-o", str(output), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    values, header = nrrd.read(str(output), index_order="F")
    np.testing.assert_allclose(header["space directions"], AXES[kind].T, atol=1e-12)
    np.testing.assert_allclose(header["space origin"], ORIGIN, atol=1e-12)
    assert header["space"] == told["image"]["space"] == "left-posterior-superior"
    assert values.shape == labels.shape
    assert ((values < 0) == (labels == 3)).all()
    places = np.stack(np.meshgrid(*(np.arange(n) for n in labels.shape), indexing="ij"), axis=-1)
    exact = np.linalg.norm((places - CENTER) * STEPS, axis=-1) - RADIUS
    assert np.abs(values - exact).max() < np.linalg.norm(STEPS)  # the boundary of voxels is off by half of that


@pytest.mark.parametrize("kind", AXES)
def test_offsets_lie_where_the_image_does(tmp_path, labels, kind):
    mask, output = tmp_path / "mask.nrrd", tmp_path / "shell.ply"
    write_nrrd(mask, labels, AXES[kind])
    assert main(["offset", str(mask), "1", "--label", "3", "-o", str(output), "--quiet"]) == 0
    surface = sh.read(output)
    center = AXES[kind] @ CENTER + ORIGIN
    radii = np.linalg.norm(surface.vertices - center, axis=1)
    assert radii.mean() == pytest.approx(RADIUS + 1, abs=0.3) and np.ptp(radii) < 1
    assert inspect(surface).is_closed
    volume = np.einsum("ij,ij->", surface.vertices[surface.faces[:, 0]] - center, surface.face_area_vectors) / 3
    assert volume > 0  # outside stays outside, in mirrored images too


@pytest.mark.parametrize("ending", [".nii", ".nii.gz"])
@pytest.mark.parametrize("kind", ["straight", "mirrored", "turned"])
def test_nifti_there_and_back(tmp_path, labels, kind, ending):
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = AXES[kind], ORIGIN
    path, output = tmp_path / f"mask{ending}", tmp_path / f"phi{ending}"
    nibabel.save(nibabel.Nifti1Image(labels, affine), path)
    assert main(["volume", str(path), "--label", "3", "-o", str(output), "--quiet"]) == 0
    written = nibabel.load(output)
    np.testing.assert_allclose(written.affine, affine, atol=1e-5)
    assert ((np.asarray(written.dataobj) < 0) == (labels == 3)).all()


def test_spaces_are_turned_between_formats(tmp_path, labels):
    mask = tmp_path / "mask.nrrd"
    write_nrrd(mask, labels, AXES["turned"])
    image = sh.io.read_labels(mask)
    field = sh.Field(image.grid, np.ones(image.grid.shape))
    image.save(field, tmp_path / "phi.nii")
    affine = nibabel.load(tmp_path / "phi.nii").affine
    flip = np.diag([-1.0, -1, 1])  # left-posterior-superior to right-anterior-superior
    np.testing.assert_allclose(affine[:3, :3], flip @ AXES["turned"], atol=1e-5)
    np.testing.assert_allclose(affine[:3, 3], flip @ ORIGIN, atol=1e-4)
    back = sh.io.read_labels(tmp_path / "phi.nii")
    assert back.space == "right-anterior-superior"
    with pytest.raises(sh.errors.FileFormatError):
        image.save(field, tmp_path / "phi.vti")  # which has no place for turned axes
    odd = sh.io.LabelImage(image.labels, image.axes, image.origin, "scanner-xyz")
    with pytest.raises(sh.errors.FileFormatError):
        odd.save(field, tmp_path / "phi.nii")


def test_straight_images_can_be_saved_as_any_field(tmp_path, labels):
    mask, output = tmp_path / "mask.nrrd", tmp_path / "phi.vti"
    write_nrrd(mask, labels, AXES["straight"])
    assert main(["volume", str(mask), "--label", "3", "-o", str(output), "--quiet"]) == 0
    field = sh.read_field(output)
    np.testing.assert_allclose(field.domain.origin, ORIGIN)
    assert field([ORIGIN + STEPS * CENTER])[0] < -1.2


def test_a_grid_of_ones_own_spacing_lies_in_the_same_place(tmp_path, labels):
    mask, output = tmp_path / "mask.nrrd", tmp_path / "phi.nrrd"
    write_nrrd(mask, labels, AXES["turned"])
    options = ["--spacing", "0.4", "--padding", "1", "--quiet"]
    assert main(["volume", str(mask), "--label", "3", "-o", str(output), *options]) == 0
    image = sh.io.read_labels(output)
    np.testing.assert_allclose(image.spacing, 0.4)
    index = np.linalg.solve(image.axes, AXES["turned"] @ CENTER + ORIGIN - image.origin)
    near = np.rint(index).astype(int)
    assert image.labels[tuple(near)] < -1.2
    assert image.labels.argmin() == np.ravel_multi_index(near, image.labels.shape) or np.ptp(near - index) < 1


def test_which_labels_there_are(tmp_path, labels, capsys):
    mask = tmp_path / "mask.nrrd"
    write_nrrd(mask, labels, AXES["straight"])
    assert main(["volume", str(mask), "-o", str(tmp_path / "phi.nrrd")]) == 1
    said = capsys.readouterr().err
    assert "0, 1, 3" in said and "--label" in said
    assert main(["volume", str(mask), "--label", "9", "-o", str(tmp_path / "phi.nrrd")]) == 1
    assert "no voxel" in capsys.readouterr().err
    write_nrrd(mask, (labels == 3).astype(np.uint8), AXES["straight"])
    assert main(["volume", str(mask), "-o", str(tmp_path / "phi.nrrd"), "--quiet"]) == 0


def test_damaged_and_skewed_images_are_refused(tmp_path, labels):
    skewed = AXES["straight"].copy()
    skewed[0, 1] = 0.3
    write_nrrd(tmp_path / "skewed.nrrd", labels, skewed)
    with pytest.raises(sh.errors.FileFormatError) as caught:
        sh.io.read_labels(tmp_path / "skewed.nrrd")
    assert "resample" in caught.value.remedy
    nibabel.save(nibabel.Nifti1Image(labels, np.eye(4)), tmp_path / "whole.nii")
    whole = (tmp_path / "whole.nii").read_bytes()
    for name, data in {
        "cut.nii": whole[:2000],
        "head.nii": whole[:100],
        "cut.nii.gz": gzip.compress(whole)[:-60],
        "noise.nii": bytes(range(256)) * 40,
    }.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(sh.errors.SignedHeatError) as caught:
            sh.io.read_labels(tmp_path / name)
        assert caught.value.path == str(tmp_path / name)
    whole = (tmp_path / "skewed.nrrd").read_bytes()
    begin = whole.index(b"space origin: (")
    end = whole.index(b"\n", begin)
    (tmp_path / "origin.nrrd").write_bytes(whole[:begin] + b"space origin: (1,2)" + whole[end:])
    with pytest.raises(sh.errors.FileFormatError) as caught:
        sh.io.read_labels(tmp_path / "origin.nrrd")
    assert "origin" in str(caught.value)
    with pytest.raises(sh.errors.FileFormatError):
        sh.io.read_labels(tmp_path / "labels.stl")


def test_what_is_mended_in_headers_is_not_told(tmp_path, labels, caplog):
    data = bytearray(nibabel.Nifti1Image(labels, np.eye(4)).to_bytes())
    data[252:254] = np.array([77], "<i2").tobytes()  # a code of coordinates that does not exist
    (tmp_path / "mask.nii").write_bytes(bytes(data))
    assert np.array_equal(sh.io.read_labels(tmp_path / "mask.nii").labels, labels)
    assert not caplog.records  # they would go to standard error


@pytest.mark.parametrize("kind", AXES)
def test_the_boundary_of_voxels_goes_to_the_world(labels, kind):
    image = sh.io.LabelImage(labels, AXES[kind], ORIGIN)
    surface = image.to_world(image.surface(3))
    middle = (surface.vertices.min(axis=0) + surface.vertices.max(axis=0)) / 2
    if kind != "turned":
        np.testing.assert_allclose(middle, AXES[kind] @ CENTER + ORIGIN, atol=0.51 * STEPS.max())
    assert complete(surface, as_oriented=True).inside(middle[None])[0]  # also where axes are mirrored
    corners = surface.vertices[surface.faces] - middle
    assert np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0


@pytest.mark.parametrize(
    ("labels", "axes", "origin"),
    [
        (np.ones((2, 2, 2), int), [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], np.zeros(3)),
        (np.ones((2, 2, 2), int), np.zeros((3, 3)), np.zeros(3)),
        (np.ones((2, 2, 2), int), np.eye(3), [0, 0, np.nan]),
        (np.ones((2, 2, 2), int), np.eye(4), np.zeros(3)),
        (np.ones((2, 2), int), np.eye(3), np.zeros(3)),
        (np.full((2, 2, 2), "a"), np.eye(3), np.zeros(3)),
    ],
)
def test_images_without_right_angles_or_places_are_refused(labels, axes, origin):
    with refused(sh.errors.GeometryError):
        sh.io.LabelImage(labels, axes, origin)


def test_images_of_lists_are_images():
    assert sh.io.LabelImage([[[0, 1]]], np.eye(3).tolist(), [0, 0, 0]).boundary.n_faces > 0
