"""Images with turned axes, which `volume` writes, can be inspected, contoured and looked at."""

import json

import numpy as np
import pytest

import signedheat as sh
from signedheat import samples
from signedheat.cli import main
from signedheat.io.image_files import write_nrrd

pytestmark = pytest.mark.usefixtures("forked_parsers")

CENTER, RADIUS = np.array([12.0, 10.0, 8.0]), 6.0
TURN = np.array([[np.cos(0.4), -np.sin(0.4), 0], [np.sin(0.4), np.cos(0.4), 0], [0, 0, 1]]) * [-1, 1, 1]
ORIGIN = np.array([10.0, -5.0, 3.0])


@pytest.fixture
def mask(tmp_path):
    """A ball of voxels with the label 3, and one voxel with another, on axes that are turned and mirrored."""
    labels = np.zeros((25, 21, 17), dtype=np.uint8)
    labels[np.linalg.norm(np.moveaxis(np.indices(labels.shape), 0, -1) - CENTER, axis=-1) < RADIUS] = 3
    labels[0, 0, 0] = 1
    path = tmp_path / "mask.nrrd"
    write_nrrd(path, labels, TURN, ORIGIN, "left-posterior-superior")
    return path


def test_info_lists_labels_and_tells_where_the_image_is(mask, capsys):
    assert main(["info", str(mask), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "image of labels" and told["labels"] == [0, 1, 3]
    assert sum(told["voxels"]) == 25 * 21 * 17 and told["space"] == "left-posterior-superior"
    assert np.allclose(np.reshape(told["axes"], (3, 3)).T, TURN) and told["origin"] == ORIGIN.tolist()


@pytest.mark.parametrize("ending", [".nrrd", ".npy"])
def test_labels_along_the_axes_are_labels_too(ending, tmp_path, capsys):
    path = tmp_path / f"labels{ending}"
    labels = np.pad(np.full((4, 4, 4), 2, dtype=np.uint8), 2)
    labels[3, 3, 3] = 3
    if ending == ".npy":
        np.save(path, labels)
    else:
        write_nrrd(path, labels, np.eye(3), np.zeros(3), None)
    assert main(["info", str(path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "image of labels" and told["labels"] == [0, 2, 3] and told["voxels"] == [448, 63, 1]
    assert main(["view", str(path), "-o", str(tmp_path / "labels.png")]) == 0
    assert main(["contour", str(path), "1", "-o", str(tmp_path / "labels.stl")]) == 0
    assert sh.read(tmp_path / "labels.stl").bounds == pytest.approx(np.array([[1.5] * 3, [5.5] * 3]), abs=0.5)


def test_fields_of_images_are_contoured_in_the_world(mask, tmp_path, capsys):
    field = str(tmp_path / "distance.nrrd")
    assert main(["volume", str(mask), "--label", "3", "-o", field]) == 0
    assert main(["info", field, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["kind"] == "image of a field"
    assert main(["contour", field, "2", "-o", str(tmp_path / "grown.stl")]) == 0
    surface = sh.read(tmp_path / "grown.stl")
    away = np.linalg.norm(surface.vertices - (ORIGIN + TURN @ CENTER), axis=1)
    assert away == pytest.approx(RADIUS + 2, abs=1.0)  # voxels: half a diagonal
    assert surface.to_trimesh().volume > 0  # outside is outside, though the axes are mirrored


def test_masks_are_contoured(tmp_path, capsys):
    """Halfway between the nodes of voxels inside and outside."""
    np.save(tmp_path / "mask.npy", np.pad(np.ones((4, 4, 4), bool), 2))
    assert main(["contour", str(tmp_path / "mask.npy"), "0.5", "-o", str(tmp_path / "out.ply")]) == 0
    np.testing.assert_allclose(sh.read(tmp_path / "out.ply").bounds, [[1.5] * 3, [5.5] * 3])


def test_masks_and_fields_of_images_are_looked_at(mask, tmp_path):
    for name in ("mask.png", "mask.pdf"):
        assert main(["view", str(mask), "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 3000


def test_damaged_images_are_refused(tmp_path, capsys):
    (tmp_path / "bad.nrrd").write_bytes(b"NRRD0004\nnothing\n")
    assert main(["info", str(tmp_path / "bad.nrrd")]) == 1
    assert "bad.nrrd" in capsys.readouterr().err


def test_nifti(mask, tmp_path, capsys):
    pytest.importorskip("nibabel")
    field = str(tmp_path / "distance.nii.gz")
    assert main(["volume", str(mask), "--label", "3", "-o", field]) == 0
    capsys.readouterr()
    assert main(["info", field, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["space"] == "right-anterior-superior"


@pytest.fixture
def voxels(tmp_path):
    """The ball with axes along x, y, z, as an array."""
    labels = np.linalg.norm(np.moveaxis(np.indices((25, 21, 17)), 0, -1) - CENTER, axis=-1) < RADIUS
    np.save(tmp_path / "voxels.npy", labels)
    return tmp_path / "voxels.npy"


def test_a_band_fills_the_image(voxels, tmp_path):
    for name in ("band.nrrd", "band.npz"):
        assert main(["volume", str(voxels), "--band", "3", "-o", str(tmp_path / name)]) == 0
        field = sh.read_field(tmp_path / name)
        assert field.values.shape == (25, 21, 17)
        assert field(np.stack([CENTER, CENTER + np.array([RADIUS + 2, 0, 0])])) == pytest.approx([-RADIUS, 2], abs=1.0)


def test_images_are_placed_as_the_options_say(voxels, tmp_path, capsys):
    scaled, moved, made = (str(tmp_path / name) for name in ("scaled.npz", "moved.npz", "made.stl"))
    assert main(["volume", str(voxels), "--units", "cm:mm", "-o", scaled]) == 0
    assert sh.read_field(scaled).domain.upper.tolist() == [240.0, 200.0, 160.0]
    matrix = [str(number) for number in (1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7)]
    assert main(["volume", str(voxels), "--transform", *matrix, "-o", moved]) == 0
    assert sh.read_field(moved).domain.origin.tolist() == [5.0, 6.0, 7.0]
    assert main(["watertight", str(voxels), "--units", "cm:mm", "-o", made]) == 0
    assert np.ptp(sh.read(made).vertices, axis=0) == pytest.approx(20 * RADIUS, abs=20)
    sheared = [str(number) for number in (1, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)]
    assert main(["volume", str(voxels), "--transform", *sheared, "-o", moved]) == 1
    assert "not at right angles" in capsys.readouterr().err


def test_labels_are_those_of_images(tmp_path, capsys):
    samples.sphere(1).save(tmp_path / "ball.ply")
    assert main(["volume", str(tmp_path / "ball.ply"), "--label", "3", "-o", str(tmp_path / "ball.npz")]) == 1
    assert "only images have labels" in capsys.readouterr().err
