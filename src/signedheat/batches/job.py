"""What is made of each shape of a batch."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, cast

from ..constraints import Constraint, ZeroSet
from ..distances import grid_around, plain_distance
from ..errors import FileFormatError, InexactWarning, SignedHeatError
from ..grids.grid import RESOLUTION, Grid
from ..grids.grid_field import GridField
from ..io.field_files import BAND_FORMATS
from ..io.files import distinct_names, extension
from ..io.key_figures import describe, shape_figures
from ..io.numpy_files import write_npz
from ..io.shape_files import read, save
from ..io.voxel_files import LABEL_FORMATS, read_labels
from ..kinds import ShapeLike
from ..solids.bounding import Nesting
from ..solids.completion import complete
from ..solids.sample_set import Layout
from ..solids.sampling import WIDTHS, sample
from ..solids.solid_distance import distance_to_shapes
from ..solids.training import training_points
from ..solids.watertight import closed_surface, faults_of, figures_of
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import positive_number, whole_number
from .inputs import Input


@dataclass(frozen=True)
class Sampling:
    """Which samples are taken (`signedheat.sample`), and how they are kept (`Samples.save`).

    Attributes
    ----------
    n : int
        Number of points.
    near : float
        Share of them near the surface.
    widths : tuple of float
        Standard deviations of the noise, over the radius of the shape.
    seed : int
        Of the random numbers.
    normalize : bool
        Move and scale the shape into the unit sphere.
    layout : "arrays" or "deepsdf"
        How they are kept in the file.

    Examples
    --------
    >>> Job(samples=Sampling(n=10_000, seed=3)).samples.near
    0.8
    """

    n: int = 250_000
    near: float = 0.8
    widths: tuple[float, ...] = WIDTHS
    seed: int = 0
    normalize: bool = False
    layout: Layout = "arrays"


@dataclass(frozen=True)
class Job:
    """What `run` makes of each shape: any of a field, offsets, samples and a report, of one distance.

    Attributes
    ----------
    volume : str, optional
        Extension of the file of the field, such as ``".npz"``.
    offsets : tuple of float
        Distances at which closed surfaces are written, ``NAME_+0.5.stl``.
    surfaces : str
        Extension of their files.
    samples : Sampling, optional
        Points to learn from, ``NAME.npz``; ``NAME_samples.npz`` next to a field of that name.
    info : bool
        Report counts and defects of the shape, as ``signedheat info`` does, in the manifest.
    resolution, spacing, padding
        The grid around each shape, as for `signed_distance`; by default with room for the offsets.
    band : float, optional
        Half width of a band, outside of which the grid is coarse, as for `signed_distance`.
    constraint, diffusion, as_oriented, keep_overlaps, lids, nested, plain
        As for `signed_distance`.

    Raises
    ------
    SignedHeatError
        If there is nothing to make, samples are wanted of a plain field, or offsets beyond the band.

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
    lids: Literal["bent", "flat"] = "bent"
    nested: Nesting = "given"
    plain: bool = False

    def __post_init__(self) -> None:
        reach = max(map(abs, self.offsets), default=0.0)
        cause = remedy = ""
        if not (self._measures or self.info):
            cause, remedy = "there is nothing to make of the shapes", "ask for a volume, offsets, samples or info"
        elif self.plain and (self.samples is not None or self.band is not None):
            what = "samples have" if self.samples is not None else "a band has"
            cause, remedy = f"{what} distances to the shape itself, and a plain field has others", "leave out plain"
        elif self.band is not None and self.volume not in (None, *BAND_FORMATS):
            cause, remedy = f"a band cannot be written as {self.volume}", f"use {' or '.join(sorted(BAND_FORMATS))}"
        elif self.band is not None and reach > self.band:
            cause = f"the band reaches to {self.band:g}, and the offsets to {reach:g}"
            remedy = f"use a band of {reach:g}"
        if cause:
            raise SignedHeatError(cause, remedy=remedy)

    @property
    def _measures(self) -> bool:
        return self.volume is not None or bool(self.offsets) or self.samples is not None

    @property
    def _of_samples(self) -> str:
        return "_samples.npz" if self.volume == ".npz" else ".npz"

    def refuse_shared_names(self, shapes: Iterable[Input]) -> None:
        """Refuse shapes of which two would have results of one name.

        Parameters
        ----------
        shapes : iterable of Input
            Files, and the names of their results.

        Raises
        ------
        FileFormatError
            If one result would replace another.

        Examples
        --------
        >>> from signedheat.batches.inputs import expand
        >>> Job(volume=".npz").refuse_shared_names(expand(["a.stl", "b.stl"]))
        """
        endings = [f"_{name}{self.surfaces}" for name in distinct_names(self.offsets)]
        endings += [] if self.volume is None else [self.volume]
        endings += [] if self.samples is None else [self._of_samples]
        owners: dict[str, Input] = {}
        for each in shapes:
            for ending in endings:
                other = owners.setdefault(f"{each.name}{ending}".lower(), each)
                if other is not each:
                    raise FileFormatError(
                        f"a result of {other.path.name} would have the name of one of this shape, {each.name}{ending}",
                        remedy="rename one of the two",
                        path=each.path,
                    )

    def __call__(self, path: Path, stem: Path) -> dict[str, object]:
        """Make it of one shape: files that begin with `stem`. Returns figures, and important notes under "notes"."""
        shape = read(path)
        figures: dict[str, object] = {"info": shape_figures(shape)} if self.info else {}
        if not self._measures:
            return figures
        if isinstance(shape, DigitalSurface):
            shape = shape.smooth_surface
        reach = max(map(abs, self.offsets), default=0.0)
        phi = self._distance(shape, grid_around(shape, reach, self.resolution, self.padding, self.spacing))
        figures |= {"notes": [str(note) for note in phi.diagnostics.important], "field": describe(phi)}
        if self.volume is not None:
            phi.save(f"{stem}{self.volume}")
        surfaces = []
        for distance, name in zip(self.offsets, distinct_names(self.offsets), strict=True):
            surface = cast("GridField[Literal[3]]", phi).offset(distance)
            save(surface, f"{stem}_{name}{self.surfaces}")
            surfaces.append({"distance": distance, "vertices": surface.n_vertices, "faces": surface.n_faces})
        if surfaces:
            figures["surfaces"] = surfaces
        if self.samples is not None:
            wanted = self.samples
            taken = sample(phi, wanted.n, near=wanted.near, widths=wanted.widths, seed=wanted.seed)
            (taken.normalized() if wanted.normalize else taken).save(f"{stem}{self._of_samples}", wanted.layout)
            figures["samples"] = taken.figures
        return figures

    def _distance(self, shape: ShapeLike, grid: Grid) -> GridField:
        if self.plain:
            return cast("GridField", plain_distance(shape, grid, self.constraint, self.diffusion, self.as_oriented))
        options: dict[str, Any] = {"as_oriented": self.as_oriented, "keep_overlaps": self.keep_overlaps}
        options |= {"lids": self.lids, "nested": self.nested}
        options |= {"constraint": self.constraint, "diffusion": self.diffusion}
        return cast("GridField", distance_to_shapes(shape, grid, band=self.band, **options))


