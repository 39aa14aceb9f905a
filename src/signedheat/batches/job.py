"""Jobs for the shapes of a batch, and the measurement of closed meshes against the faces that were given."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from ..arrays import Floats
from ..constraints import Constraint, ZeroSet
from ..distances import grid_around, is_plain, measured_distance
from ..errors import (
    FileFormatError,
    InexactWarning,
    SignedHeatError,
    SourceError,
    UnsupportedTypeError,
)
from ..fields.field import Field
from ..grids.grid import RESOLUTION, Grid
from ..io.field_files import BAND_FORMATS, FIELD_FORMATS
from ..io.files import distinct_names, extension
from ..io.key_figures import describe, inspected, shape_figures
from ..io.numpy_files import write_npz
from ..io.scenes import METRES, scale_to, unit_of
from ..io.shape_files import SHAPE_FORMATS, read, save
from ..io.voxel_files import LABEL_FORMATS, read_labels
from ..mesh.components import element_components
from ..mesh.self_intersections import self_intersections
from ..mesh.triangles import face_areas, part_volumes
from ..mesh.welding import indexed
from ..search.face_tree import FaceTree
from ..shapes.kinds import ShapeLike
from ..shapes.transforms import transform
from ..solids.completion import Completing, Completion, Lids, complete
from ..solids.heat_surfaces import Heat
from ..solids.kept_faces import kept_surface
from ..solids.overlaps import Nesting
from ..solids.sample_set import NOISE_WIDTHS, Layout
from ..solids.sampling import refuse_odd_sampling, sample_distances, training_points
from ..solids.simplification import simplified
from ..solids.solid import Solid
from ..solver import checked
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import chosen, finite_number, flag, instance, positive_number, positive_steps, whole_number
from .inputs import Input


def _refuse_odd_grid(resolution: int, spacing: float | tuple[float, ...] | None, padding: float | None) -> None:
    """Raise an error if options of a grid around a shape in space are no numbers in their range."""
    whole_number(resolution, "resolution", 2)
    if spacing is not None:
        positive_steps(spacing, 3)
    if padding is not None:
        finite_number(padding, "padding", 0)


@dataclass(frozen=True)
class Sampling:
    """How to sample a shape (`sample_distances`) and store the samples (`Samples.save`).

    Attributes
    ----------
    n : int
        Number of points.
    near : float
        Fraction of the points near the surface.
    widths : tuple of float
        Standard deviations of the noise, relative to the radius of the shape.
    seed : int
        Seed of the random numbers.
    normalize : bool
        Whether to move and scale the samples so that the shape lies in the unit sphere.
    layout : "arrays" or "deepsdf"
        Layout of the file, as for `Samples.save`.

    See Also
    --------
    batches.Job : What is computed for each shape.
    sample_distances : Points with their distances, to learn from.

    Examples
    --------
    >>> Job(samples=Sampling(n=10_000, seed=3)).samples.near
    0.8
    """

    n: int = 250_000
    near: float = 0.8
    widths: tuple[float, ...] = NOISE_WIDTHS
    seed: int = 0
    normalize: bool = False
    layout: Layout = "arrays"

    def __post_init__(self) -> None:
        refuse_odd_sampling(self.n, self.near, self.widths, self.seed)
        flag(self.normalize, "normalize")
        chosen(self.layout, Layout, "layout")


@dataclass(frozen=True)
class Job:
    """A job that computes the distance to a shape, and writes any of its field, offsets, samples and a report.

    Attributes
    ----------
    volume : str, optional
        Extension of the file of the field, such as ``".npz"``. By default the field is not written.
    offsets : tuple of float
        Signed distances, in the units of the shape, at which to write closed surfaces, such as ``NAME_+0.5.stl``.
        By default none is written.
    surfaces : str
        Extension of the files of these surfaces.
    samples : Sampling, optional
        Training points, written to ``NAME.npz``, or to ``NAME_samples.npz`` if ``NAME.npz`` is the field. By default
        none are drawn.
    info : bool
        Whether to report counts and defects of the shape in the manifest, as ``signedheat info`` does.
    resolution, spacing, padding
        The grid around each shape, as for `signed_distance`, by default with room for the offsets.
    band : float, optional
        Half width of a band, in the units of the shape, outside of which the grid is coarse, as for `signed_distance`.
        By default the whole grid is fine.
    completion, constraint, diffusion, as_oriented, keep_overlaps, lids, nested
        How shapes are completed, as for `signed_distance`.
    plain : bool
        Whether to use the field that the method itself gives, not distances measured to the completed shape. That is
        always so with the constraints `EachComponent` and `LevelValues`.

    Raises
    ------
    SignedHeatError
        If no result is asked for, or a plain field is to have samples or a band, or offsets lie beyond the band or are
        not numbers, or an extension is not known for a field or a surface.

    See Also
    --------
    batches.run : Run a job on many shapes.
    batches.Sampling : How points are sampled.
    batches.Watertight : How closed surfaces are made.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     samples.sphere(2).save(f"{folder}/ball.stl")
    ...     figures = Job(offsets=(0.1,), resolution=16)(Path(folder, "ball.stl"), Path(folder, "made"))
    >>> [surface["distance"] for surface in figures["surfaces"]]
    [0.1]
    """

    volume: str | None = None
    offsets: tuple[float, ...] = ()
    surfaces: str = ".stl"
    samples: Sampling | None = None
    info: bool = False
    resolution: int = RESOLUTION
    spacing: float | tuple[float, ...] | None = None
    padding: float | None = None
    band: float | None = None
    constraint: Constraint = field(default_factory=ZeroSet)
    diffusion: float = 1.0
    as_oriented: bool = False
    keep_overlaps: bool = False
    lids: Lids = "bent"
    nested: Nesting = "given"
    plain: bool = False
    completion: Completing = "lids"

    def __post_init__(self) -> None:
        are_several = isinstance(self.offsets, Iterable) and getattr(self.offsets, "ndim", 1) != 0
        given = self.offsets if are_several else [self.offsets]
        object.__setattr__(self, "offsets", tuple(finite_number(offset, "offsets") for offset in given))
        for ending, formats in ((self.volume, FIELD_FORMATS), (self.surfaces, SHAPE_FORMATS)):
            if ending is not None and not (isinstance(ending, str) and ending in formats):
                raise FileFormatError(f"{ending!r} is no extension", remedy=f"use one of {' '.join(sorted(formats))}")
        for name in ("info", "as_oriented", "keep_overlaps", "plain"):
            flag(getattr(self, name), name)
        _refuse_odd_grid(self.resolution, self.spacing, self.padding)
        if self.band is not None:
            positive_number(self.band, "band")
        if not isinstance(self.samples, Sampling | None):
            kind = type(self.samples).__name__
            raise UnsupportedTypeError(f"a {kind} is no Sampling", remedy="pass Sampling(n=…)", element="samples")
        reach = max(map(abs, self.offsets), default=0.0)
        plain, completion = is_plain(self.plain, self._method), replace(self._completion, as_oriented=False)
        cause = remedy = ""
        if not (self._measures or self.info):
            cause, remedy = "the job has no results", "ask for a volume, offsets, samples or info"
        elif plain and (self.samples is not None or self.band is not None):
            result = "samples" if self.samples is not None else "a band"
            cause = f"a plain field has no distances to the shape, as {result} would need"
            remedy = "leave out plain" if self.plain else "take another constraint"
        elif plain and completion != Completion():
            cause = "a plain field has no solid, as completion, lids, nested and keep_overlaps would need"
            remedy = "leave out plain" if self.plain else "take another constraint"
        elif self.band is not None and self.volume not in (None, *BAND_FORMATS):
            cause, remedy = f"a band cannot be written as {self.volume}", f"use {' or '.join(sorted(BAND_FORMATS))}"
        elif self.band is not None and reach > self.band:
            cause = f"the band reaches to {self.band:g}, and the offsets to {reach:g}"
            remedy = f"use a band of {reach:g}"
        if cause:
            raise SignedHeatError(cause, remedy=remedy)

    @property
    def _method(self) -> Heat:
        """Constraint and diffusion of the method."""
        return Heat(checked(self.constraint), self.diffusion)

    @property
    def _completion(self) -> Completion:
        """How shapes are completed."""
        return Completion(self.completion, self.lids, self.nested, self.as_oriented, self.keep_overlaps)

    @property
    def _measures(self) -> bool:
        """Whether results need the distance, which those of `info` do not."""
        return self.volume is not None or bool(self.offsets) or self.samples is not None

    @property
    def _end_of_samples(self) -> str:
        """What follows the name of the shape in the name of the file with its samples."""
        return "_samples.npz" if self.volume == ".npz" else ".npz"

    def refuse_shared_names(self, shapes: Iterable[Input]) -> None:
        """Raise an error if results of two shapes would have the same name.

        Parameters
        ----------
        shapes : iterable of Input
            The shapes of a batch.

        Raises
        ------
        FileFormatError
            If one result would replace another.

        See Also
        --------
        batches.run : Run a job, which calls this first.

        Examples
        --------
        >>> from signedheat.batches.inputs import expand
        >>> Job(volume=".npz").refuse_shared_names(expand(["a.stl", "b.stl"]))
        """
        endings = [f"_{name}{self.surfaces}" for name in distinct_names(self.offsets)]
        endings += [] if self.volume is None else [self.volume]
        endings += [] if self.samples is None else [self._end_of_samples]
        owners: dict[str, Input] = {}
        for shape in shapes:
            for ending in endings:
                owner = owners.setdefault(f"{shape.name}{ending}".lower(), shape)
                if owner is not shape:
                    raise FileFormatError(
                        f"this shape and {owner.path.name} would both have the result {shape.name}{ending}",
                        remedy="rename one of the two",
                        path=shape.path,
                    )

    def __call__(self, path: Path, stem: Path) -> dict[str, object]:
        """Write the results of one shape to files that begin with `stem`; return figures and important notes."""
        shape = read(path)
        figures: dict[str, object] = {"info": shape_figures(shape, *inspected(shape))} if self.info else {}
        if not self._measures:
            return figures
        if isinstance(shape, DigitalSurface):
            shape = shape.smooth_surface
        reach = max(map(abs, self.offsets), default=0.0)
        grid = grid_around(shape, reach, self.resolution, self.padding, self.spacing)
        phi: Field[Grid] = measured_distance(shape, grid, self._completion, self._method, self.plain, band=self.band)
        figures |= {"notes": [str(note) for note in phi.diagnostics.important], "field": describe(phi)}
        if self.volume is not None:
            phi.save(f"{stem}{self.volume}")
        surfaces = []
        for distance, name in zip(self.offsets, distinct_names(self.offsets), strict=True):
            surface = cast("TriangleMesh", phi.offset(distance))
            save(surface, f"{stem}_{name}{self.surfaces}")
            surfaces.append({"distance": distance, "vertices": surface.n_vertices, "faces": surface.n_faces})
        if surfaces:
            figures["surfaces"] = surfaces
        if self.samples is not None:
            options = self.samples
            samples = sample_distances(phi, options.n, near=options.near, widths=options.widths, seed=options.seed)
            normalized = samples.normalized() if options.normalize else samples
            normalized.save(f"{stem}{self._end_of_samples}", options.layout)
            figures["samples"] = samples.figures
        return figures


@dataclass(frozen=True)
class Watertight:
    """A job that writes a closed mesh of a shape.

    Faces of the shape are kept where they bound the solid and join with its completion, as in `Solid.surface`.
    Elsewhere the surface is contoured with its edges and corners.

    Attributes
    ----------
    surfaces : str
        Extension of the files.
    thickness : float, optional
        Thickness, in the units of the shape, of the solid around sheets, which bound nothing themselves. The surface is
        at half this distance from the shape. By default a shape that is only a sheet is refused.
    contoured : bool
        Whether to contour the whole surface, which gives more and evenly sized triangles.
    tolerance : float, optional
        Largest distance, in the units of the shape, by which the surface may move when it is simplified. By default it
        is not simplified.
    resolution, spacing
        The grid on which to contour the whole surface, as in `Solid.surface`. By default faces are kept, or with
        `contoured` or `thickness` there are 256 nodes along the longest side.
    seal : float, optional
        Width below which openings are sealed, and what lies behind them is filled, as in `complete`. By default
        none is.
    smallest : float, optional
        Length of the diagonal of their box below which connected parts are left out, as in `complete`. By
        default none is.
    samples : int, optional
        Number of training points of each kind, by default none, in two files that public shape generators read:
        ``_surface.npz`` with positions and normals in ``random_surface`` and ``sharp_surface``, and ``_sdf.npz`` with
        points in the volume, near the surface and near sharp edges, and their signed distances.
    normalize : bool
        Whether to move and scale the samples so that the shape lies in the unit sphere.
    label : float, optional
        The label of the voxels whose surface is written, if the file is an image of labels; by default its only label
        other than 0. The surface is placed in the world of the image.
    units : str, optional
        Unit of all lengths, such as ``"mm"``; by default that of each file. Files that state another unit are scaled to
        it. Those that state none are assumed to be in it already, or, with ``"inch:mm"``, in inches.

    See Also
    --------
    batches.Job : What is computed for each shape.
    Solid.surface : The closed surface.

    Examples
    --------
    >>> import tempfile
    >>> from signedheat import samples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     samples.without_patches(samples.sphere(2), 2, 0.5).save(f"{folder}/ball.stl")
    ...     figures = Watertight()(Path(f"{folder}/ball.stl"), Path(f"{folder}/closed"))
    >>> figures["bodies"], figures["way"], figures["self_intersections"]
    (1, 'faces kept', 0)
    """

    surfaces: str = ".stl"
    thickness: float | None = None
    contoured: bool = False
    tolerance: float | None = None
    resolution: int | None = None
    spacing: float | None = None
    seal: float | None = None
    smallest: float | None = None
    samples: int | None = None
    normalize: bool = False
    label: float | None = None
    units: str | None = None

    def __post_init__(self) -> None:
        if self.samples is not None:
            whole_number(self.samples, "samples", 1, SignedHeatError)
        for name in ("contoured", "normalize"):
            flag(getattr(self, name), name)
        for name in ("thickness", "tolerance", "seal", "smallest"):
            if getattr(self, name) is not None:
                positive_number(getattr(self, name), name)
        if self.label is not None:
            finite_number(self.label, "label")
        _refuse_odd_grid(RESOLUTION if self.resolution is None else self.resolution, self.spacing, None)
        instance(self.units, str, "units")
        for unit in (self.units or "m").split(":"):
            if unit not in METRES:
                raise SignedHeatError(f"{unit!r} is not a unit", element="units", remedy=f"use {', '.join(METRES)}")

    def __call__(self, path: Path, stem: Path) -> dict[str, object]:
        """Write the closed mesh of one shape to a file that begins with `stem`; return figures and all notes."""
        if extension(path) in LABEL_FORMATS:
            image = read_labels(path)
            shape: ShapeLike = image.to_world(image.surface(self.label))
        elif self.label is not None:
            raise SourceError("only images have labels", element="label", remedy="leave it out", path=path)
        else:
            shape = read(path)
        scale = 1.0 if self.units is None else scale_to(path, self.units)
        placed = shape if scale == 1 else transform(shape, np.diag([scale, scale, scale, 1.0]))
        solid = complete(placed, seal=self.seal, smallest=self.smallest)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InexactWarning)
            surface, origin = self._closed_surface(solid)
        with warnings.catch_warnings(record=True) as losses:
            warnings.simplefilter("always", InexactWarning)
            save(surface, f"{stem}{self.surfaces}")
        # of the file, in which coordinates are rounded, and parts that touch are joined
        faults = faults_of(cast("TriangleMesh", read(Path(f"{stem}{self.surfaces}"))))
        origin = "; ".join([origin, *(str(loss.message) for loss in losses)])
        if self.samples is not None:
            on_surface, around = training_points(surface, self.samples, self.normalize)
            write_npz(f"{stem}_surface.npz", **on_surface)
            write_npz(f"{stem}_sdf.npz", **around)
        notes = [str(note) for note in solid.diagnostics.notes] + [str(warning.message) for warning in caught]
        figures = figures_of(surface, solid, 0.5 * (self.thickness or 0.0))
        units = unit_of(path) if self.units is None else self.units.rpartition(":")[2]
        return {"way": origin, **figures, **faults, "units": units, "notes": notes}

    def _closed_surface(self, solid: Solid) -> tuple[TriangleMesh, str]:
        """Return a closed surface of a solid, and words on how it was made, such as ``"contoured"``."""
        resolution = CONTOUR_RESOLUTION if self.resolution is None else self.resolution
        contour = partial(solid.surface, spacing=self.spacing, resolution=resolution, tolerance=self.tolerance)
        if self.thickness is not None:
            return contour(0.5 * self.thickness), f"thickened to {self.thickness:g}"
        areas = face_areas(solid.triangles)
        if areas[solid.bounding].sum() < SHEET_BOUNDARY * areas.sum():
            raise SourceError("the shape is a sheet, which bounds nothing", remedy="give it a thickness")
        if self.contoured or self.resolution is not None or self.spacing is not None:
            return contour(), "contoured"
        kept = kept_surface(solid)
        mesh = kept.mesh if self.tolerance is None else simplified(kept.mesh, self.tolerance)
        any_given = bool((solid.bounding & (solid.origins >= 0)).any())
        return mesh, kept.note or ("faces kept" if any_given else "no face kept")


CONTOUR_RESOLUTION = 256
"""Number of nodes along the longest side of the grid for contours, unless a job gives another."""
SHEET_BOUNDARY = 1e-3
"""Fraction of the area of a shape. If less of it bounds the solid, the shape is refused as a sheet."""
MEASURED_POINTS = np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [1 / 3, 1 / 3, 1 / 3]]
)
"""(7, 3) barycentric coordinates of points of a triangle whose distances are measured: corners, middles, centre."""


def figures_of(surface: TriangleMesh, solid: Solid, level: float = 0.0) -> dict[str, object]:
    """Return counts and sizes of a closed surface, and how far it is from the given faces of a solid, by name.

    The surface should have the distance `level` from the solid. ``to_faces`` is the largest deviation from that
    distance, measured from points of the surface whose nearest face was given. ``from_faces`` is the largest deviation
    measured from points of the given faces that bound the solid; of all given faces, if none does. A number is None if
    there is no point to measure it from.
    """
    corners = surface.vertices[surface.faces]
    volumes = part_volumes(surface.vertices, surface.faces)[1]
    bounds = solid.bounding | (level > 0)
    given, made = solid.triangles[bounds & (solid.origins >= 0)], solid.triangles[bounds & (solid.origins < 0)]
    closest = solid.closest(_measured_points(corners))
    to_faces = np.abs(closest.distances - level)[~closest.completed]
    tree = FaceTree.of_triangles(corners)
    if not len(given) and solid.source is not None:  # loose triangles, through which the completion runs
        given = solid.source.vertices[solid.source.faces]
    from_faces = np.abs(tree.distances(_measured_points(given)) - level)
    return {
        "bodies": int((volumes > 0).sum()),
        "vertices": surface.n_vertices,
        "faces": surface.n_faces,
        "volume": float(volumes.sum()),
        "area": float(face_areas(corners).sum()),
        "openings": _openings(made),
        "completed_area": float(face_areas(made).sum()),
        "to_faces": float(to_faces.max()) if len(to_faces) else None,
        "from_faces": float(from_faces.max()) if len(from_faces) else None,
    }


def faults_of(surface: TriangleMesh) -> dict[str, object]:
    """Return the number of pairs of faces that cross, and of edges that not exactly two faces share, by name."""
    return {
        "self_intersections": len(self_intersections(surface.vertices, surface.faces)),
        "bad_edges": surface.n_bad_edges,
    }


def _measured_points(triangles: Floats) -> Floats:
    """Return the (7 m, 3) points with barycentric coordinates `MEASURED_POINTS` in (m, 3, 3) triangles."""
    points: Floats = np.einsum("pk,mkj->mpj", MEASURED_POINTS, triangles).reshape(-1, 3)
    return points


def _openings(completion: Floats) -> int:
    """Return the number of connected parts of a completion, which is (m, 3, 3) triangles."""
    return int(element_components(indexed(completion)[1]).max(initial=-1)) + 1
