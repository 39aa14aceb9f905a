"""The cards of the gallery: grouped by trade, with one picture each, without colour bars and captions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

TRADES = {
    "Repair and printing": (
        "watertight_scan made_solid filled_holes offset_of_a_broken_sphere overlapping_bodies flipped_faces "
        "print_shell hollow_model sections_and_cuts relief_with_a_base wall_thickness thin_plates open_sheets "
        "sharp_contours grow_and_shrink"
    ),
    "Distance for learning": (
        "deepsdf_set clothes_and_roads fit_to_distances booleans_of_fields smooth_blends fine_band"
    ),
    "Scans and parts": (
        "deviation_of_a_scan surface_from_points points_without_normals robot_meshes robot_clearance "
        "confidence shapes_of_other_packages files_in_and_out"
    ),
    "Drawings and maps": "broken_letter toolpaths rounding_a_drawing floor_plan coastline terrain_from_contours",
    "Masks": "mask_and_back distance_on_voxels grid_of_your_own",
    "Surfaces and tets": (
        "curve_distance curve_design distance_from_points shortest_paths flipped_strokes curve_across_polygons "
        "curve_on_a_point_cloud distance_that_jumps distance_on_bad_triangles intrinsic_triangles wall_distance "
        "distance_on_tets distance_round_corners"
    ),
    "The paper": "constraints completion_and_diffusion sharpened_distance",
}
"""Names of examples by trade, those that most people come for first."""
FIRST_PANEL = frozenset({"confidence", "fine_band", "shapes_of_other_packages", "open_sheets"})
"""Examples whose first panel says more than their last."""
SIZE = 560, 400
"""Pixels of a card: twice as many as are shown, for fine screens."""
WHITE = 250
"""Least value of a pixel that counts as empty."""
BAR_WIDTH = 0.5
"""Width of a panel, relative to the widest, below which it is a colour bar or its numbers."""
NARROW = 3
"""Pixels of white that do not separate panels from what is beside them."""
CARD = '<div class="sphx-glr-thumbcontainer"'


def bands(filled: NDArray[np.bool_], gap: int) -> list[tuple[int, int]]:
    """Return the begin and end of each run of True, runs closer than a gap being one."""
    at = np.flatnonzero(filled)
    if not len(at):
        return []
    breaks = np.flatnonzero(np.diff(at) > gap)
    begins, ends = np.append(at[0], at[breaks + 1]), np.append(at[breaks], at[-1]) + 1
    return list(zip(begins.tolist(), ends.tolist(), strict=True))


def panel(image: NDArray[np.uint8], first: bool) -> NDArray[np.uint8]:
    """Cut the first or last panel out of a row of panels, without its title, its axis and its colour bar."""
    filled = (image < WHITE).any(axis=2)
    quarter = len(filled) // 4  # titles, and numbers of axes, are above and below
    columns = bands(filled[quarter:-quarter].any(axis=0), NARROW)
    widest = max(end - begin for begin, end in columns)
    wide = [(begin, end) for begin, end in columns if end - begin > BAR_WIDTH * widest]
    begin, end = wide[0 if first else -1]
    rows = bands(filled[:, begin:end].any(axis=1), 2)
    top, bottom = max(rows, key=lambda row: row[1] - row[0])
    return image[top:bottom, begin:end]


def write_card(picture: Path, card: Path, first: bool) -> None:
    """Write the card of a picture, white around what it shows."""
    with Image.open(picture) as opened:
        shown = Image.fromarray(panel(np.asarray(opened.convert("RGB")), first))
    shown = ImageOps.contain(shown, SIZE, Image.Resampling.LANCZOS)
    whole = Image.new("RGB", SIZE, "white")
    whole.paste(shown, ((SIZE[0] - shown.width) // 2, (SIZE[1] - shown.height) // 2))
    whole.save(card)


def by_trade(page: str) -> str:
    """Sort the cards of the gallery's page, which Sphinx-Gallery has written, under a heading for each trade."""
    opening, _, rest = page.partition(".. raw:: html\n\n    " + CARD)
    head, _, grid = opening.rpartition(".. raw:: html")
    pieces = re.split(r"(?m)^\.\. raw:: html\n\n    (?=" + re.escape(CARD) + ")", ".. raw:: html\n\n    " + CARD + rest)
    cards, foot = {}, ""
    for piece in pieces[1:]:
        body, closing, foot = piece.partition("    </div>\n")
        name = re.search(r":doc:`/gallery/(\w+)`", body)
        assert name is not None
        cards[name[1]] = ".. raw:: html\n\n    " + body + closing
    closed = foot.index("</div>") + len("</div>\n")
    close = foot[:closed]
    sections = [head]
    for trade, names in TRADES.items():
        grid_of_trade = "".join(cards[name] + "\n\n" for name in names.split())
        sections.append(f"{trade}\n{'-' * len(trade)}\n\n.. raw:: html{grid}{grid_of_trade}{close}\n\n")
    return "".join(sections) + foot[closed:]


def arrange(app: Any) -> None:
    """Make the cards, and group them, once Sphinx-Gallery has run."""
    folder = Path(app.srcdir) / "gallery"
    for names in TRADES.values():
        for name in names.split():
            picture = folder / "images" / f"sphx_glr_{name}_001.png"
            if picture.exists():
                write_card(picture, folder / "images" / "thumb" / f"sphx_glr_{name}_thumb.png", name in FIRST_PANEL)
    page = folder / "index.rst"
    text = page.read_text(encoding="utf-8")
    if next(iter(TRADES)) not in text:
        page.write_text(by_trade(text), encoding="utf-8")
