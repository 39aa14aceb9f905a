"""`orientation`: broken orientation comes out as that of the clean shape, and what bounds nothing stays as it is."""

import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from shapes.bodies import box
from signedheat import samples
from signedheat.solids.bounding import clusters_of
from signedheat.solids.gauss import Pieces


def turned(mesh, which):
    """The mesh with some faces turned inside out."""
    return sh.TriangleMesh(mesh.vertices, np.where(which[:, None], mesh.faces[:, ::-1], mesh.faces))


def inverted(mesh):
    return turned(mesh, np.ones(mesh.n_faces, dtype=bool))


def assert_alike(found, mesh):
    """Faces are the same, and face the same ways."""
    np.testing.assert_allclose(found.face_area_vectors, mesh.face_area_vectors, atol=1e-12)


def sheet(n=6, height=0.0):
    """A flat square of 2 n² triangles."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).ravel()
    faces = np.concatenate([np.stack([a, a + n + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + 1], 1)])
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    return sh.TriangleMesh(np.stack([x.ravel() / n, y.ravel() / n, np.full(x.size, height)], axis=1), faces)


def knot(n_around=120, n_across=12):
    """A closed tube along a trefoil knot: concave, of genus one, far from star-shaped."""
    t = 2 * np.pi * np.arange(n_around) / n_around
    line = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1)
    along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.3, 0.2, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(along, side)
    around = 2 * np.pi * np.arange(n_across) / n_across
    ring = np.cos(around)[:, None] * side[:, None] + np.sin(around)[:, None] * up[:, None]
    points = line[:, None] + 0.4 * ring
    grid = samples.torus(n_around=n_around, n_across=n_across)
    return sh.TriangleMesh(points.reshape(-1, 3), grid.faces)


TORUS = samples.torus(n_around=36, n_across=18)
CLOSED = {"sphere": samples.sphere(3), "torus": TORUS, "knot": knot(), "box": box((0, 0, 0), (3, 1, 0.2))}
WAYS = ("as it is", "a tenth turned", "half turned", "a patch turned", "inside out")


def broken_ways(mesh, way, seed=0):
    """(m,) bool: which faces to turn. Patches are balls."""
    rng, middles = np.random.default_rng(seed), mesh.vertices[mesh.faces].mean(axis=1)
    distance = np.linalg.norm(middles - middles[rng.integers(mesh.n_faces)], axis=1)
    nearest = np.cumsum(mesh.face_areas[np.argsort(distance)]) < 0.25 * mesh.face_areas.sum()
    patch = np.zeros(mesh.n_faces, dtype=bool)
    patch[np.argsort(distance)[nearest]] = True
    choices = (np.zeros, lambda n: rng.random(n) < 0.1, lambda n: rng.random(n) < 0.5, lambda n: patch, np.ones)
    return np.asarray(choices[WAYS.index(way)](mesh.n_faces)).astype(bool)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", CLOSED)
def test_closed_shapes_come_out_clean(name, way):
    mesh = CLOSED[name]
    if name == "knot":
        mesh = (
            inverted(mesh)
            if np.einsum("ij,ij->", mesh.vertices[mesh.faces[:, 0]], mesh.face_area_vectors) < 0
            else mesh
        )
    which = broken_ways(mesh, way)
    found = sh.orientation(turned(mesh, which))
    np.testing.assert_array_equal(found.turned, which)
    assert found.turned_faces == which.sum()
    assert (found.n_parts, found.closed_parts, found.undecided_parts, found.nonmanifold_edges) == (1, 1, 0, 0)
    assert np.einsum("ij,ij->", found.shape.vertices[found.shape.faces[:, 0]], found.shape.face_area_vectors) > 0


@pytest.fixture(scope="module")
def oriented():
    """Closed shapes that face outwards."""
    return {name: sh.orient(mesh) for name, mesh in CLOSED.items()}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["sphere", "torus", "knot"])
def test_broken_shapes_come_out_clean_too(name, way, oriented):
    """With 15 % of the faces gone, with patches gone, and with more than half gone at one end."""
    mesh = oriented[name]
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    distance = np.linalg.norm(middles - middles[7], axis=1)
    for kept in (
        np.random.default_rng(3).random(mesh.n_faces) > 0.15,
        distance > 0.3 * np.ptp(middles, axis=0)[2],
        middles[:, 0] < 0,
    ):
        which = broken_ways(mesh, way, seed=5)[kept]
        broken = sh.TriangleMesh(mesh.vertices, mesh.faces[kept])
        np.testing.assert_array_equal(sh.orientation(turned(broken, which)).turned, which)


def test_soups_that_share_coordinates_are_connected():
    soup = samples.soup(TORUS)
    which = np.random.default_rng(0).random(soup.n_faces) < 0.5
    found = sh.orientation(turned(soup, which))
    np.testing.assert_array_equal(found.turned, which)
    assert found.n_parts == 1
    moved = sh.TriangleMesh(
        soup.vertices + np.random.default_rng(1).uniform(-1e-15, 1e-15, soup.vertices.shape), soup.faces
    )
    np.testing.assert_array_equal(sh.orientation(turned(moved, which)).turned, which)


def test_a_noisy_soup_that_faces_the_right_way_is_not_harmed():
    mesh = samples.sphere(3)
    noise = np.random.default_rng(0).normal(scale=0.02, size=(mesh.n_faces, 3, 3))
    corners = mesh.vertices[mesh.faces] + noise
    soup = sh.TriangleMesh(corners.reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3))
    found = sh.orientation(soup)
    assert found.turned_area < 0.01
    assert sh.orientation(inverted(soup)).turned_area > 0.99


def test_pieces_near_a_smooth_surface_turn_with_their_neighbours():
    soup = samples.soup(samples.sphere(4), jitter=0.004)
    which = np.random.default_rng(2).random(soup.n_faces) < 0.1
    right = sh.orientation(turned(soup, which)).turned == which
    assert right.mean() > 0.99


@pytest.mark.parametrize("name, jitter, share", [("sphere", 0.002, 0.5), ("torus", 0.01, 0.3), ("torus", 0.02, 0.5)])
def test_soups_that_face_either_way_are_oriented_from_scratch(name, jitter, share):
    """Triangles that touch nothing and agree with nobody."""
    soup = samples.soup(CLOSED[name], jitter=jitter)
    which = np.random.default_rng(2).random(soup.n_faces) < share
    right = sh.orientation(turned(soup, which)).turned == which
    assert right.mean() > 0.99


def test_loose_pieces_of_several_triangles_turn_as_one():
    """The quadrilaterals of a torus, half of them turned, beside a ball that is whole."""
    torus, pieces = TORUS, []
    for k, faces in enumerate(torus.faces.reshape(-1, 2, 3)):
        corners = torus.vertices[faces] + np.random.default_rng(k).normal(scale=0.003, size=3)
        pieces.append(sh.TriangleMesh(corners.reshape(-1, 3), [[0, 1, 2], [3, 4, 5]]))
    shape = samples.union(*pieces, samples.sphere(3, center=(3.0, 0, 0)))
    which = np.zeros(shape.n_faces, dtype=bool)
    which[: torus.n_faces] = np.repeat(np.random.default_rng(1).random(torus.n_faces // 2) < 0.5, 2)
    found = sh.orientation(turned(shape, which))
    assert (found.turned == which).mean() > 0.99
    assert (found.turned[: torus.n_faces : 2] == found.turned[1 : torus.n_faces : 2]).all()


def test_leaves_that_enclose_nothing_stay_as_they_are():
    rng = np.random.default_rng(0)
    leaves = rng.normal(size=(400, 1, 3)) + 0.2 * rng.normal(size=(400, 3, 3))
    found = sh.orientation(sh.TriangleMesh(leaves.reshape(-1, 3), np.arange(1200).reshape(-1, 3)))
    assert found.turned_faces < 0.1 * len(leaves)


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize("share", [0.0, 0.1])
def test_cavities_and_bodies_within_bodies(inside_out, share):
    """A hidden part given the same way round as what it lies in is a body, and else the wall of a cavity."""
    outer, inner, core = samples.sphere(4), samples.sphere(3, 0.6), samples.sphere(3, 0.3)
    for shape, bodies, cavities in (
        (samples.union(outer, inner), 1, 0),
        (samples.union(outer, inverted(inner)), 0, 1),
        (samples.union(outer, inverted(inner), core), 1, 1),
        (samples.union(outer, inner, core), 2, 0),
    ):
        which = np.random.default_rng(1).random(shape.n_faces) < share
        found = sh.orientation(turned(shape, which != inside_out))
        assert (found.nested_bodies, found.cavities) == (bodies, cavities)
        assert_alike(found.shape, shape)
        assert sh.orientation(shape).turned_faces == 0


def test_without_a_hint_hidden_parts_bound_cavities():
    shape = samples.union(samples.sphere(4), samples.sphere(4, 0.5), samples.sphere(3, 0.2))
    which = np.random.default_rng(1).random(shape.n_faces) < 0.5
    found = sh.orientation(turned(shape, which))
    assert (found.cavities, found.nested_bodies) == (1, 1)  # and what lies in the cavity is a body


def test_bubbles_too_small_for_any_line_are_cavities():
    bubbles = [inverted(samples.sphere(1, 0.004, (0.03 * k - 0.4, 0.1, 0.2))) for k in range(27)]
    found = sh.orientation(samples.union(samples.sphere(4), *bubbles))
    assert (found.cavities, found.turned_faces) == (27, 0)


def test_overlapping_bodies_all_face_outwards():
    bodies = [samples.sphere(3, 1.0, (k, 0.0, 0.0)) for k in range(4)]
    shape = samples.union(bodies[0], inverted(bodies[1]), inverted(bodies[2]), bodies[3])
    assert_alike(sh.orient(shape), samples.union(*bodies))


def test_patches_that_share_no_edge_make_one_solid():
    """The six sides of a box, each a finer sheet of its own, three of them turned."""
    sides = []
    for axis in range(3):
        for end in (0.0, 1.0):
            one = sheet(4 + 2 * axis + int(end), end)
            side = sh.TriangleMesh(np.roll(one.vertices, axis, axis=1), one.faces)
            sides.append(side if end else inverted(side))
    found = sh.orientation(samples.union(*[inverted(s) if k % 2 else s for k, s in enumerate(sides)]))
    outward = np.einsum(
        "ij,ij->i", found.shape.vertices[found.shape.faces].mean(axis=1) - 0.5, found.shape.face_area_vectors
    )
    assert (outward > 0).all()
    assert found.undecided_parts == 0


def test_duplicates_are_merged_whichever_way_they_face():
    clean = samples.sphere(4)
    broken = samples.with_flipped_faces(samples.with_duplicate_faces(clean, 0.3, seed=1), 0.3, seed=2)
    found = sh.orientation(broken)
    assert found.merged_faces == broken.n_faces - clean.n_faces
    np.testing.assert_allclose(found.shape.face_area_vectors.sum(axis=0), 0, atol=1e-12)
    assert found.shape.n_faces == clean.n_faces
    both = sh.orientation(samples.union(clean, inverted(clean)))  # drawn from both sides
    assert both.shape.n_faces == clean.n_faces
    assert np.einsum("ij,ij->", both.shape.vertices[both.shape.faces[:, 0]], both.shape.face_area_vectors) > 0


def test_doubled_sheets_are_sheets():
    front = sheet()
    found = sh.orientation(samples.union(front, inverted(front), front))
    assert (found.merged_faces, found.undecided_area) == (2 * front.n_faces, pytest.approx(1.0))
    with_fin = samples.union(box((-2, -2, -1), (2, 2, 0)), front, inverted(front))
    found = sh.orientation(with_fin)
    assert (found.turned_faces, found.undecided.sum()) == (0, front.n_faces)


def test_stacked_boxes_with_a_common_wall_keep_it():
    stack = samples.union(box((0, 0, 0), (1, 1, 1)), box((0, 0, 1), (1, 1, 2)))
    found = sh.orientation(turned(stack, broken_ways(stack, "half turned")))
    assert found.merged_faces in (0, 2)
    volume = np.einsum("ij,ij->", found.shape.vertices[found.shape.faces[:, 0]], found.shape.face_area_vectors) / 3
    assert volume == pytest.approx(2.0)


def test_sheets_are_left_and_told():
    flat = sheet()
    which = np.zeros(flat.n_faces, dtype=bool)
    which[5] = True
    for mesh in (flat, inverted(flat)):
        found = sh.orientation(turned(mesh, which))
        np.testing.assert_array_equal(found.turned, which)  # neighbours agree, most stay
        assert (found.undecided_parts, found.turned_parts) == (1, 0)
        assert found.undecided_area == pytest.approx(1.0)


def test_moebius_bands_are_left_and_told():
    n, m = 60, 6
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, np.linspace(-0.4, 0.4, m), indexing="ij")
    ring = 1 + v * np.cos(u / 2)
    points = np.stack([ring * np.cos(u), ring * np.sin(u), v * np.sin(u / 2)], axis=-1).reshape(-1, 3)
    faces = []
    for i in range(n):
        for j in range(m - 1):
            a, b = i * m + j, i * m + j + 1
            c, d = ((i + 1) * m + j, (i + 1) * m + j + 1) if i < n - 1 else (m - 1 - j, m - 2 - j)
            faces += [[a, c, d], [a, d, b]]
    band = sh.TriangleMesh(points, faces)
    found = sh.orientation(band)
    assert (found.nonorientable_parts, found.turned_faces) == (1, 0)
    assert found.inconsistent_edges > 0
    np.testing.assert_array_equal(found.shape.faces, band.faces)


def test_orientation_is_not_carried_on_where_three_pages_meet():
    pages = sh.TriangleMesh(
        [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -0.5, 0]], [[0, 1, 2], [0, 1, 3], [1, 0, 4]]
    )
    found = sh.orientation(pages)
    assert (found.nonmanifold_edges, found.n_parts) == (1, 3)


def walls_of_cells(solid):
    """All walls, two triangles each, of the unit cells of a grid where those meet other cells or the outside.

    Returns the mesh, and of each face whether it bounds something; those that do face outwards.
    """
    cells = np.pad(solid, 1)
    corners = np.stack(np.meshgrid(*(np.arange(n + 1) for n in solid.shape), indexing="ij"), axis=-1).reshape(-1, 3)
    ids = np.arange(len(corners)).reshape(np.array(solid.shape) + 1)
    faces, bounding = [], []
    for axis in range(3):
        below, above = np.moveaxis(cells, axis, 0)[:-1, 1:-1, 1:-1], np.moveaxis(cells, axis, 0)[1:, 1:-1, 1:-1]
        at = np.moveaxis(ids, axis, 0)
        for i, j, k in np.argwhere(below | above):
            a, b, c, d = at[i, j, k], at[i, j + 1, k], at[i, j + 1, k + 1], at[i, j, k + 1]
            square = [[a, b, c], [a, c, d]]  # towards larger coordinates, or for the second axis smaller ones
            if bool(above[i, j, k] and not below[i, j, k]) == (axis != 1):
                square = [face[::-1] for face in square]
            faces += square
            bounding += 2 * [bool(below[i, j, k] != above[i, j, k])]
    return sh.TriangleMesh(corners.astype(float), faces), np.array(bounding)


@pytest.mark.parametrize("shape", [(2, 1, 1), (3, 3, 3), (4, 4, 4), (7, 5, 2)])
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_walls_between_the_cells_of_a_whole_complex_bound_nothing(shape, share):
    mesh, bounding = walls_of_cells(np.ones(shape, dtype=bool))
    rng = np.random.default_rng(1)
    turn, order = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.permutation(mesh.n_faces)
    turn *= np.linalg.det(turn)
    given = sh.TriangleMesh(mesh.vertices @ turn, mesh.faces[order])
    which = rng.random(mesh.n_faces) < share
    found = sh.orientation(turned(given, which))
    np.testing.assert_array_equal(found.inner, ~bounding[order])
    np.testing.assert_array_equal(found.turned, which & ~found.inner)


def test_cells_may_be_any_and_leave_a_notch():
    solid = np.ones((3, 3, 2), dtype=bool)
    solid[1, 1, 1] = solid[0, 0, 0] = solid[2, 2] = False
    mesh, bounding = walls_of_cells(solid)
    which = np.random.default_rng(0).random(mesh.n_faces) < 0.5
    found = sh.orientation(turned(mesh, which))
    np.testing.assert_array_equal(found.inner, ~bounding)
    np.testing.assert_array_equal((found.turned == which)[bounding], True)


@pytest.mark.parametrize("cavity", [True, False])
def test_a_cell_that_all_walls_face_into_is_a_cavity_if_the_outside_faces_outwards(cavity):
    mesh, bounding = walls_of_cells(np.ones((5, 5, 5), dtype=bool))
    centers = mesh.vertices[mesh.faces].mean(axis=1) - 2.5
    room = (np.abs(centers) < 0.7).all(axis=1) & (np.abs(centers).max(axis=1) > 0.45)
    partition = (np.abs(centers[:, 0] - 0.5) < 1e-9) & ~room & ~bounding
    kept = bounding | room | partition  # a box, a room in it, and a wall of one side of it that runs through the box
    outwards = np.einsum("ij,ij->i", centers, mesh.face_area_vectors) > 0
    given = turned(sh.TriangleMesh(mesh.vertices, mesh.faces[kept]), (room & (outwards == cavity))[kept])
    found = sh.orientation(given)
    assert found.inner[partition[kept]].all() and not found.inner[bounding[kept]].any()
    assert found.turned_faces == 0
    assert sh.complete(given).volume == pytest.approx(124.0 if cavity else 125.0)


@pytest.mark.parametrize("gone", [0, 1, 2])
def test_a_cell_that_lacks_walls_is_outside_and_opens_no_other(gone):
    mesh, bounding = walls_of_cells(np.ones((3, 3, 3), dtype=bool))
    corner = mesh.vertices[mesh.faces].mean(axis=1)
    outer = bounding & (corner < 1).all(axis=1)  # of the first cell
    kept = ~(outer & (corner[:, :gone] < 1e-9).any(axis=1))
    first = (corner < 1).all(axis=1) | ((corner <= 1 + 1e-9).all(axis=1) & ~bounding)
    which = np.random.default_rng(2).random(mesh.n_faces) < 0.5
    found = sh.orientation(turned(sh.TriangleMesh(mesh.vertices, mesh.faces[kept]), which[kept]))
    np.testing.assert_array_equal(found.inner, (~bounding & ~(first & (gone > 0)))[kept])
    sure = (bounding & ~first)[kept]
    np.testing.assert_array_equal(found.turned[sure], which[kept][sure])


def test_a_fin_in_a_closed_body_is_inner_and_one_outside_is_not():
    mesh, bounding = walls_of_cells(np.ones((2, 2, 2), dtype=bool))
    centers = mesh.vertices[mesh.faces].mean(axis=1)
    kept = bounding | ((np.abs(centers[:, 0] - 1) < 1e-9) & (centers[:, 1:] < 1).all(axis=1))
    fin = ~bounding[kept]
    assert fin.sum() == 2
    given = sh.TriangleMesh(mesh.vertices, mesh.faces[kept])
    np.testing.assert_array_equal(sh.orientation(given).inner, fin)
    outside = sh.TriangleMesh(
        [*mesh.vertices, [-1, 0, 0], [-1, 1, 0]], [*mesh.faces[bounding], [0, 27, 28], [0, 28, 3]]
    )
    assert not sh.orientation(outside).inner.any()


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_faces_on_each_other_with_other_diagonals_are_walls_too(share):
    """A box stands on one of two cells that share a wall; its bottom and the cell's top are divided differently."""
    mesh, _ = walls_of_cells(np.ones((2, 1, 1), dtype=bool))
    again = samples.union(mesh, box((0, 0, 1), (1, 1, 2)))
    which = np.random.default_rng(0).random(again.n_faces) < share
    assert sh.complete(turned(sh.TriangleMesh(again.vertices, again.faces), which)).volume == pytest.approx(3.0)


