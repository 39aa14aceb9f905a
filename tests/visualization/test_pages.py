"""Pages show shapes and fields in a real browser, turn, slice and change level; everything is in one file."""

from __future__ import annotations

import io
import json
import re
import time

import matplotlib.image
import numpy as np
import pytest

import signedheat as sh
from shapes.browser import Browser, is_there
from signedheat import samples
from signedheat.cli import main, view
from signedheat.visualization import save_page

GRID = sh.Grid((-1.6, -1.6, -1.6), 0.1, (33, 33, 33))
PLANE = sh.Grid((-1.6, -1.6), 0.05, (65, 65))
BALL = samples.sphere(3)
COUNT = """
const c = document.getElementById("view"), p = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
let blue = 0, orange = 0, drawn = 0;
for (let k = 0; k < p.length; k += 4) if (p[k + 3]) {
  drawn++;
  if (p[k + 2] > p[k] + 25) blue++;
  if (p[k] > p[k + 2] + 60) orange++;
}
return {blue, orange, drawn, times: +document.body.dataset.drawn};
"""


def ball_field(grid=GRID):
    return sh.GridField(grid, np.linalg.norm(grid.points, axis=-1) - 1)


def content(page):
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)[1])


@pytest.fixture(scope="module")
def browser():
    if not is_there():
        pytest.skip("no Chromium here")
    window = Browser()
    yield window
    window.close()


def settle(browser, times):
    """Counts of pixels once the picture has been drawn finely again."""
    for _ in range(100):
        time.sleep(0.1)
        found = browser.run(COUNT)
        if found["times"] > times:
            time.sleep(0.4)
            return browser.run(COUNT)
    raise AssertionError("nothing was drawn")


def change(browser, element, value):
    times = browser.run(COUNT)["times"]
    kind = "click()" if value is None else f"value = {value}"
    browser.run(f"const e = document.getElementById('{element}'); e.{kind}; e.dispatchEvent(new Event('input'));")
    return settle(browser, times)


def test_a_field_in_space_is_turned_sliced_and_shown_at_levels_of_both_signs(tmp_path, browser):
    save_page(ball_field(), tmp_path / "ball.html", "a ball")
    browser.open(tmp_path / "ball.html")
    first = browser.run(COUNT)
    assert first["blue"] > 3_000 and first["orange"] > 3_000  # both signs at first sight
    picture = matplotlib.image.imread(io.BytesIO(browser.screenshot()))
    assert picture[..., :3].std() > 0.1

    times = first["times"]
    browser.drag((450, 320), (600, 380))
    turned = settle(browser, times)
    assert turned["drawn"] != first["drawn"]

    radii = {}
    change(browser, "slice", None)
    for level in (-0.5, 0.0, 0.4):  # the surface alone: its picture is a disc
        drawn = change(browser, "level", 500 * (1 + (level / 1.0 if level < 0 else level / ball_field().values.max())))
        radii[level] = (drawn["drawn"] / np.pi) ** 0.5
        assert browser.run("return state.level") == pytest.approx(level, abs=0.01)
    assert radii[-0.5] / radii[0.0] == pytest.approx(0.5, abs=0.03)
    assert radii[0.4] / radii[0.0] == pytest.approx(1.4, abs=0.05)

    change(browser, "slice", None)
    change(browser, "surface", None)
    middle = change(browser, "position", 500)
    off = change(browser, "position", 30)
    assert middle["blue"] > 3_000 and off["blue"] == 0


def test_the_surface_of_the_page_is_where_it_should_be(tmp_path, browser):
    save_page(ball_field(), tmp_path / "ball.html")
    browser.open(tmp_path / "ball.html")
    for level in (-0.4, 0.0, 0.5):
        found = browser.run(f"const s = surfaceAt({level}); return [Array.from(s.p), Array.from(s.f)];")
        mesh = sh.TriangleMesh(np.reshape(found[0], (-1, 3)), np.reshape(found[1], (-1, 3)))
        assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1 - level).max() < 0.01
        assert (mesh.edges.face_counts == 2).all()
        volume = np.einsum("ij,ij->", mesh.vertices[mesh.faces].mean(axis=1), mesh.face_area_vectors) / 3
        assert volume == pytest.approx(4.19 * (1 + level) ** 3, rel=0.05)  # closed, facing greater values


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.31, -0.77, 1.2), (1.6, 1.6, 1.6), (-1.6, 0.05, -1.6)])
def test_the_page_interpolates_as_the_field_does(tmp_path, browser, point):
    save_page(ball_field(), tmp_path / "ball.html")
    browser.open(tmp_path / "ball.html")
    assert browser.run(f"return sample({point[0]}, {point[1]}, {point[2]})") == pytest.approx(
        ball_field()([point])[0], abs=1e-4
    )


