"""The closed mesh of each shape of a batch, and how far it is from what was given."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..domains.digital_surface import DigitalSurface
from ..domains.triangle_mesh import TriangleMesh
from ..domains.validation import positive_number
from ..errors import GeometryError, InexactWarning, SourceError
from ..geometry.components import element_components
from ..geometry.face_features import FaceFeatures
from ..geometry.face_tree import FaceTree
from ..geometry.self_intersections import self_intersections
from ..io.shapes import read, save
from ..solids.complete import complete
from ..solids.parts import face_areas
from ..solids.solid import Solid

BOUNDS = 1e-3
"""Share of the area of a shape that is on the boundary of its solid, below which it is a sheet."""
PARTS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3]])
"""Where on a triangle distances are measured: corners, middles of sides, and centre."""


@dataclass(frozen=True)
class Watertight:
    """A closed mesh of each shape, for `run`.

    The faces that were given are kept where they bound the solid and join with its completion all around; otherwise the
    surface is contoured, with its edges and corners.

    Attributes
    ----------
    surfaces : str
        Extension of the files.
    thickness : float, optional
        Of sheets, which bound nothing by themselves: the surface is at half of this distance from everything.
    contoured : bool
        Contour everything: even triangles in place of few.
    tolerance : float, optional
        Simplify the surface, by no more than this distance.
    resolution, spacing
        Of the contour, as for `Solid.surface`.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     samples.broken_duck().save(f"{folder}/duck.stl")
    ...     figures = Watertight()(Path(f"{folder}/duck.stl"), Path(f"{folder}/closed"))
    >>> figures["bodies"], figures["way"], figures["self_intersections"]
    (1, 'faces kept', 0)
    """

    surfaces: str = ".stl"
    thickness: float | None = None
    contoured: bool = False
    tolerance: float | None = None
    resolution: int = 256
    spacing: float | None = None

    def __post_init__(self) -> None:
        if self.thickness is not None:
            positive_number(self.thickness, "thickness")
        if self.tolerance is not None:
            positive_number(self.tolerance, "tolerance")

    def __call__(self, path: Path, stem: Path) -> dict[str, object]:
        """Make it of one shape, in a file that begins with `stem`; figures, and all notes under "notes"."""
        shape = read(path)
        solid = complete(shape.smooth_surface if isinstance(shape, DigitalSurface) else shape)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InexactWarning)
            surface, way = self.closed(solid)
        save(surface, f"{stem}{self.surfaces}")
        notes = [str(note) for note in solid.diagnostics.notes] + [str(each.message) for each in caught]
        return {"way": way, **figures_of(surface, solid, 0.5 * (self.thickness or 0.0)), "notes": notes}

    def closed(self, solid: Solid) -> tuple[TriangleMesh, str]:
        """The surface, and how it was made.

        Raises
        ------
        SourceError
            If the shape is a sheet and there is no thickness.
        """
        if self.thickness is not None:
            surface = self._contour(solid, 0.5 * self.thickness)
            return surface, f"thickened to {self.thickness:g}"
        behind, ahead = solid.windings.beside(solid.triangles)
        areas = face_areas(solid.triangles)
        if areas[behind != ahead].sum() < BOUNDS * areas.sum():
            raise SourceError("the shape is a sheet, which bounds nothing", remedy="give it a thickness")
        if not self.contoured:
            try:
                return solid.surface(keep_faces=True, tolerance=self.tolerance), "faces kept"
            except GeometryError as error:
                reason = str(error).partition(":")[0]
                surface = self._contour(solid, 0.0)
                return surface, f"contoured, since {reason}"
        return self._contour(solid, 0.0), "contoured"

    def _contour(self, solid: Solid, level: float) -> TriangleMesh:
        return solid.surface(level, tolerance=self.tolerance, resolution=self.resolution, spacing=self.spacing)


def figures_of(surface: TriangleMesh, solid: Solid, level: float = 0.0) -> dict[str, object]:
    """Counts and sizes of a closed surface, and its distances from the faces of a solid and back.

    `to_faces` is the largest distance from the surface, but where it lies on the completion, to its level around the
    faces that were given; `from_faces` that from faces that bound the solid to the surface, less the level.
    """
    corners = surface.vertices[surface.faces]
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    parts = element_components(surface.faces)
    behind, ahead = solid.windings.beside(solid.triangles)
    bounds = (behind != ahead) | (level > 0)
    given, made = solid.triangles[bounds & (solid.origins >= 0)], solid.triangles[bounds & (solid.origins < 0)]
    closest = solid.closest(_places(corners))
    off = np.abs(closest.distances - level)[~closest.completed]
    back = _tree(corners).distances(_places(given)) - level if len(given) else np.zeros(1)
    return {
        "bodies": int((np.bincount(parts, volumes) > 0).sum()),
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
        "volume": float(volumes.sum()),
        "area": float(face_areas(corners).sum()),
        "openings": _openings(made),
        "completed_area": float(face_areas(made).sum()),
        "to_faces": float(off.max(initial=0.0)),
        "from_faces": float(np.abs(back).max(initial=0.0)),
        "self_intersections": len(self_intersections(surface.vertices, surface.faces)),
    }


def in_words(figures: dict[str, object]) -> str:
    """One line of what `figures_of` found."""
    bodies, openings, meeting = (figures[key] for key in ("bodies", "openings", "self_intersections"))
    share = 100 * float(str(figures["completed_area"])) / max(float(str(figures["area"])), 1e-300)
    return (
        f"{bodies} {'body' if bodies == 1 else 'bodies'}, volume {figures['volume']:.4g}, {figures['faces']} faces, "
        f"{openings} {'opening' if openings == 1 else 'openings'} completed ({share:.2g} % of the area), "
        f"{figures['to_faces']:.2g} from the faces and {figures['from_faces']:.2g} back at most, "
        f"{meeting or 'no'} self-intersections; {figures['way']}"
    )


def _places(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    places: NDArray[np.float64] = np.einsum("pk,mkj->mpj", PARTS, triangles).reshape(-1, 3)
    return places


def _tree(triangles: NDArray[np.float64]) -> FaceTree:
    return FaceTree.of(FaceFeatures.of(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)))


def _openings(completion: NDArray[np.float64]) -> int:
    """Connected parts of what completes."""
    if not len(completion):
        return 0
    _, faces = np.unique(completion.reshape(-1, 3), axis=0, return_inverse=True)
    return int(element_components(faces.reshape(-1, 3)).max()) + 1
