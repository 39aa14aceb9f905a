"""Walls and gaps whose widths are known."""

import json

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples
from signedheat.cli import main
from signedheat.io.ply import read_ply
from signedheat.solids.thickness import Thickness, widths


def slab(lower, upper, n=1):
    """A box of 12 n² triangles, facing outwards."""
    u, v = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    corner = np.stack([u.ravel(), v.ravel()], axis=1)[:, None] + [[0, 0], [1, 0], [1, 1], [0, 1]]
    square = np.concatenate([corner / n, np.zeros((n * n, 4, 1))], axis=2)
    sides = []
    for axis in range(3):
        for end in (0, 1):
            side = np.roll(square + np.array([0, 0, end]), axis, axis=2)
            sides.append(side if end else side[:, ::-1])
    quads = np.concatenate(sides)
    triangles = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    vertices = np.asarray(lower) + triangles * (np.asarray(upper, dtype=float) - lower)
    return sh.TriangleMesh(vertices, np.arange(len(vertices)).reshape(-1, 3))


@pytest.mark.parametrize("n", [1, 12])
def test_two_slabs(n):
    """All walls of each slab count, the gap between them too; how fine the triangles are does not matter."""
    found = widths(samples.union(slab((0, 0, 0), (2, 2, 0.1), n), slab((0, 0, 0.3), (2, 2, 0.35), n)))
    assert found.wall == pytest.approx(0.05)
    assert (found.gap, found.typical_gap) == pytest.approx((0.2, 0.2))
    assert found.spacing == pytest.approx(0.025)


def test_widths_do_not_depend_on_where_and_how_large():
    mesh = samples.torus()
    found = widths(mesh)
    turned, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    turned *= np.sign(np.linalg.det(turned))
    for scale in (1e-3, 1e30):
        other = widths(sh.TriangleMesh(scale * mesh.vertices @ turned.T, mesh.faces))
        assert other.wall == pytest.approx(scale * found.wall, rel=0.02)
        assert other.gap == pytest.approx(scale * found.gap, rel=0.1)


def test_a_ball_has_no_gaps_and_a_cavity_no_body():
    ball = widths(samples.sphere(4, radius=0.5))
    assert ball.gap is None
    assert ball.wall == pytest.approx(1.0, rel=0.005)
    inner = samples.sphere(4, radius=0.9)
    shell = widths(samples.union(samples.sphere(4), sh.TriangleMesh(inner.vertices, inner.faces[:, ::-1])))
    assert shell.wall == pytest.approx(0.1, rel=0.02)
    assert shell.typical_gap == pytest.approx(1.8, rel=0.005)


def test_folds_copies_and_rounding_are_no_gaps():
    """Faces that share a vertex, and doubled ones that single precision has moved apart."""
    crumpled = widths(samples.with_noise(samples.sphere(4), 0.02, seed=1))
    assert min(crumpled.wall, crumpled.gap) > 0.02
    slabs = samples.union(slab((0, 0, 0), (2, 2, 0.1), 3), slab((0, 0, 0.3), (2, 2, 0.35), 3))
    noise = np.random.default_rng(0).normal(0, 1e-7, slabs.vertices.shape)
    found = widths(samples.union(slabs, sh.TriangleMesh(slabs.vertices + noise, slabs.faces)))
    assert (found.wall, found.gap) == pytest.approx((0.05, 0.2), rel=1e-4)


def test_sheets_have_neither():
    flat = sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert widths(flat).spacing is None


def middles(found):
    return found.mesh.vertices[found.mesh.faces].mean(axis=1)


def test_a_slab_is_as_thick_everywhere_up_to_its_edges():
    found = sh.wall_thickness(box((-1, -1, 0), (1, 1, 0.1)), resolution=16)
    across = np.abs(found.mesh.face_area_vectors).argmax(axis=1)
    np.testing.assert_allclose(found.values, np.where(across == 2, 0.1, 2.0), rtol=1e-9)
    assert found.thinnest[0] == pytest.approx(0.1)
    assert found.below(0.2) == pytest.approx(8 / 8.8)
    assert set(found.origins) == set(range(12))


def test_balls_converge_to_their_diameter():
    errors = [np.abs(sh.wall_thickness(samples.sphere(k), resolution=16).values - 2).max() for k in (3, 4)]
    assert errors[0] < 0.02 and errors[1] < 0.3 * errors[0]  # of the second order in the size of faces
    plate = sh.wall_thickness(box((0, 0, 0), (4, 4, 1)), resolution=8)
    assert repr(plate) == f"Thickness({len(plate.values)} faces, 1 to 4, median 1)"