@dataclass(frozen=True)
class Watertight:
    """A closed mesh of each shape, for `run`.

    The faces that were given are kept where they bound the solid and join with its completion; elsewhere the surface is
    contoured, with its edges and corners.

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
    samples : int, optional
        Points of each kind that are taken of the surface, in two files in the layout of public trainers of generators:
        ``_surface.npz`` with ``random_surface`` and ``sharp_surface``, places and normals; ``_sdf.npz`` with points in
        the volume, near the surface and near sharp edges, and their signed distances.
    normalize : bool
        Move and scale the shape into the unit sphere, for the samples.
    label : float, optional
        Of an image of labels, the voxels with this one; the surface lies where the image does.

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
    samples: int | None = None
    normalize: bool = False
    label: float | None = None

    def __post_init__(self) -> None:
        if self.samples is not None:
            whole_number(self.samples, "the number of samples", 1, SignedHeatError)
        if self.thickness is not None:
            positive_number(self.thickness, "thickness")
        if self.tolerance is not None:
            positive_number(self.tolerance, "tolerance")

    def __call__(self, path: Path, stem: Path) -> dict[str, object]:
        """Make it of one shape, in a file that begins with `stem`; figures, and all notes under "notes"."""
        if extension(path) in LABEL_FORMATS:
            image = read_labels(path)
            solid = complete(image.to_world(image.surface(self.label)))
        else:
            solid = complete(read(path))
        names = ("thickness", "contoured", "tolerance", "resolution", "spacing")
        options = {name: getattr(self, name) for name in names}
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InexactWarning)
            surface, way = closed_surface(solid, **options)
        with warnings.catch_warnings(record=True) as losses:
            warnings.simplefilter("always", InexactWarning)
            save(surface, f"{stem}{self.surfaces}")
        # as it was written: rounded, and joined where parts touch
        faults = faults_of(cast("TriangleMesh", read(Path(f"{stem}{self.surfaces}"))))
        way = "; ".join([way, *(str(loss.message) for loss in losses)])
        if self.samples is not None:
            on, around = training_points(surface, self.samples, self.normalize)
            write_npz(f"{stem}_surface.npz", **on)
            write_npz(f"{stem}_sdf.npz", **around)
        notes = [str(note) for note in solid.diagnostics.notes] + [str(each.message) for each in caught]
        figures = figures_of(surface, solid, 0.5 * (self.thickness or 0.0))
        return {"way": way, **figures, **faults, "notes": notes}
