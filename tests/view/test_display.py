"""What shapes and fields look like in notebooks and in PyVista, and as text."""

from __future__ import annotations

import base64
import io
import re
import subprocess
import sys

import matplotlib.image
import numpy as np
import pytest

import signedheat as sh
from refusals import refused
from signedheat import samples

BALL = samples.sphere(2)
GRID = sh.Grid((-1.5, -1.2, -1.2), 0.2, (16, 13, 13))
SQUARE = sh.Polyline([[0, 0], [0, 1], [1, 1], [1, 0]], closed=True)
PLANE = sh.Grid((-0.5, -0.5), 0.1, (21, 16))
TETS = sh.tetrahedralize(BALL, resolution=3)
VOXELS = sh.DigitalSurface(np.linalg.norm(np.indices((9, 9, 9)) - 4.0, axis=0) < 3.5)


def height(points):
    return points[..., 0] - 0.3


def piecewise():
    return sh.piecewise_distance([BALL.polyline([[1.0, 0, 0.2], [0, 1.0, 0.1]])], BALL)


THINGS = {
    "mesh": lambda: samples.with_flipped_faces(BALL, 0.2),
    "polygons": lambda: VOXELS.squares,
    "points": lambda: samples.oriented_points(BALL, 800),
    "voxels": lambda: VOXELS,
    "tets": lambda: TETS,
    "line": lambda: SQUARE,
    "field on a grid": lambda: sh.Field(GRID, np.linalg.norm(GRID.points, axis=-1) - 1),
    "field in a band": lambda: sh.signed_distance(samples.sphere(2), spacing=0.15, band=0.3),
    "field of one sign": lambda: sh.Field(GRID, np.linalg.norm(GRID.points, axis=-1) + 1),
    "field in the plane": lambda: sh.Field(PLANE, height(PLANE.points)),
    "field on tets": lambda: sh.Field(TETS, height(TETS.vertices)),
    "field on a mesh": lambda: sh.Field(BALL, height(BALL.vertices)),
    "field on voxels": lambda: sh.Field(VOXELS, height(VOXELS.vertices) - 4),
    "piecewise field": piecewise,
}
BARE = {
    "grid": lambda: GRID,
    "triangulation": lambda: sh.intrinsic_delaunay(BALL),
}
EMPTY = {
    "grid without values": lambda: sh.Field(GRID, np.full(GRID.shape, np.nan)),
    "tets without values": lambda: sh.Field(TETS, np.full(TETS.n_vertices, np.nan)),
    "mesh without values": lambda: sh.Field(BALL, np.full(BALL.n_vertices, np.nan)),
}


@pytest.mark.parametrize("make", [*THINGS.values(), *BARE.values(), *EMPTY.values()], ids=[*THINGS, *BARE, *EMPTY])
def test_text_is_short(make):
    thing = make()
    assert len(repr(thing)) < 160
    assert not re.search(r"\d\.\d{9}|array\(", repr(thing))


def test_notes_and_results_are_short_text_too():
    field = sh.signed_distance(samples.with_flipped_faces(BALL, 0.2), resolution=16)
    for thing in (
        field.diagnostics,
        *field.diagnostics.notes,
        sh.orientation(BALL),
        sh.constraints.LevelValues(np.arange(99) / 7),
    ):
        assert not re.search(r"\d\.\d{9}|array\(|object at", repr(thing))
    assert repr(sh.constraints.LevelValues([1 / 3, 2.0])) == "LevelValues(values=(0.3333, 2), hard=False)"


@pytest.mark.parametrize("make", THINGS.values(), ids=THINGS)
def test_notebooks_show_a_small_picture(make):
    thing = make()
    shown = thing._repr_html_()
    [data] = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    picture = matplotlib.image.imread(io.BytesIO(base64.b64decode(data)))[..., :3]
    assert picture.std() > 0.05 and max(picture.shape) < 600 and len(shown) < 90_000
    assert type(thing).__name__ in shown


@pytest.mark.parametrize("make", [*BARE.values(), *EMPTY.values()], ids=[*BARE, *EMPTY])
def test_what_has_no_picture_is_text(make):
    assert make()._repr_html_() == f"<code>{make()!r}</code>"


def test_text_is_escaped():
    grid = sh.Grid((0, 0, 0, 0), 1.0, (2, 2, 2, 2))
    assert "<img" not in sh.Field(grid, np.zeros(grid.shape))._repr_html_()


def test_without_matplotlib_notebooks_show_text():
    code = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "import signedheat as sh; print(sh.Polyline([[0, 0], [1, 1]])._repr_html_())"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "<code>Polyline(2 points, open)</code>"


@pytest.mark.parametrize("name", [name for name in THINGS if "field" in name])
def test_fields_go_to_pyvista_with_their_values(name):
    pytest.importorskip("pyvista")
    field = THINGS[name]()
    thing = field.to_pyvista()
    values = thing.point_data["signed_distance"]
    if isinstance(field.domain, sh.Grid | sh.TetMesh):  # PyVista's own interpolation finds the same value at each point
        d = getattr(field.domain, "dimension", 3)
        assert np.abs(field(np.asarray(thing.points)[:, :d]) - values).max() < (
            1e-12 if d == 2 or "grid" in name else 0.3
        )
    assert float(np.nanmin(values)) == pytest.approx(np.nanmin(field.values), abs=0.4)
    assert len(values) == thing.n_points


def test_confidence_goes_to_pyvista():
    pyvista = pytest.importorskip("pyvista")
    sdf = sh.signed_distance(samples.without_patches(BALL, 1, 0.8), GRID)
    image = sdf.to_pyvista()
    places = np.array([[-1.1, 0.1, 0.3], [0.5, 0.9, 0.1], [0.1, -0.3, 0.9]])
    sampled = pyvista.PolyData(places).sample(image)
    np.testing.assert_allclose(sampled["confidence"], sdf.confidence_at(places), atol=1e-5)
    assert image.active_scalars_name == "signed_distance" and sdf.confidence.min() < 1


def test_grids_go_to_pyvista():
    pytest.importorskip("pyvista")
    image = sh.Grid((1, 2), 0.5, (5, 4)).to_pyvista()
    assert image.dimensions == (5, 4, 1) and image.bounds[:4] == (1, 3, 2, 3.5)
    with pytest.raises(sh.errors.GeometryError) as told:
        sh.Grid((0.0,), 1.0, (4,)).to_pyvista()
    assert told.value.element == "grid"


@pytest.mark.parametrize("make", EMPTY.values(), ids=EMPTY)
def test_windows_refuse_fields_without_values(make):
    pytest.importorskip("pyvista")
    with refused(sh.errors.GeometryError, element="field"):
        make().plotter()


@pytest.mark.parametrize("make", [*THINGS.values(), *BARE.values()], ids=[*THINGS, *BARE])
def test_pyvista_draws_everything(make, monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    plotter = make().plotter()
    plotter.window_size = (200, 160)
    assert np.asarray(plotter.screenshot(return_img=True)).std() > 5
    plotter.close()


def test_plot_shows_and_returns_what_pyvista_returns(monkeypatch):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(pyvista.Plotter, "show", lambda self: ("shown", len(self.actors)))
    shown, actors = THINGS["field on a grid"]().plot()
    assert shown == "shown" and actors > 3
