"""Sharpening to a shape on tets: exact distance where it is there, the zero set where it is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..diagnostics import Note, RoundCorners, SharpenedToShape
from ..discretization import Discretization, SourceTerm
from ..domains.point_cloud import PointCloud
from ..errors import SourceError
from ..geometry.face_features import FaceFeatures
from ..geometry.face_tree import FaceTree
from ..geometry.marching_tets import level_triangles
from ..jobs import run_cancellable
from ..lowering.tets.discretization import TetDiscretization
from ..operators.linear_elements import LinearElements
from ..progress import Progress
from ..solids.joining import Shape, joined_triangles
from .tet_distance import Surface, distance_around

NEAR = 2.0
"""Mean edges from a face within which its side decides the sign."""
FAR = 1.5
"""Mean edges: the zero set farther than that from any face stands for missing surface."""


@dataclass(frozen=True)
class ToShapes:
    """Distance to shapes, and to the zero set farther than `FAR` mean edges from all their faces.

    Within `NEAR` mean edges of a face its side decides the sign, where the shape is closed and consistent around the
    nearest place; elsewhere the field does.
    """

    parts: Sequence[Shape]

    def sharpened(
        self,
        discretization: Discretization,
        elements: LinearElements,
        values: NDArray[np.float64],
        source: SourceTerm | None,
        progress: Progress | None,
    ) -> tuple[NDArray[np.float64], tuple[Note, ...]]:
        """Sharpened values at the unknowns of tets; see `Method`."""
        assert isinstance(discretization, TetDiscretization)
        meshes = [part for part in self.parts if not isinstance(part, PointCloud)]
        if len(meshes) != len(self.parts):
            raise SourceError("fields on tets are sharpened to faces, and points have none", element="shape")
        center = discretization.planes.center
        features = FaceFeatures.of(*joined_triangles(meshes, center))
        points = discretization.mesh.vertices[discretization.vertices] - center
        positions, corners, owners = level_triangles(points, discretization.unknowns, values, 0.0)
        n_faces = len(features.rows)
        if n_faces:
            tree = FaceTree.of(features)
            missing = tree.distances(positions[corners].mean(axis=1)) > FAR * discretization.spacing
            corners, owners = corners[missing], owners[missing]
        else:
            missing = np.ones(len(corners), dtype=bool)
        if not n_faces and not len(corners):
            return np.copysign(np.inf, values), ()
        surface = Surface(
            np.concatenate([features.vertices, positions]),
            np.concatenate([features.faces, corners + len(features.vertices)]),
            np.concatenate([np.full(n_faces, -1), owners]),
        )
        report = None if progress is None else lambda: progress(0.0, "sharpen")
        found = run_cancellable(lambda: distance_around(discretization, points, values, surface), report)
        distance, behind = found.distances, values < 0
        if n_faces:
            nearest = tree.search(points)
            decided = nearest.regular & (nearest.distances < NEAR * discretization.spacing)
            decided &= (found.nearest < n_faces) & (found.distances <= nearest.distances * (1 + 1e-9))
            behind = np.where(decided, nearest.cosines < 0, behind)
        share = float(missing.mean()) if len(missing) else 0.0
        signed = np.where(np.isnan(values), np.nan, np.where(behind, -distance, distance))
        return signed, (RoundCorners(found.hidden), SharpenedToShape(share))