THINGS = {
    "plane": lambda: ball_field(PLANE),
    "surface": lambda: sh.VertexField(BALL, BALL.vertices[:, 2] - 0.1),
    "points": lambda: sh.VertexField(sh.PointCloud(BALL.vertices), BALL.vertices[:, 2]),
    "tets": lambda: sh.TetField(t := sh.tetrahedralize(BALL, resolution=4), np.linalg.norm(t.vertices, axis=1) - 1),
    "far away": lambda: sh.VertexField(sh.TriangleMesh(BALL.vertices + 1e6, BALL.faces), BALL.vertices[:, 2]),
}


@pytest.mark.parametrize("make", THINGS.values(), ids=THINGS)
def test_other_fields_show_both_signs(tmp_path, browser, make):
    save_page(make(), tmp_path / "page.html")
    browser.open(tmp_path / "page.html")
    found = browser.run(COUNT)
    assert found["blue"] > 400 and found["orange"] > 400


@pytest.mark.parametrize("up", [0, 1, 2])
def test_the_axis_upwards_is_upwards(tmp_path, browser, up):
    points = np.array([[-1.0, -1, -1], [1, 1, 1], [1, -1, 0.5], [0, 0, 0]])
    points[3, up] = 5.0
    save_page(sh.TriangleMesh(points, [[0, 1, 2], [0, 2, 3]]), tmp_path / "page.html", up=up)
    browser.open(tmp_path / "page.html")
    rows = browser.run("return [0, 1, 2].map(k => frame[1][k])")
    assert int(np.argmax(rows)) == up
    right, upwards, eye = np.array(browser.run("return frame"))
    assert np.allclose(np.cross(right, upwards), eye)


def test_pages_need_nothing_else(tmp_path):
    save_page(ball_field(), tmp_path / "ball.html", "</script><b>ball")
    text = (tmp_path / "ball.html").read_text(encoding="utf-8")
    assert not re.search(r"""(src|href)\s*=|https?://|@import|url\(|import\(|fetch\(""", text)
    assert text.count("</script>") == 2 and "&lt;/script&gt;&lt;b&gt;ball" in text


def test_fine_grids_are_thinned_and_keep_their_place(tmp_path):
    grid = sh.Grid((0, 0, 0), 0.01, (200, 5, 5))
    save_page(sh.GridField(grid, grid.points[..., 0] - 1), tmp_path / "fine.html")
    told = content(tmp_path / "fine.html")
    assert told["volume"]["shape"] == [67, 2, 2] and told["volume"]["spacing"] == pytest.approx([0.03] * 3)
    assert told["low"] == pytest.approx(-1) and told["high"] == pytest.approx(0.98)


def test_what_no_page_can_show_is_refused(tmp_path):
    page = tmp_path / "page.html"
    four = sh.Grid((0,) * 4, 1.0, (2,) * 4)
    for thing in (sh.GridField(four, np.zeros(four.shape)), sh.GridField(GRID, np.full(GRID.shape, np.nan))):
        with pytest.raises(sh.GeometryError) as told:
            save_page(thing, page)
        assert told.value.remedy and told.value.element == "field"
    with pytest.raises(sh.UnsupportedTypeError) as told:
        save_page(GRID, page)
    assert told.value.element == "Grid"
    with pytest.raises(sh.FileFormatError):
        save_page(ball_field(), tmp_path / "page.txt")
    assert not page.exists()


def test_view_writes_a_page_where_there_is_no_display(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.chdir(tmp_path)
    BALL.save("ball.ply")
    ball_field().save("phi.npz")
    assert main(["view", "ball.ply"]) == 0
    assert main(["view", "phi.npz", "-o", "other.html", "--up", "y"]) == 0
    assert capsys.readouterr().out.split() == ["ball.html", "other.html"]
    assert "mesh" in content(tmp_path / "ball.html") and content(tmp_path / "other.html")["up"] == 1


def test_view_opens_a_window_where_there_is_one(tmp_path, monkeypatch, capsys):
    pyvista = pytest.importorskip("pyvista")
    monkeypatch.setattr(view, "display_answers", lambda: True)
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    opened = []
    monkeypatch.setattr(pyvista.Plotter, "show", lambda self: opened.append(len(self.actors)))
    BALL.save(tmp_path / "ball.ply")
    assert main(["view", str(tmp_path / "ball.ply")]) == 0
    assert opened and [path.name for path in tmp_path.iterdir()] == ["ball.ply"]
