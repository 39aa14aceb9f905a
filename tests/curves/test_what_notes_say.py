"""What notes on curves say is what was done: doing it by hand gives the same field, and every number is right."""

import re
import warnings

import numpy as np
import pytest

import signedheat as sh
from shapes import strokes
from signedheat.curves.curve_distance import CurvesTaken
from signedheat.diagnostics import VerticesJoined, WithoutLength
from signedheat.surfaces.repaired_mesh import MeshRepaired


def damaged(mesh, given, random):
    """Turned faces and copies of faces away from the curves, and a seam; the mesh, and how many there are of each."""
    away = np.setdiff1d(np.arange(mesh.n_faces), np.concatenate([curve.faces for curve in given]))
    turned, copied = np.split(random.choice(away, random.integers(2, 7), replace=False), [random.integers(0, 3)])
    faces = mesh.faces.copy()
    faces[turned] = faces[turned, ::-1]
    faces = np.vstack([faces, faces[copied]])
    heights = mesh.vertices[faces].mean(axis=1) @ random.normal(size=3)
    half = heights > np.quantile(heights, random.choice([0.5, 1.0]))
    used, faces = np.unique(faces + mesh.n_vertices * half[:, None], return_inverse=True)
    seam = len(used) - mesh.n_vertices
    return sh.TriangleMesh(np.tile(mesh.vertices, (2, 1))[used], faces.reshape(-1, 3)), (seam, len(turned), len(copied))


def measured(curves, mesh, **options):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        field = sh.signed_distance(curves, mesh, intrinsic=False, **options)
    return field, [str(warning.message) for warning in told]


@pytest.mark.parametrize("seed", range(12))
def test_notes_are_true(seed):
    random = np.random.default_rng([77, seed])
    kind = random.choice(["pieces_turned", "long_strays", "scribbles", "twice_turned", "loop_turned", "gap"])
    drawing = strokes.drawing(random, kind, 2)
    click, given = int(random.integers(len(drawing.given))), list(drawing.given)
    given.insert(click, sh.Curve([0, 0], [[0.3, 0.3, 0.4]] * 2))
    mesh, expected = damaged(drawing.mesh, given, random)
    field, told = measured(given, mesh)

    assert field.diagnostics.note(WithoutLength).without_length == [click]
    repaired, joined = field.diagnostics.note(MeshRepaired), field.diagnostics.note(VerticesJoined)
    found = (joined.vertices_joined if joined else 0, repaired.faces_turned, repaired.copies)
    assert found == expected
    for numbers in re.findall(r"curves? number ([\d, ]+)", " ".join(told)):
        assert set(map(int, re.findall(r"\d+", numbers))) <= set(range(len(given))) - {click}

    taken = field.diagnostics.note(CurvesTaken) or CurvesTaken([], [], 0.0)
    kept = [k for k in range(len(given)) if k not in [click, *taken.left_out]]
    by_hand, _ = measured(
        [given[k].reversed() if k in taken.turned else given[k] for k in kept], mesh, as_oriented=True
    )
    np.testing.assert_allclose(by_hand.values, field.values, atol=1e-4 * np.ptp(field.values))
    lengths = np.array([strokes.length(mesh, curve) for curve in given])
    assert taken.share_left_out == pytest.approx(lengths[taken.left_out].sum() / lengths.sum(), abs=0.01)
