"""Our functions beside those of packages whose tests and examples run but compare nothing.

Each call is made of both; what they return is compared, and theirs goes on. ``python held.py FILE`` runs a file of
examples so, without its pictures.
"""

from __future__ import annotations

import os
import runpy
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial, wraps
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np

import signedheat as sh
from signedheat.search.winding_tree import WindingTree
from signedheat.solids.completion import complete
from signedheat.surfaces.source_segments import curve_of_elements

Pairs = list[tuple[Any, Any]]
"""What ours and theirs return."""

EQUAL = 1e-6
"""By the same definition, over the range: 1e−9 in tests/surfaces/, on meshes without slivers."""
NEAR = 0.1
"""Where one of both approximates: heat and fast marching are so much off on meshes of 2,500 faces."""


class NotOurs(Exception):
    """Why a call has nothing of ours to be compared with."""


def difference(ours: Any, theirs: Any) -> tuple[float, int]:
    """The largest difference, over the range of theirs, with the sign that fits better; and how many of ours are NaN.

    Of polygons and of points theirs has the other sign than of meshes.
    """
    theirs = np.asarray(theirs, dtype=float)
    ours = np.asarray(ours, dtype=float).reshape(theirs.shape)
    size = float(np.ptp(theirs)) or float(np.abs(theirs).max()) or 1.0
    return float(min(np.nanmax(np.abs(ours - theirs)), np.nanmax(np.abs(ours + theirs)))) / size, int(
        np.isnan(ours).sum()
    )


def held(name: str, theirs: Callable[..., Any], ours: Callable[..., Pairs], tolerance: float) -> Callable[..., Any]:
    """A function of theirs that prints how ours compares; `ours` is given what theirs returned, then its arguments."""

    def compared(answer: Any, *arguments: Any, **options: Any) -> tuple[str, str]:
        try:
            off, missing = max(difference(*pair) for pair in ours(answer, *arguments, **options))
        except NotOurs as error:
            return "not ours", str(error)
        except Exception as error:
            return "failed", f"{type(error).__name__}: {error}"
        what = f"off by {off:.1e} of the range, at most {tolerance:g}" + (f"; {missing} NaN" if missing else "")
        return ("passed" if off <= tolerance and not missing else "failed"), what

    @wraps(theirs)
    def both(*arguments: Any, **options: Any) -> Any:
        answer = theirs(*arguments, **options)
        outcome, why = compared(answer, *arguments, **options)
        test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition("::")[2].partition(" ")[0]
        where = f"line {sys._getframe(1).f_lineno}: {name}" + (f" in {test}" if test else "")
        print("\nCONFORMANCE", where, outcome, True, f"{why:.150}".replace("\n", " "), sep="\t", flush=True)
        return answer

    return both


# potpourri3d


def constraint_of(
    word: str, weight: float
) -> sh.constraints.Free | sh.constraints.ZeroSet | sh.constraints.EachComponent:
    if weight > 0:
        raise NotOurs("its soft constraint pulls to the first node of a curve")
    words: dict[str, sh.constraints.Free | sh.constraints.ZeroSet | sh.constraints.EachComponent] = {
        "none": sh.constraints.Free(),
        "zeroset": sh.constraints.ZeroSet(hard=True),
        "multiple": sh.constraints.EachComponent(hard=True),
    }
    return words[word.lower()]


def mesh_signed(
    mesh: Any,
    answer: Any,
    curves: Any,
    curve_signs: Any = (),
    points: Any = (),
    preserve_source_normals: bool = False,
    level_set_constraint: str = "ZeroSet",
    soft_level_set_weight: float = -1.0,
) -> Pairs:
    if preserve_source_normals:
        raise NotOurs("normals of the source that are kept")
    given: list[Any] = [curve_of_elements(mesh, curve) for curve in curves]
    signs = curve_signs or [True] * len(given)
    sources = [
        *(replace(curve, oriented=bool(sign)) for curve, sign in zip(given, signs, strict=True)),
        *(curve_of_elements(mesh, [point]) for point in points),
    ]
    constraint = constraint_of(level_set_constraint, soft_level_set_weight)
    return [(sh.SignedHeatSolver(mesh, 1.0, intrinsic=False).distance(sources, constraint).values, answer)]


def polygon_signed(mesh: Any, answer: Any, curves: Any, level_set_constraint: str = "ZeroSet") -> Pairs:
    constraint = constraint_of(level_set_constraint, -1.0)
    ours = sh.SignedHeatSolver(mesh, 1.0).distance([mesh.path(curve) for curve in curves], constraint)
    return [(ours.values, answer)]


def cloud_signed(
    cloud: Any,
    answer: Any,
    curves: Any,
    normals: Any,
    preserve_source_normals: bool = False,
    level_set_constraint: str = "ZeroSet",
    soft_level_set_weight: float = -1.0,
) -> Pairs:
    constraint = constraint_of(level_set_constraint, soft_level_set_weight)
    cloud = sh.PointCloud(cloud.points, normals)
    ours = sh.SignedHeatSolver(cloud, 1.0).distance([cloud.path(curve) for curve in curves], constraint)
    return [(ours.values, answer)]