def test_a_tube_has_its_wall_and_a_wedge_tapers():
    angles = np.linspace(0, 2 * np.pi, 97)[:-1]
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    rims = [np.column_stack([r * ring, np.full(96, z)]) for r in (1.0, 0.8) for z in (0.0, 1.0)]
    a, b = np.arange(96), np.roll(np.arange(96), -1)
    quads = [(0, 1), (3, 2), (2, 0), (1, 3)]  # outside, inside, bottom, top
    faces = [np.concatenate([np.column_stack([96 * p + a, 96 * p + b, 96 * q + b]),
                             np.column_stack([96 * p + a, 96 * q + b, 96 * q + a])]) for p, q in quads]  # fmt: skip
    tube = sh.wall_thickness(sh.TriangleMesh(np.concatenate(rims), np.concatenate(faces)), resolution=32)
    round_ones = np.abs(tube.mesh.face_area_vectors[:, 2]) < 1e-9
    np.testing.assert_allclose(tube.values[round_ones], 0.2, rtol=0.01)  # facets: 1 − cos(π / 96)
    np.testing.assert_allclose(tube.values[~round_ones], 1.0, rtol=1e-9)

    slope = np.deg2rad(20)
    corners = np.array([[0, 0, 0], [3, 0, 0], [3, 0, 3 * np.tan(slope)]])
    corners = np.concatenate([corners, corners + np.array([0, 1, 0])])
    faces = [[0, 1, 2], [3, 5, 4], [0, 3, 4], [0, 4, 1], [0, 2, 5], [0, 5, 3], [1, 4, 5], [1, 5, 2]]
    wedge = sh.wall_thickness(sh.TriangleMesh(corners, faces))
    places = middles(wedge)
    chosen = (np.abs(places[:, 2]) < 1e-12) & (places[:, 0] < 1)
    assert chosen.sum() > 100
    np.testing.assert_allclose(wedge.values[chosen], 2 * places[chosen, 0] * np.tan(slope / 2), rtol=1e-9)


def test_what_touches_a_wall_is_the_nearest_place_of_brute_force():
    """Every face tried for every place; with faces turned and missing, the same but near holes."""
    torus = samples.torus(1.0, 0.4, n_around=48, n_across=24)
    found = sh.wall_thickness(torus, resolution=8)
    triangles = torus.vertices[torus.faces]
    weights = np.random.default_rng(0).dirichlet(np.ones(3), 30)
    targets = np.einsum("wk,mki->mwi", weights, triangles)
    flat = torus.face_area_vectors / np.linalg.norm(torus.face_area_vectors, axis=1)[:, None]
    for k in range(0, len(found.values), 29):
        place, normal = middles(found)[k], flat[found.origins[k]]
        away = place - targets[flat @ normal < -0.5]
        ahead = away @ normal
        sampled = (away**2).sum(axis=-1) / np.where(ahead > 0, ahead, np.nan)
        assert found.values[k] == pytest.approx(np.nanmin(sampled), rel=0.03)
    broken = samples.with_flipped_faces(samples.without_faces(torus, 0.1), 0.2)
    assert np.median(np.abs(sh.wall_thickness(broken, resolution=8).values / 0.8 - 1)) < 0.02


def test_what_has_no_opposite_sides_says_so():
    corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]  # faces of a tetrahedron are 109° apart
    found = sh.wall_thickness(sh.TriangleMesh(corners, [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]), resolution=1)
    assert np.isnan(found.values).all() and found.below(1) == 0 and "none opposite" in repr(found)
    for asked in (lambda: found.thinnest, lambda: found.percentiles([50])):
        with refused(sh.errors.SourceError, element="thickness"):
            asked()


@pytest.mark.parametrize("percents", [[101], [-1, 50], [np.nan], "half"])
def test_percents_go_from_0_to_100(percents):
    corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    flat = sh.TriangleMesh(corners, [[0, 1, 2]])
    walls = Thickness(flat, np.ones(1), np.zeros(1, dtype=np.int64))
    for found in (walls, sh.deviation(flat, flat)):
        with refused(sh.SignedHeatError, element="percents"):
            found.percentiles(percents)


def test_sheets_have_no_thickness():
    with refused(sh.errors.SourceError):
        sh.wall_thickness(sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))


def test_command(tmp_path, capsys):
    part = samples.union(box((0, 0, 0), (4, 4, 4)), box((6, 0, 0), (6.5, 4, 4)))
    sh.save(part, tmp_path / "part.stl")
    outputs = [str(tmp_path / f"map.{kind}") for kind in ("ply", "npz", "png")]
    assert (
        main(["thickness", "-o", *outputs, str(tmp_path / "part.stl"), "--least", "1", "--units", "mm", "--json"]) == 0
    )
    said = json.loads(capsys.readouterr().out)
    assert said["thinnest"] == pytest.approx(0.5) and 6 <= said["at"][0] <= 6.5 and said["units"] == "mm"
    assert said["below"] == pytest.approx(2 * 16 / (96 + 2 * 16 + 4 * 2))
    with np.load(outputs[1]) as arrays:
        written = read_ply(tmp_path / "map.ply", ("thickness",))
        np.testing.assert_array_equal(written.values["thickness"], np.repeat(arrays["thickness"], 3))
        assert len(arrays["faces"]) == len(arrays["thickness"]) == len(arrays["origins"])
    assert main(["info", str(tmp_path / "part.stl")]) == 0
    assert "thinnest place         0.5 at (6" in capsys.readouterr().out
