"""The calls of each package that `features.py` tries, as its documentation names them."""

from __future__ import annotations

import numpy as np

import signedheat as sh
from peers.cases import arcs, box, globe, globe_triangles, outline, plane_points, ring, sheet, triangles, volume


def surface_of(polydata: object) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a PyVista mesh."""
    mesh = polydata.triangulate()
    return np.asarray(mesh.points), np.asarray(mesh.regular_faces)


# signedheat


def our_field(shape: object) -> sh.Field[sh.Grid]:
    return sh.signed_distance(shape, resolution=96, padding=0.35)


def our_offset(shape: sh.TriangleMesh, distance: float) -> tuple[np.ndarray, np.ndarray]:
    surface = our_field(shape).offset(distance)
    return surface.vertices, surface.faces


def our_wall() -> tuple[np.ndarray, np.ndarray]:
    wall = sh.morphology.thicken(sheet(), 0.05, resolution=128)
    return wall.vertices, wall.faces


def our_boolean() -> float:
    grid = sh.Grid((-0.7,) * 3, 1.6 / 95, (96,) * 3)
    return volume(
        (sh.signed_distance(box(0.5), grid) - sh.signed_distance(box(0.25, (0.5, 0.1, 0.05)), grid)).contour()
    )


def our_plane(share: float) -> np.ndarray:
    lines = [sh.Polyline(line) for line in outline(share)]
    return sh.sharpen(sh.SignedHeatSolver(sh.Grid((-1.6, -1.6), 3.2 / 199, (200, 200))).distance(lines))(plane_points())


def our_polygons(share: float) -> np.ndarray:
    mesh = sh.PolygonMesh(*globe())
    return sh.sharpen(sh.SignedHeatSolver(mesh).distance([mesh.path(arc) for arc in arcs(share)])).values


def our_points(share: float) -> np.ndarray:
    cloud = sh.PointCloud(globe()[0])
    return sh.sharpen(sh.SignedHeatSolver(cloud).distance([cloud.path(arc) for arc in arcs(share)])).values


def our_curve(share: float) -> np.ndarray:
    mesh = globe_triangles()
    return sh.signed_distance([mesh.path(arc) for arc in arcs(share)], mesh).values


OURS = {
    "distance at points": lambda shape, points: our_field(shape).closest(points).distances,
    "points": lambda cloud, points: our_field(cloud)(points),
    "bare points": lambda cloud, points: our_field(sh.PointCloud(cloud.points))(points),
    "offset surface": our_offset,
    "thicken": our_wall,
    "boolean": our_boolean,
    "plane whole": our_plane,
    "plane": our_plane,
    "geodesic": lambda: sh.signed_distance(globe_triangles().points_at(int(ring()[0])), globe_triangles()).values,
    "curve": our_curve,
    "broken curve": our_curve,
    "polygons": our_polygons,
    "surface points": our_points,
}


# potpourri3d


def potpourri_point() -> np.ndarray:
    import potpourri3d

    return potpourri3d.MeshHeatMethodDistanceSolver(*triangles(globe_triangles())).compute_distance(int(ring()[0]))


def potpourri_curve(share: float) -> np.ndarray:
    import potpourri3d

    return potpourri3d.MeshSignedHeatSolver(*triangles(globe_triangles())).compute_distance(
        [[(v, []) for v in arc] for arc in arcs(share)]
    )


def potpourri_polygons(share: float) -> np.ndarray:
    import potpourri3d

    return potpourri3d.PolygonMeshHeatSolver(*globe()).compute_signed_distance(arcs(share))


def potpourri_points(share: float) -> np.ndarray:
    import potpourri3d

    solver = potpourri3d.PointCloudHeatSolver(globe()[0])
    return solver.compute_signed_distance(arcs(share), globe()[0])


POTPOURRI3D = {
    "geodesic": potpourri_point,
    "curve": potpourri_curve,
    "broken curve": potpourri_curve,
    "polygons": potpourri_polygons,
    "surface points": potpourri_points,
}


# libigl


def igl_distance(shape: sh.TriangleMesh, points: np.ndarray) -> np.ndarray:
    import igl

    vertices, faces = triangles(shape)
    unsigned = np.sqrt(igl.point_mesh_squared_distance(points, vertices, faces)[0])
    return np.where(np.asarray(igl.fast_winding_number(vertices, faces, points)) > 0.5, -unsigned, unsigned)


def igl_offset(shape: sh.TriangleMesh, distance: float) -> tuple[np.ndarray, np.ndarray]:
    import igl

    sign = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_FAST_WINDING_NUMBER
    return igl.offset_surface(*triangles(shape), distance, 96, sign)[:2]


def igl_geodesic() -> np.ndarray:
    import igl

    vertices, faces = triangles(globe_triangles())
    return igl.exact_geodesic(vertices, faces, VS=ring()[:1].astype(np.int64), VT=np.arange(len(vertices)))


LIBIGL = {"distance at points": igl_distance, "offset surface": igl_offset, "geodesic": igl_geodesic}


# MeshLib


def meshlib_mesh(shape: sh.TriangleMesh) -> object:
    from meshlib import mrmeshnumpy

    vertices, faces = triangles(shape)
    return mrmeshnumpy.meshFromFacesVerts(faces.astype(np.int32), vertices)


def meshlib_arrays(mesh: object) -> tuple[np.ndarray, np.ndarray]:
    from meshlib import mrmeshnumpy

    return mrmeshnumpy.getNumpyVerts(mesh), mrmeshnumpy.getNumpyFaces(mesh.topology)


def meshlib_at(mesh: object, points: np.ndarray) -> np.ndarray:
    """With the sign of winding numbers, which MeshLib advises for meshes with holes."""
    from meshlib import mrmeshpy

    options = mrmeshpy.SignedDistanceToMeshOptions()
    options.signMode = mrmeshpy.SignDetectionMode.HoleWindingRule
    part = mrmeshpy.MeshPart(mesh)
    return np.array(
        [mrmeshpy.signedDistanceToMesh(part, mrmeshpy.Vector3f(*point), options) for point in points.tolist()]
    )


def meshlib_points(cloud: sh.PointCloud, points: np.ndarray) -> np.ndarray:
    from meshlib import mrmeshnumpy, mrmeshpy

    given = np.array(cloud.points), np.array(cloud.normals)
    return meshlib_at(mrmeshpy.triangulatePointCloud(mrmeshnumpy.pointCloudFromPoints(*given)), points)


def meshlib_bare_points(cloud: sh.PointCloud, points: np.ndarray) -> np.ndarray:
    from meshlib import mrmeshnumpy, mrmeshpy

    bare = mrmeshnumpy.pointCloudFromPoints(np.array(cloud.points))
    return meshlib_at(mrmeshpy.triangulatePointCloud(bare), points)


def meshlib_settings(sign: str) -> object:
    from meshlib import mrmeshpy

    settings = mrmeshpy.GeneralOffsetParameters()
    settings.voxelSize = 2.8 / 96
    settings.signDetectionMode = getattr(mrmeshpy.SignDetectionMode, sign)
    return settings


def meshlib_offset(shape: sh.TriangleMesh, distance: float) -> tuple[np.ndarray, np.ndarray]:
    from meshlib import mrmeshpy

    return meshlib_arrays(
        mrmeshpy.generalOffsetMesh(meshlib_mesh(shape), distance, meshlib_settings("HoleWindingRule"))
    )


def meshlib_wall() -> tuple[np.ndarray, np.ndarray]:
    from meshlib import mrmeshpy

    return meshlib_arrays(mrmeshpy.generalOffsetMesh(meshlib_mesh(sheet()), 0.05, meshlib_settings("Unsigned")))


def meshlib_boolean() -> float:
    from meshlib import mrmeshpy

    operation = mrmeshpy.BooleanOperation.DifferenceAB
    return mrmeshpy.boolean(meshlib_mesh(box(0.5)), meshlib_mesh(box(0.25, (0.5, 0.1, 0.05))), operation).mesh.volume()


def meshlib_geodesic() -> np.ndarray:
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = meshlib_mesh(globe_triangles())
    start = np.zeros(len(globe()[0]), dtype=bool)
    start[ring()[0]] = True
    found = mrmeshpy.computeSurfaceDistances(mesh, mrmeshnumpy.vertBitSetFromBools(start))
    return np.array([found.vec[k] for k in range(len(start))])


MESHLIB = {
    "distance at points": lambda shape, points: meshlib_at(meshlib_mesh(shape), points),
    "points": meshlib_points,
    "bare points": meshlib_bare_points,
    "offset surface": meshlib_offset,
    "thicken": meshlib_wall,
    "boolean": meshlib_boolean,
    "geodesic": meshlib_geodesic,
}


# trimesh


def trimesh_mesh(shape: sh.TriangleMesh) -> object:
    import trimesh

    return trimesh.Trimesh(*triangles(shape), process=False)


def trimesh_distance(shape: sh.TriangleMesh, points: np.ndarray) -> np.ndarray:
    import trimesh

    return -trimesh.proximity.signed_distance(trimesh_mesh(shape), points)


def trimesh_boolean() -> float:
    import trimesh

    return trimesh.boolean.difference([trimesh_mesh(box(0.5)), trimesh_mesh(box(0.25, (0.5, 0.1, 0.05)))]).volume


TRIMESH = {"distance at points": trimesh_distance, "boolean": trimesh_boolean}


# PyVista


def pyvista_mesh(shape: sh.TriangleMesh) -> object:
    import pyvista

    return pyvista.PolyData.from_regular_faces(*triangles(shape))


def pyvista_at(mesh: object, points: np.ndarray) -> np.ndarray:
    import pyvista

    return np.asarray(pyvista.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"])


def pyvista_points(cloud: sh.PointCloud, points: np.ndarray) -> np.ndarray:
    import pyvista

    given = pyvista.PolyData(np.array(cloud.points))
    given["Normals"] = np.array(cloud.normals)
    given.GetPointData().SetActiveNormals("Normals")
    return pyvista_at(given.reconstruct_surface(), points)


def pyvista_bare_points(cloud: sh.PointCloud, points: np.ndarray) -> np.ndarray:
    import pyvista

    return pyvista_at(pyvista.PolyData(np.array(cloud.points)).reconstruct_surface(), points)


def pyvista_offset(shape: sh.TriangleMesh, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Implicit distance on a grid, contoured, as its gallery does."""
    import pyvista

    low, high = shape.vertices.min(axis=0) - 0.35, shape.vertices.max(axis=0) + 0.35
    spacing = (high - low).max() / 95
    n = np.ceil((high - low) / spacing).astype(int) + 1
    grid = pyvista.ImageData(dimensions=tuple(n), spacing=(spacing,) * 3, origin=tuple(low))
    grid = grid.compute_implicit_distance(pyvista_mesh(shape))
    return surface_of(grid.contour([distance], scalars="implicit_distance"))