def from_vertices(domain: Any, answer: Any, vertices: Any) -> Pairs:
    """Distance from points: exact on meshes, by the method elsewhere."""
    points = domain.points_at(np.atleast_1d(vertices))
    if isinstance(domain, sh.TriangleMesh):
        return [(sh.signed_distance(points, domain).values, answer)]
    return [(sh.SignedHeatSolver(domain).distance(points).values, answer)]


def marched(mesh: Any, answer: Any, curves: Any, distances: Any = (), sign: bool = False) -> Pairs:
    if len(distances) or not sign:
        raise NotOurs("distances to begin with")
    return [(sh.signed_distance([curve_of_elements(mesh, curve) for curve in curves], mesh).values, answer)]


def install_potpourri3d() -> None:
    peer: Any = import_module("potpourri3d")

    def solver(name: str, domain: Callable[..., Any], **methods: tuple[Callable[..., Pairs], float]) -> None:
        theirs = getattr(peer, name)

        @wraps(theirs)
        def made(*arguments: Any, **options: Any) -> Any:
            whole, of = theirs(*arguments, **options), domain(*arguments)
            for method, (ours, tolerance) in methods.items():
                bound = held(f"{name}.{method}", getattr(whole, method), partial(ours, of), tolerance)
                setattr(whole, method, bound)
            return whole

        setattr(peer, name, made)

    def once(answer: Any, vertices: Any, faces: Any, source: Any) -> Pairs:
        return from_vertices(sh.TriangleMesh(vertices, faces), answer, source)

    def areas(answer: Any, vertices: Any, faces: Any) -> Pairs:
        return [(sh.TriangleMesh(vertices, faces).face_areas, answer)]

    unsigned = (from_vertices, NEAR)
    several = {"compute_distance": unsigned, "compute_distance_multisource": unsigned}
    solver("MeshSignedHeatSolver", sh.TriangleMesh, compute_distance=(mesh_signed, EQUAL))
    solver("MeshHeatMethodDistanceSolver", sh.TriangleMesh, **several)
    solver("MeshFastMarchingDistanceSolver", sh.TriangleMesh, compute_distance=(marched, NEAR))
    solver(
        "PolygonMeshHeatSolver",
        sh.PolygonMesh,
        compute_distance=unsigned,
        compute_signed_distance=(polygon_signed, EQUAL),
    )
    solver("PointCloudHeatSolver", sh.PointCloud, **several, compute_signed_distance=(cloud_signed, EQUAL))
    for name in several:
        setattr(peer, name, held(name, getattr(peer, name), once, NEAR))
    peer.face_areas = held("face_areas", peer.face_areas, areas, EQUAL)


# libigl's Python bindings


def igl_nearest(answer: Any, points: Any, vertices: Any, faces: Any) -> Pairs:
    """Faces may be equally near, so that only places are compared."""
    found = complete((vertices, faces), as_oriented=True).closest(points)
    return [(found.distances**2, answer[0]), (found.points, answer[2])]


def igl_winding(answer: Any, vertices: Any, faces: Any, points: Any) -> Pairs:
    points = np.atleast_2d(np.asarray(points, dtype=float))
    off = complete((vertices, faces), as_oriented=True).closest(points).distances > 0  # on faces there are two values
    return [(WindingTree.of(vertices[faces]).numbers(points[off]), np.atleast_1d(answer)[off])]


def igl_distance(answer: Any, points: Any, vertices: Any, faces: Any, **options: Any) -> Pairs:
    shape = complete((vertices, faces), as_oriented=True)
    if not shape.bounding.any():
        raise NotOurs("open sheets have no inside here, and theirs multiplies by winding numbers")
    return [(shape.distance(points), answer[0]), (shape.closest(points).points, answer[2])]


def igl_geodesic(answer: Any, vertices: Any, faces: Any, VS: Any, VT: Any, **options: Any) -> Pairs:
    mesh = sh.TriangleMesh(vertices, faces)
    return [(sh.signed_distance(mesh.points_at(VS), mesh).values[VT], answer)]


def install_igl() -> None:
    peer: Any = import_module("igl")
    for name, ours, tolerance in (
        ("point_mesh_squared_distance", igl_nearest, EQUAL),
        ("winding_number", igl_winding, NEAR),
        ("fast_winding_number", igl_winding, NEAR),
        ("signed_distance", igl_distance, EQUAL),
        ("exact_geodesic", igl_geodesic, EQUAL),
    ):
        setattr(peer, name, held(name, getattr(peer, name), ours, tolerance))


def main(path: Path) -> None:
    """Run a file of examples of potpourri3d, from its folder."""
    if find_spec("polyscope") is None:
        sys.modules["polyscope"] = MagicMock()
    install_potpourri3d()
    os.chdir(path.parent)
    runpy.run_path(str(path))


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