def test_polygons_stay_polygons():
    corners = box((0, 0, 0), (1, 2, 3)).vertices
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    broken = [q[::-1] if k in (1, 4) else q for k, q in enumerate(quads)]
    found = sh.orientation(sh.PolygonMesh(corners, [*broken, quads[0]]))
    assert isinstance(found.shape, sh.PolygonMesh)
    assert found.merged_faces == 1
    assert found.turned.tolist() == [False, True, False, False, True, False]
    outward = np.einsum("ij,ij->i", found.shape.polygon_centroids - [0.5, 1, 1.5], found.shape.polygon_area_vectors)
    assert (outward > 0).all()


@pytest.fixture(scope="module")
def broken_duck():
    """It, and what is found of it."""
    duck = samples.with_noise(samples.without_patches(samples.duck(28), 7, 0.26, 3), 0.006, 1)
    duck = samples.with_duplicate_faces(samples.with_flipped_faces(duck, 0.05, 2), 0.05, 5)
    return duck, sh.orientation(duck)


def test_polygons_are_oriented_as_their_triangles_are(broken_duck):
    mesh, by_triangles = broken_duck
    by_polygons = sh.orientation(sh.PolygonMesh(mesh.vertices, mesh.faces))
    np.testing.assert_array_equal(by_triangles.turned, by_polygons.turned)
    assert by_triangles.summary == pytest.approx(by_polygons.summary)