def pyvista_boolean() -> float:
    return pyvista_mesh(box(0.5)).boolean_difference(pyvista_mesh(box(0.25, (0.5, 0.1, 0.05)))).volume


PYVISTA = {
    "distance at points": lambda shape, points: pyvista_at(pyvista_mesh(shape), points),
    "points": pyvista_points,
    "bare points": pyvista_bare_points,
    "offset surface": pyvista_offset,
    "boolean": pyvista_boolean,
}


# gpytoolbox


def gpytoolbox_distance(shape: sh.TriangleMesh, points: np.ndarray) -> np.ndarray:
    import gpytoolbox

    return gpytoolbox.signed_distance(points, *triangles(shape))[0]


def gpytoolbox_points(cloud: sh.PointCloud, points: np.ndarray) -> np.ndarray:
    import gpytoolbox

    mesh = gpytoolbox.point_cloud_to_mesh(np.array(cloud.points), np.array(cloud.normals), psr_depth=7)
    return gpytoolbox.signed_distance(points, *mesh)[0]


def gpytoolbox_offset(shape: sh.TriangleMesh, distance: float) -> tuple[np.ndarray, np.ndarray]:
    import gpytoolbox

    return gpytoolbox.offset_surface(*triangles(shape), distance, grid_size=96)


def gpytoolbox_plane(share: float) -> np.ndarray:
    """Polylines: vertices and the segments between them."""
    import gpytoolbox

    lines = [line[::-1] for line in outline(share)]  # its inside is to the left
    starts = np.cumsum([0] + [len(line) for line in lines])
    segments = [[s + k, s + k + 1] for s, line in zip(starts, lines, strict=False) for k in range(len(line) - 1)]
    return gpytoolbox.signed_distance(plane_points(), np.concatenate(lines), np.array(segments))[0]


GPYTOOLBOX = {
    "distance at points": gpytoolbox_distance,
    "points": gpytoolbox_points,
    "offset surface": gpytoolbox_offset,
    "plane whole": gpytoolbox_plane,
    "plane": gpytoolbox_plane,
}

CALLS = {
    "signedheat": OURS,
    "potpourri3d": POTPOURRI3D,
    "libigl": LIBIGL,
    "meshlib": MESHLIB,
    "trimesh": TRIMESH,
    "pyvista": PYVISTA,
    "gpytoolbox": GPYTOOLBOX,
}
