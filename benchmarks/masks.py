"""Smooth surfaces of masks, beside marching cubes of blurred masks (scikit-image) and VTK's surface nets.

    python benchmarks/masks.py [--voxels 32 64 96]

Balls, ellipsoids, tori and boxes, turned and along the axes, of nine tenths of that many voxels. Normals: mean angle to
those of the shape, over the area, and the angle that 95 % of the area are below. Distances of the middles of triangles
to the shape, in voxels: root mean square, mean (negative inside), largest. Lost: voxels whose centres are on the other
side. Meeting: pairs of triangles that pass through each other, in single precision.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import scipy
from skimage.measure import marching_cubes

import signedheat as sh
from signedheat.mesh.self_intersections import self_intersections

Height = Callable[[np.ndarray], np.ndarray]
TURN = scipy.spatial.transform.Rotation.random(random_state=3).as_matrix()


def ball(n: int, x: np.ndarray) -> np.ndarray:
    return np.linalg.norm(x, axis=-1) - 0.42 * n


def ellipsoid(n: int, x: np.ndarray) -> np.ndarray:
    """Distance to first order."""
    axes = n * np.array([0.42, 0.3, 0.2])
    length = np.linalg.norm(x / axes, axis=-1)
    return (length - 1) * length / np.maximum(np.linalg.norm(x / axes**2, axis=-1), 1e-9)


def torus(n: int, x: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(x @ TURN, -1, 0)
    return np.hypot(np.hypot(a, b) - 0.28 * n, c) - 0.13 * n


def box(n: int, x: np.ndarray, turn: np.ndarray = TURN) -> np.ndarray:
    beyond = np.abs(x @ turn) - n * np.array([0.3, 0.22, 0.15])
    return np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0)


SHAPES: dict[str, Callable[[int, np.ndarray], np.ndarray]] = {
    "ball": ball,
    "ellipsoid": ellipsoid,
    "torus": torus,
    "turned box": box,
    "box along the axes": partial(box, turn=np.eye(3)),
}


def ours(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    surface = sh.DigitalSurface(mask).smooth_surface
    return surface.vertices, surface.faces


def blurred(mask: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    values = scipy.ndimage.gaussian_filter(np.pad(mask, 4).astype(float), width)
    vertices, faces, _, _ = marching_cubes(values, 0.5, gradient_direction="ascent")
    return vertices - 4.0, faces[:, ::-1]


def nets(mask: np.ndarray, times: int) -> tuple[np.ndarray, np.ndarray]:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    padded = np.pad(mask, 1).astype(np.uint8)
    image = vtk.vtkImageData()
    image.SetDimensions(padded.shape)
    image.GetPointData().SetScalars(numpy_to_vtk(padded.ravel(order="F"), deep=True))
    made = vtk.vtkSurfaceNets3D()
    made.SetInputData(image)
    made.SetValue(0, 1)
    made.SetNumberOfIterations(times)
    made.SetOutputMeshTypeToTriangles()
    made.Update()
    result = made.GetOutput()
    faces = vtk_to_numpy(result.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(result.GetPoints().GetData()).astype(float) - 1, faces


PROGRAMS = {
    "smooth_surface": ours,
    "marching cubes, blurred by 1": partial(blurred, width=1.0),
    "marching cubes, blurred by 2": partial(blurred, width=2.0),
    "VTK nets, 16 times": partial(nets, times=16),
    "VTK nets, 100 times": partial(nets, times=100),
}


def figures(vertices: np.ndarray, faces: np.ndarray, height: Height, centres: np.ndarray) -> list[float]:
    if np.einsum("ij,ij->", vertices[faces[:, 0]], np.cross(vertices[faces[:, 1]], vertices[faces[:, 2]])) < 0:
        faces = faces[:, ::-1]
    corners = vertices[faces]
    middles, areas = corners.mean(axis=1), np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    slopes = np.stack([height(middles + step) - height(middles - step) for step in 1e-4 * np.eye(3)], axis=1)
    weights = np.linalg.norm(areas, axis=1)
    cosines = (areas * slopes).sum(axis=1) / np.maximum(weights * np.linalg.norm(slopes, axis=1), 1e-300)
    angles = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    order = np.argsort(angles)
    shares = np.cumsum(weights[order]) / weights.sum()
    off = height(middles)
    rounded = vertices.astype(np.float32).astype(np.float64)
    inside = sh.complete(sh.TriangleMesh(vertices, faces), as_oriented=True).inside(centres)
    return [
        float(np.average(angles, weights=weights)),
        float(angles[order][np.searchsorted(shares, 0.95)]),
        float(np.sqrt(np.average(off**2, weights=weights))),
        float(np.average(off, weights=weights)),
        float(np.abs(off).max()),
        int((inside != (height(centres) < 0)).sum()),
        len(self_intersections(rounded, faces)),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--voxels", type=int, nargs="*", default=[32, 64, 96])
    for n in parser.parse_args().voxels:
        middle = (n - 1) / 2 + np.array([0.13, 0.37, 0.21])
        centres = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3).astype(float)
        for name, shape in SHAPES.items():
            print(f"\n| {name}, {n} | normals ° | 95 % | rms | mean | largest | lost | meeting | seconds |")
            print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")

            def height(x: np.ndarray, n: int = n, shape=shape, middle=middle) -> np.ndarray:  # type: ignore[no-untyped-def]
                return shape(n, x - middle)

            mask = (height(centres) < 0).reshape(n, n, n)
            for program, make in PROGRAMS.items():
                begin = time.perf_counter()
                vertices, faces = make(mask)
                seconds = time.perf_counter() - begin
                mean, most, rms, bias, far, lost, meeting = figures(vertices, faces, height, centres)
                print(
                    f"| {program} | {mean:.2f} | {most:.1f} | {rms:.3f} | {bias:+.3f} | {far:.2f} | {lost} | {meeting} "
                    f"| {seconds:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