def test_it_does_not_depend_on_numbering_place_or_scale(broken_duck):
    mesh, found = broken_duck
    rng = np.random.default_rng(0)
    faces, names = rng.permutation(mesh.n_faces), rng.permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    vertices[names] = 1000 * mesh.vertices @ rotation.T + [30, -20, 5]
    other = sh.orientation(sh.TriangleMesh(vertices, names[mesh.faces[faces]]))
    area = mesh.face_area_vectors
    area[found.faces[found.turned]] *= -1
    assert found.merged_faces == other.merged_faces > 100
    turned_back = np.zeros(mesh.n_faces, dtype=bool)
    turned_back[faces[other.faces[other.turned]]] = True
    kept = np.intersect1d(found.faces, faces[other.faces])
    wanted = np.zeros(mesh.n_faces, dtype=bool)
    wanted[found.faces[found.turned]] = True
    share = mesh.face_areas[kept][wanted[kept] != turned_back[kept]].sum() / mesh.face_areas.sum()
    assert share < 1e-3


def test_awkward_faces_do_no_harm():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5], [0, 0, 0]]
    tet = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    found = sh.orientation(sh.TriangleMesh(vertices, [*tet, [0, 0, 1], [0, 5, 2], [1, 1, 1]]))
    assert found.turned_faces == 0
    assert found.parts.tolist() == [0, 0, 0, 0, -1, -1, -1]
    one = sh.orientation(sh.TriangleMesh(vertices, [[0, 1, 2]]))
    assert (one.undecided_parts, one.turned_faces) == (1, 0)
    point = sh.orientation(sh.TriangleMesh([[1, 1, 1], [1, 1, 1], [1, 1, 1]], [[0, 1, 2]]))
    assert point.n_parts == 0
    line = sh.orientation(sh.TriangleMesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
    assert line.turned_faces == 0
    huge = samples.sphere(2)
    assert sh.orientation(sh.TriangleMesh(huge.vertices * 1e30, inverted(huge).faces)).turned_faces == huge.n_faces
    assert sh.orientation(sh.TriangleMesh(huge.vertices * 1e-30, inverted(huge).faces)).turned_faces == huge.n_faces


def test_only_meshes_have_faces():
    with refused(sh.errors.GeometryError):
        sh.orientation(sh.PointCloud([[0, 0, 0], [1, 0, 0]]))


def test_the_note_tells_what_was_done(broken_duck):
    _, found = broken_duck
    assert str(found.turned_faces) in str(found.note) and str(found.merged_faces) in str(found.note)
    assert found.note.as_dict()["turned_area"] == found.turned_area
    assert str(sh.orientation(samples.sphere(2)).note) != str(found.note)


@pytest.mark.parametrize("thickness", [0.05, 0.035, 0.01])
@pytest.mark.parametrize("turn", [False, True])
def test_walls_of_thin_shells_with_a_hole_face_away_from_each_other(thickness, turn):
    """Also where the walls are nearer to each other than the places at which levels are asked for."""
    ball = samples.sphere(4)
    outer = sh.TriangleMesh(ball.vertices, ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.9])
    inner = sh.TriangleMesh((1 - thickness) * outer.vertices, outer.faces[:, ::-1])
    shell = samples.union(outer, inner)
    found = sh.orientation(inverted(shell) if turn else shell)
    np.testing.assert_array_equal(found.turned, turn)
    assert found.undecided_parts == 0


@pytest.mark.parametrize("move", [(0.0, 0.0, 0.0), (10.0, -20.0, 30.0)])
def test_loose_pieces_are_clustered_alike_wherever_they_lie(move):
    """Two heaps of four small triangles each, farther apart than triangles are large."""
    rng = np.random.default_rng(0)
    middles = np.repeat([[0.0, 0, 0], [3, 0, 0]], 4, axis=0) + rng.uniform(-0.1, 0.1, (8, 3)) + move
    triangles = middles[:, None] + rng.uniform(-0.1, 0.1, (8, 3, 3))
    clusters = clusters_of(Pieces(triangles, np.arange(8)))
    assert len(set(clusters[:4])) == len(set(clusters[4:])) == 1
    assert clusters[0] != clusters[4]
