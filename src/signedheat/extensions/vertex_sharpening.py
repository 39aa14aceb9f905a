"""Sharpening of distance on the vertices of a surface (Sec. 7.3).

The heat method errs by a smooth amount that shrinks slowly with the mesh. Two ways to take most of it away.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ..discretization import discretize
from ..errors import OutsideError, SourceError
from ..fields.vertex_field import VertexField
from ..linear import factorize, upper_triangle
from ..lowering.surface import SurfaceDiscretization
from ..operators.cotan import cotan_matrix, divergence
from ..operators.laid_out_triangles import LaidOutTriangles
from .sharpening import sharpen

_SPRING = 1e7  # of the Dirichlet condition, times the largest diagonal entry of C

Progress = Callable[[float, str], None]


class Method(Protocol):
    """A way to sharpen."""

    def sharpened(
        self, surface: SurfaceDiscretization, values: NDArray[np.float64], source: Any, progress: Progress | None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """New values at the vertices of the surface's triangles from old ones, and notes for the diagnostics."""


@dataclass(frozen=True)
class Geodesic:
    """Distance along the surface from the zero set of φ, with the signs of φ. The default.

    Follows straight lines across the faces, as on the polyhedral surface itself, whatever the shape of its triangles.
    Keeps the zero set of φ to the last bit, and so its faults: where a long diffusion left a wrong sign, it stays.

    Parameters
    ----------
    tolerance : float
        Neighbouring waves on an edge are made one where that changes distances by less than this fraction of the
        edge. 0 is exact, and takes time that grows like the number of faces to the power of 1.5.

    Examples
    --------
    >>> Geodesic()
    Geodesic(tolerance=0.0001)
    """

    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if not 0 <= self.tolerance < 0.1:
            raise ValueError(f"tolerance must be at least 0 and below 0.1, not {self.tolerance}")

    def sharpened(
        self, surface: SurfaceDiscretization, values: NDArray[np.float64], source: Any, progress: Progress | None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        from ..operators.exact_geodesics import distance_to_zero_line

        distance, n_windows = distance_to_zero_line(surface.triangles, values, self.tolerance)
        if not np.isfinite(distance).any():
            raise OutsideError(
                "the field has one sign everywhere, hence no zero set to measure from: use method=Convex(), "
                "which measures from the source"
            )
        distance = np.where(np.isfinite(distance), distance, np.abs(values))
        signed = np.where(np.isnan(values), np.nan, np.copysign(distance, values))
        refuse_unless_on_zero_line(source, values, signed, surface.spacing)
        return signed, {"windows": n_windows}


@dataclass(frozen=True)
class Convex:
    """``max Σ A_i sign(φ⁰_i) φ_i`` where ``|∇φ| ≤ 1`` in every face and φ = 0 on the source, by ADMM (Eq. 18).

    Repairs wrong signs that a long diffusion left. Biased low, since a slope of at most one in every face is a lower
    bound on distance: on fine meshes `Geodesic` is far more accurate. The factor serves every round (Belyaev & Fayolle
    2020).

    Parameters
    ----------
    tolerance : float
        Stop when the root mean squares of both residuals, which are slopes, are below this.
    max_rounds : int
        Stop in any case; the diagnostics tell the residuals.
    relaxation : float
        Over-relaxation, from 1 to below 2.

    Examples
    --------
    >>> Convex(tolerance=1e-3)
    Convex(tolerance=0.001, max_rounds=200, relaxation=1.6)
    """

    tolerance: float = 2e-3
    max_rounds: int = 200
    relaxation: float = 1.6

    def __post_init__(self) -> None:
        if not (self.tolerance > 0 and self.max_rounds > 0 and 1 <= self.relaxation < 2):
            raise ValueError(f"tolerance and max_rounds must be positive, relaxation in [1, 2): not {self}")

    def sharpened(
        self, surface: SurfaceDiscretization, values: NDArray[np.float64], source: Any, progress: Progress | None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        from threadpoolctl import threadpool_limits

        triangles, rows = surface.triangles, getattr(source, "rows", None)
        if rows is None or rows.shape[1] != triangles.n_vertices:
            raise SourceError(
                "the convex method holds φ at the source, and this field has none on the vertices of its surface: "
                "pass what SignedHeatSolver.distance returned, for oriented sources"
            )
        known = np.isfinite(values)
        area = triangles.face_areas
        pull = np.bincount(triangles.corner_vertices.ravel(), np.repeat(area / 3.0, 3), triangles.n_vertices)
        stiffness = cotan_matrix(triangles)
        spring = _SPRING * stiffness.diagonal().max()
        held = sparse.csr_matrix(stiffness + upper_triangle(spring * (rows.T @ rows)))
        with threadpool_limits(1, "blas"):  # threads cost a triangular solve of this size more than they bring
            factor = factorize(held + sparse.diags_array(np.where(known, 0.0, stiffness.diagonal() + 1.0)))

            phi = np.nan_to_num(values)
            stiff = np.ptp(phi)
            pull *= np.sign(phi) / stiff
            relaxed = slope = slopes(triangles, phi)
            dual = np.zeros_like(slope)
            limited = at_most_one(slope)
            total, number, residual = area.sum(), 0, np.inf
            while number < self.max_rounds and residual > self.tolerance:
                before, limited = limited, at_most_one(relaxed + dual)
                dual += relaxed - limited
                phi = factor.solve(pull + divergence(triangles, limited - dual))
                slope = slopes(triangles, phi)
                relaxed = self.relaxation * slope + (1.0 - self.relaxation) * limited
                primal = np.sqrt(area @ np.abs(slope - limited) ** 2 / total)
                residual = max(primal, np.sqrt(area @ np.abs(limited - before) ** 2 / total))
                number += 1
                if progress is not None:
                    progress(number / self.max_rounds, "sharpen")
        return np.where(known, phi, np.nan), {"rounds": number, "residual": float(residual)}


@sharpen.register
def _(field: VertexField, method: Method | None = None, progress: Progress | None = None) -> VertexField:
    """Distance on a surface with slope one, or nearer to it.

    ``diagnostics.notes`` gains `slope_error_before` and `slope_error_after`, the root mean square of ``|∇φ| − 1`` over
    the surface, and those of the method.
    """
    method = Geodesic() if method is None else method
    begin = time.perf_counter()
    if progress is not None:
        progress(0.0, "sharpen")
    surface = discretize(field.domain)
    if not isinstance(surface, SurfaceDiscretization):
        raise TypeError(f"a field on a {type(field.domain).__name__} cannot be sharpened: its domain is no surface")
    old = at_triangles(surface, field)
    new, notes = method.sharpened(surface, old, field.source, progress)
    before, after = slope_error(surface.triangles, old), slope_error(surface.triangles, new)
    values = new if surface.restriction is None else new[surface.restriction]
    if progress is not None:
        progress(1.0, "done")
    diagnostics = replace(
        field.diagnostics,
        timings={**field.diagnostics.timings, "sharpen": time.perf_counter() - begin},
        notes={**field.diagnostics.notes, "slope_error_before": before, "slope_error_after": after, **notes},
    )
    return replace(field, values=values, diagnostics=diagnostics)


def at_triangles(surface: SurfaceDiscretization, field: VertexField) -> NDArray[np.float64]:
    """Values at the vertices of the surface's triangles; averages at those that the domain does not have."""
    n = surface.triangles.n_vertices
    if surface.restriction is None:
        return np.asarray(field.values)
    values = field.domain.on_triangulation(field.values)
    if len(values) != n:
        values = np.full(n, np.nan)
        values[surface.restriction] = field.values
    return values


def refuse_unless_on_zero_line(source: Any, old: NDArray[np.float64], new: NDArray[np.float64], spacing: float) -> None:
    """A source without sides, inside faces, may leave no zero line behind, and would be forgotten."""
    rows = getattr(source, "rows", None)
    if rows is None or (rows.shape[1] != len(old) and source.oriented):
        return
    missed = np.ones(1, dtype=bool)
    if rows.shape[1] == len(old):
        away = np.abs(rows @ new) > np.abs(rows @ old) + 4.0 * spacing
        whole = np.bincount(source.owners, source.weights)
        missed = np.bincount(source.owners, source.weights * away) > 0.5 * whole
        lone = np.bincount(source.owners) == 1
        missed |= lone & (np.bincount(source.owners, np.diff(rows.indptr) > 1) > 0)
    if missed.any():
        raise SourceError(
            f"source {int(np.argmax(missed))} is off the zero set of the field, as sources without sides may be inside "
            "faces: put it on edges and vertices, or use method=Convex(), which measures from the source"
        )


def slopes(triangles: LaidOutTriangles, values: NDArray[np.float64]) -> NDArray[np.complex128]:
    """(m,) ∇φ of each face, in its layout."""
    opposite = 1j * np.roll(triangles.edge_vectors, -1, axis=1)
    return (values[triangles.corner_vertices] * opposite).sum(axis=1) / (2.0 * triangles.face_areas)


def at_most_one(vectors: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Vectors longer than one cut to length one."""
    return vectors / np.maximum(np.abs(vectors), 1.0)


def slope_error(triangles: LaidOutTriangles, values: NDArray[np.float64]) -> float:
    """Root mean square of ``|∇φ| − 1`` over the faces at which φ is known."""
    error = (np.abs(slopes(triangles, values)) - 1.0) ** 2
    known = np.isfinite(error)
    return float(np.sqrt(np.average(error[known], weights=triangles.face_areas[known])))
