"""Pieces of broken curves on surfaces are turned until they agree."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

import signedheat as sh
from shapes.surface_cases import band, square
from signedheat.errors import InexactWarning
from signedheat.samples import sphere, torus


def broken(curve: sh.Curve, lost: float, n: int, rng: np.random.Generator) -> list[sh.Curve]:
    """n pieces of a closed curve that lacks a part of its points, in random intervals."""
    gaps, kept = rng.dirichlet(np.ones(n)) * lost, rng.dirichlet(2 * np.ones(n)) * (1 - lost)
    ends = np.cumsum(np.stack([kept, gaps], axis=1).ravel()) + rng.random()
    begins = np.concatenate([[ends[-1] - 1], ends[1:-1:2]])
    pieces = []
    for begin, end in zip(begins, ends[::2], strict=True):
        run = np.arange(int(begin * curve.n_points), int(end * curve.n_points) + 1) % curve.n_points
        if len(run) > 1:
            pieces.append(sh.Curve(curve.faces[run], curve.barycentric[run]))
    return pieces


def same(one: sh.Curve, other: sh.Curve) -> bool:
    return bool((one.faces == other.faces).all() and (one.barycentric == other.barycentric).all())


def wave(mesh: sh.TriangleMesh) -> np.ndarray:
    x, y, z = (mesh.vertices / np.linalg.norm(mesh.vertices, axis=1)[:, None]).T
    return z + 0.0123 - 0.25 * np.sin(3 * np.arctan2(y, x)) * (1 - z**2)


@pytest.mark.parametrize("lost", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_all_pieces_of_one_curve_agree(lost, seed):
    mesh = sphere(4)
    rng = np.random.default_rng(seed)
    pieces = broken(mesh.level_set(wave(mesh))[0], lost, 12, rng)
    wrong = np.isin(np.arange(len(pieces)), rng.permutation(len(pieces))[:3])
    given = [piece.reversed() if turn else piece for piece, turn in zip(pieces, wrong, strict=True)]
    found = sh.orientation(given, mesh)
    assert (found.turned == wrong).all()
    assert all(map(same, sh.orient(given, mesh), pieces))
    assert found.agreement.min() >= 0 and found.agreement.max() <= 1


def test_without_gaps_the_pieces_agree_all_but_perfectly():
    mesh = sphere(4)
    curve = mesh.level_set(wave(mesh))[0]
    cuts = np.linspace(0, curve.n_points, 7).astype(int)
    runs = [np.arange(a, b + 1) % curve.n_points for a, b in pairwise(cuts)]
    pieces = [sh.Curve(curve.faces[run], curve.barycentric[run]) for run in runs]
    spurious = mesh.path(mesh.edges.vertices[0])
    found = sh.orientation([*pieces, spurious], mesh)
    assert found.agreement[:-1].min() > 0.9  # what lies beyond an end is on both sides of it
    assert found.agreement[-1] < 0.2
    assert found.agreeing(0.5) == found.curves[:-1]


@pytest.mark.parametrize("opposite", [False, True])
def test_curves_apart_face_each_other(opposite):
    """Two circles round the tube of a torus, at its two ends, bound half of it; facing the same way they bound nothing,
    and which of them is turned is a guess."""
    mesh = torus(n_around=96, n_across=48)
    pieces = []
    for first, backward in ((0, False), (48 * 48, opposite)):
        for begin in range(0, 48, 12):
            piece = mesh.path(first + (begin + np.arange(9)) % 48)
            pieces.append(piece.reversed() if backward else piece)
    wrong = np.isin(np.arange(8), [1, 6])
    given = [piece.reversed() if turn else piece for piece, turn in zip(pieces, wrong, strict=True)]
    found = sh.orientation(given, mesh).turned
    if opposite:
        assert (found == wrong).all()
    else:
        assert (found[:4] != wrong[:4]).all() != (found[4:] != wrong[4:]).all()
        with pytest.warns(sh.errors.InexactWarning, match="ran against"):
            sh.signed_distance(given, mesh)


def test_what_has_no_direction_or_no_end_stays():
    mesh = sphere(3)
    whole, alone = mesh.level_set(mesh.vertices[:, 2] - 0.501)[0], mesh.path([0, 5])
    given = [whole.reversed(), mesh.path([1, 6], oriented=False), mesh.points_at(9), alone]
    assert sh.orient(given, mesh) == given
    assert not sh.orientation(given, mesh).turned.any()


def test_given_normals_turn_instead_of_the_direction():
    """Quarters of a circle in a plane, whose normals, not their directions, are to agree."""
    mesh = square(41)
    pieces = []
    for k, (outward, backward) in enumerate([(1, False), (-1, False), (1, True), (1, False)]):
        angle = 0.5 * np.pi * k + np.linspace(0.1, 1.4, 20)[:: -1 if backward else 1]
        drawn = mesh.polyline(0.6 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
        at = np.einsum("nk,nkd->nd", drawn.barycentric, mesh.vertices[mesh.faces[drawn.faces]])
        normals = outward * 0.5 * (at[1:] + at[:-1])
        pieces.append(sh.Curve(drawn.faces, drawn.barycentric, normals=normals))
    found = sh.orientation(pieces, mesh)
    assert found.turned.tolist() == [False, True, False, False]
    assert np.allclose(found.curves[1].normals, -pieces[1].normals)
    assert same(found.curves[1], pieces[1])


@pytest.mark.parametrize("domain", ["polygons", "voxels", "points", "intrinsic"])
def test_on_every_surface(domain):
    mesh = sphere(3)
    if domain == "polygons":
        mesh = sh.PolygonMesh(mesh.vertices, mesh.faces)
    elif domain == "voxels":
        centers = np.moveaxis(np.indices((23, 23, 23)), 0, -1) - 11.0
        mesh = sh.DigitalSurface(np.linalg.norm(centers, axis=-1) < 9.3, origin=(-11, -11, -11))
    elif domain == "points":
        mesh = sh.PointCloud(mesh.vertices, mesh.vertices)
    values = wave(mesh) if domain == "voxels" else wave(sphere(3))
    pieces = broken(max(mesh.level_set(values), key=lambda c: c.n_points), 0.25, 7, np.random.default_rng(2))
    pieces[2] = pieces[2].reversed()
    if domain == "intrinsic":
        mesh = sh.intrinsic_delaunay(mesh)
    assert sh.orientation(pieces, mesh).turned.tolist() == [k == 2 for k in range(len(pieces))]


def test_only_surfaces_have_curves():
    with pytest.raises(sh.errors.UnsupportedTypeError) as caught:
        sh.orientation([], sh.Grid((0, 0), 1.0, (3, 3)))
    assert caught.value.element == "domain"


def test_curves_with_one_side_are_announced():
    strip, cylinder = (band(40, 4, twisted) for twisted in (True, False))
    middle = [5 * k + 2 for k in range(40)]
    for measure in (sh.signed_distance, lambda curve, mesh: sh.SignedHeatSolver(mesh).distance(curve)):
        with pytest.warns(InexactWarning, match="one side"):
            measure(strip.path(middle, closed=True), strip)
        measure(cylinder.path(middle, closed=True), cylinder)
        measure(strip.path(middle, closed=True, oriented=False), strip)
    loop, click = strip.path(middle, closed=True), strip.path([0, 0])
    for measure in (
        partial(sh.signed_distance, as_oriented=True),
        lambda c, mesh: sh.SignedHeatSolver(mesh).distance(c),
    ):
        with pytest.warns(InexactWarning, match="curve 1 has one side"):  # its number among those given
            measure([click, loop], strip)
    with pytest.warns(InexactWarning, match="one side"):  # beyond its ends, which side is which is a guess
        sh.signed_distance(strip.path(middle[:20]), strip)
