"""Holes closed one by one: everything given stays, lids are those of solids, sheets keep their outlines."""

from __future__ import annotations

import numpy as np
import pytest

import signedheat as sh
from shapes.bodies import box
from signedheat import samples
from signedheat.cli import main
from signedheat.shapes.inspection import inspect


def perforated(n: int = 20) -> sh.TriangleMesh:
    """A plane sheet of n × n squares in two triangles each, with two holes of about 12 and 28 squares."""
    x, y = np.meshgrid(range(n + 1), range(n + 1), indexing="ij")
    k = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (part.ravel() for part in (k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]))
    vertices = np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    away = [np.linalg.norm(vertices[faces].mean(axis=1)[:, :2] - at, axis=1) for at in ([6, 6], [14, 13])]
    return sh.TriangleMesh(vertices, faces[(away[0] > 2) & (away[1] > 3)])


def volume(mesh) -> float:
    corners = mesh.triangulation.vertices[mesh.triangulation.faces]
    return float(np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def is_kept(given, made) -> bool:
    """Whether what was given stands first, in its order, and new faces have the origin −1."""
    n = given.n_faces
    same = (made.vertices[: given.n_vertices] == given.vertices).all() and (made.faces[:n] == given.faces).all()
    return bool(same and (made.origins[:n] == np.arange(n)).all() and (made.origins[n:] == -1).all())


def test_a_sheet_keeps_its_outline_and_is_plane():
    sheet = perforated()
    made = sh.fill_holes(sheet)
    assert is_kept(sheet, made)
    assert made.face_areas.sum() == pytest.approx(400.0, rel=1e-12) and not made.vertices[:, 2].any()
    assert (made.face_area_vectors[:, 2] > 0).all()
    report = inspect(made)
    assert (report.borders, report.open_edges, report.degenerate_faces) == (1, 80, 0)
    assert len(made.filled) == 2 and [len(rim) for rim in made.left] == [80]


def test_only_holes_up_to_a_size_or_those_that_are_named():
    sheet = perforated()
    small = sh.fill_holes(sheet, largest=16.0)
    assert len(small.filled) == 1 and len(small.left) == 2
    named = sh.fill_holes(sheet, rims=small.left[1][3] if len(small.left[0]) == 80 else small.left[0][3])
    assert len(named.filled) == 1 and inspect(named).borders == 2
    assert small.face_areas.sum() + named.face_areas.sum() - sheet.face_areas.sum() == pytest.approx(400.0)
    outline = sh.fill_holes(sheet, rims=[0])
    assert len(outline.filled[0]) == 80 and len(outline.left) == 2
    with pytest.raises(sh.errors.SourceError, match="no boundary loop passes through vertex 220"):
        sh.fill_holes(sheet, rims=[220])
    assert sh.fill_holes(sheet, largest=1.0).n_faces == sheet.n_faces


@pytest.mark.parametrize("way", [1, -1])
def test_caps_of_a_ball(way):
    """Bent lids give the ball's volume back, flat ones that without the two caps, ⅓ π h² (3 − h) each."""
    ball, height = samples.sphere(4), 0.1
    faces = ball.faces[np.abs(ball.vertices[ball.faces].mean(axis=1)[:, 2]) < 1 - height][:, ::way]
    given = sh.TriangleMesh(ball.vertices, faces)
    bent, flat = (sh.fill_holes(given, lids=lids) for lids in ("bent", "flat"))
    for made in (bent, flat):
        report = inspect(made)
        assert is_kept(given, made) and report.is_closed and report.inconsistent_edges == 0
        assert len(made.filled) == 2 and not made.left
    assert way * volume(bent) == pytest.approx(volume(ball), rel=1e-3)
    caps = 2 * np.pi * height**2 * (3 - height) / 3
    assert way * volume(flat) == pytest.approx(volume(ball) - caps, rel=3e-3)


def test_new_faces_run_as_their_neighbours_do_even_where_these_disagree_elsewhere():
    ball = samples.without_patches(samples.sphere(4), 1, 0.3)
    made = sh.fill_holes(samples.with_flipped_faces(ball, 0.05, seed=1))
    ways = np.einsum("ij,ij->i", made.face_area_vectors, made.vertices[made.faces].mean(axis=1))[made.origins < 0]
    assert len(ways) and (ways > -1e-15).all()


def test_scraps_within_a_hole_belong_to_it():
    """Single faces in rings of lost ones, which hang together with the rest at their corners only."""
    ball = samples.sphere(4)
    neighbours = np.full((ball.n_faces, 3), -1)
    for one, other in ball.edges.pairs // 3:
        for a, b in ((one, other), (other, one)):
            neighbours[a, np.argmin(neighbours[a])] = b
    made = sh.fill_holes(sh.TriangleMesh(ball.vertices, np.delete(ball.faces, neighbours[[100, 2000, 4500]], axis=0)))
    assert inspect(made).is_closed and made.n_faces == ball.n_faces and not made.left


def test_polygons_stay_polygons():
    corners = box((0, 0, 0), (1, 1, 1)).vertices
    squares = [[k for k in range(len(corners)) if corners[k][axis] == side] for axis in range(3) for side in (0, 1)]
    quads = []
    for axis, square in zip([0, 0, 1, 1, 2, 2], squares, strict=True):
        around = corners[square] - corners[square].mean(axis=0)
        angles = np.arctan2(around[:, (axis + 2) % 3], around[:, (axis + 1) % 3])
        ordered = [square[k] for k in np.argsort(angles)]
        quads.append(ordered if corners[square[0]][axis] == 1 else ordered[::-1])
    given = sh.PolygonMesh(corners, quads[:-1])
    made = sh.fill_holes(given)
    assert [list(polygon) for polygon in made.polygons[:5]] == quads[:-1]
    assert made.origins.tolist() == [0, 1, 2, 3, 4, -1, -1] and volume(made) == pytest.approx(1.0)


def test_what_is_closed_or_a_single_face_is_left_alone():
    for given in (samples.sphere(2), sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])):
        made = sh.fill_holes(given)
        assert is_kept(given, made) and made.n_faces == given.n_faces and not made.filled
    with pytest.raises(sh.errors.GeometryError, match="no holes"):
        sh.fill_holes(sh.PointCloud([[0.0, 0, 0]]))
    with pytest.raises(sh.SignedHeatError, match="lids"):
        sh.fill_holes(samples.sphere(1), lids="round")


def test_on_the_command_line(tmp_path, capsys):
    perforated().save(tmp_path / "sheet.ply")
    command = ["fill", str(tmp_path / "sheet.ply"), "-o", str(tmp_path / "filled.ply")]
    assert main([*command, "--largest", "16"]) == 0
    assert "holes filled: 1" in capsys.readouterr().out
    assert main(command) == 0
    assert "holes filled: 2" in capsys.readouterr().out
    assert sh.read(tmp_path / "filled.ply").face_areas.sum() == pytest.approx(400.0)
    assert main([*command, "--rims", "220"]) == 1
    assert "vertex 220" in capsys.readouterr().err
