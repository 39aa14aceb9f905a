"""Images of labels, as segmentation makes them, with their place in the world: turned and mirrored axes included."""

from __future__ import annotations

import gzip
import io
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..domains.digital_surface import DigitalSurface
from ..domains.display import NAME
from ..domains.grid import Grid
from ..domains.polygon_mesh import PolygonMesh
from ..domains.transforms import transform
from ..domains.triangle_mesh import TriangleMesh
from ..errors import FileFormatError, GeometryError
from ..fields.grid_field import GridField
from ..packages import lazy_module, require
from .arrays import read_npy
from .fields import CONVENTION, ensure_field_writable, save_field
from .files import (
    PathLike,
    contents,
    ensure_fits,
    ensure_writable,
    extension,
    reading,
    replacing,
    unknown_extension,
    unpacked,
)
from .nrrd_files import read_image, write_image
from .vtk_xml import read_vti

Mesh = TypeVar("Mesh", TriangleMesh, PolygonMesh)

NIBABEL = ("nibabel", "NIfTI files")
nibabel = lazy_module(*NIBABEL)

NIFTI = (".nii", ".nii.gz")
LABEL_FORMATS = frozenset({".npy", ".nrrd", ".vti", *NIFTI})
SQUARE = 1e-4
"""Cosine between axes up to which they are at right angles: NIfTI files keep them in single precision."""
AXES = {
    "right-anterior-superior": (1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "left-anterior-superior": (-1, 1, 1),
}
"""Signs that turn the axes of a space, as NRRD files name it, into those of NIfTI files."""
SHORT = {"RAS": "right-anterior-superior", "LPS": "left-posterior-superior", "LAS": "left-anterior-superior"}


@dataclass(frozen=True, eq=False)
class LabelImage:
    """Labels of voxels, and where these are.

    Distance is measured along the axes of the image (`grid`, `surface`), and written back into its place (`save`,
    `to_world`): that does not change it, as the axes are at right angles.

    Attributes
    ----------
    labels : (nx, ny, nz) number
        One for each voxel.
    axes : (3, 3) float
        The step from one voxel to the next along each axis of the image, in columns.
    origin : (3,) float
        Centre of the first voxel.
    space : str, optional
        What the axes of the world are, as in NRRD files: ``"left-posterior-superior"``.
    """

    labels: NDArray[np.generic]
    axes: NDArray[np.float64]
    origin: NDArray[np.float64]
    space: str | None = None

    @property
    def spacing(self) -> NDArray[np.float64]:
        """(3,) distance between the centres of neighbouring voxels."""
        lengths: NDArray[np.float64] = np.linalg.norm(self.axes, axis=0)
        return lengths

    @property
    def grid(self) -> Grid:
        """The centres of the voxels, along the axes of the image, the first one at 0."""
        return Grid((0.0, 0.0, 0.0), self.spacing, self.labels.shape)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(4, 4) from positions along the axes of the image to those in the world."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.axes / self.spacing, self.origin
        return matrix

    def surface(self, label: float | None = None) -> PolygonMesh:
        """The boundary of the voxels with a label, along the axes of the image.

        Parameters
        ----------
        label : number, optional
            Which; may be left out where the image has zeros and one other label.

        Raises
        ------
        GeometryError
            If no voxel has it, or it is left out and there are several.
        """
        if label is None:
            known = np.unique(self.labels)
            others = known[known != 0]
            if len(others) != 1:
                raise GeometryError(
                    f"the image has {_listed(known)}", remedy="choose one with --label", element="labels"
                )
            label = float(others[0])
        inside = self.labels == label
        if not inside.any():
            raise GeometryError(
                f"no voxel has the label {label:g}, but {_listed(np.unique(self.labels))}",
                remedy="choose another one",
                element=f"label {label:g}",
            )
        return DigitalSurface(inside, self.spacing).squares

    def to_world(self, surface: Mesh) -> Mesh:
        """A mesh along the axes of the image, moved to its place in the world; outside stays outside."""
        return cast("Mesh", transform(surface, self.matrix))

    def save(self, field: GridField, path: PathLike) -> None:
        """Write a field along the axes of the image into its place in the world.

        Parameters
        ----------
        field : GridField
            On `grid`, or another one along the same axes.
        path : str or path
            ``.nrrd`` or ``.nii`` or ``.nii.gz`` (with nibabel); other formats of fields where the axes of the image are
            those of the world.

        Raises
        ------
        FileFormatError
            If the format has no place for turned axes, or for the space of the image, or the file cannot be written.
        """
        self.ensure_writable(path)
        first = self.matrix[:3, :3] @ field.grid.origin + self.origin
        axes = self.axes * (field.grid.spacing / self.spacing)
        if format_of(path) in NIFTI:
            with replacing(path) as temporary:
                temporary.write_bytes(self._nifti(field, axes, first, path))
        elif format_of(path) == ".nrrd":
            with replacing(path) as temporary:
                write_image(temporary, field.values, axes, first, self.space, content=NAME, convention=CONVENTION)
        else:
            save_field(GridField(Grid(first, field.grid.spacing, field.grid.shape), field.values), path)

    def ensure_writable(self, path: PathLike) -> None:
        """Check before a long computation that a field can be written."""
        if format_of(path) in NIFTI:
            require(*NIBABEL)
            ensure_writable(path, {extension(path)}, "a field")
            if self.space is not None and self.space not in AXES:
                raise FileFormatError(
                    f"NIfTI files have no space '{self.space}'", remedy="write a .nrrd file", path=path
                )
            return
        ensure_field_writable(path)
        if format_of(path) != ".nrrd" and not np.array_equal(self.axes, np.diag(self.spacing)):
            raise FileFormatError(
                "the axes of the image are turned, for which this format has no place",
                remedy="write a .nrrd or .nii file",
                path=path,
            )

    def _nifti(self, field: GridField, axes: NDArray[np.float64], first: NDArray[np.float64], path: PathLike) -> bytes:
        affine = np.eye(4)
        affine[:3, :3], affine[:3, 3] = axes, first
        signs = AXES[self.space] if self.space is not None else (1, 1, 1)
        image = nibabel.Nifti1Image(field.values, np.diag([*signs, 1]) @ affine)
        packed: bytes = image.to_bytes()
        return gzip.compress(packed, mtime=0) if format_of(path) == ".nii.gz" else packed


def format_of(path: PathLike) -> str:
    """The extension, with both parts of ``.nii.gz``."""
    name = Path(path).name.lower()
    return ".nii.gz" if name.endswith(".nii.gz") else extension(path)


def read_labels(path: PathLike) -> LabelImage:
    """Read an image of labels, as segmentation makes them, with its place in the world.

    Parameters
    ----------
    path : str or path
        ``.nrrd``, ``.nii`` or ``.nii.gz`` (with nibabel), ``.vti``, ``.npy``. Axes may be turned and mirrored.

    Returns
    -------
    LabelImage
        Labels and place.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, damaged, has not three axes, or they are not at right angles.
    MissingPackageError
        If it is a NIfTI file, and nibabel is not installed.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/labels.npy", np.array([[[0, 3]], [[3, 3]]]))
    ...     read_labels(f"{folder}/labels.npy").surface(3).n_polygons
    14
    """
    if format_of(path) not in LABEL_FORMATS:
        raise unknown_extension(path, LABEL_FORMATS, "labels")
    with reading(path):
        labels, axes, origin, space = _read(path)
        if labels.ndim != 3 or labels.dtype.kind not in "biuf":
            raise FileFormatError(f"the image has {labels.ndim} axes of {labels.dtype}, not 3 of numbers", path=path)
        if axes.shape != (3, 3) or origin.shape != (3,):
            raise FileFormatError("its axes or its origin are not those of space", remedy="write it again", path=path)
        lengths = np.linalg.norm(axes, axis=0)
        if not (np.isfinite(axes).all() and (lengths > 0).all() and np.isfinite(origin).all()):
            raise FileFormatError("its axes have no directions", remedy="write it again", path=path)
        cosines = (axes / lengths).T @ (axes / lengths) - np.eye(3)
        if np.abs(cosines).max() > SQUARE:
            raise FileFormatError(
                f"its axes are not at right angles, but off by {np.degrees(np.arcsin(np.abs(cosines).max())):.3g}°",
                remedy="resample the image along right angles",
                path=path,
            )
        return LabelImage(labels, axes, origin, space)


Parts = tuple[NDArray[Any], NDArray[np.float64], NDArray[np.float64], str | None]
"""Labels, steps along the axes in columns, origin, space."""


def _read(path: PathLike) -> Parts:
    kind = format_of(path)
    if kind in NIFTI:
        return _read_nifti(path)
    if kind == ".nrrd":
        return _read_nrrd(path)
    if kind == ".vti":
        values, origin, spacing = read_vti(path)[:3]
        return values, np.diag(np.asarray(spacing, dtype=np.float64)), np.asarray(origin, dtype=np.float64), None
    values = read_npy(path)
    return values, np.eye(values.ndim), np.zeros(values.ndim), None


def _read_nrrd(path: PathLike) -> Parts:
    values, header = read_image(path)
    n = values.ndim
    spacings = np.nan_to_num(np.asarray(header.get("spacings", np.ones(n)), dtype=np.float64), nan=1.0)
    rows = np.asarray(header.get("space directions", np.diag(spacings)), dtype=np.float64)
    origin = np.asarray(header.get("space origin", np.zeros(n)), dtype=np.float64)
    space = header.get("space")
    return values, rows.T, origin, SHORT.get(str(space), str(space).lower()) if space is not None else None


def _read_nifti(path: PathLike) -> Parts:
    data = contents(path)
    require(*NIBABEL)
    packed = data[:2] == b"\x1f\x8b"
    head = unpacked(data, zlib.decompressobj(zlib.MAX_WBITS | 16), 540) if packed else data[:540]
    second = 540 in (int.from_bytes(head[:4], "little"), int.from_bytes(head[:4], "big"))
    kind = nibabel.Nifti2Image if second else nibabel.Nifti1Image
    logger = nibabel.imageglobals.logger
    was, logger.disabled = logger.disabled, True  # what it mends in headers it would tell on standard error
    try:
        return _parts_of_nifti(kind, head, data, packed, path)
    finally:
        logger.disabled = was


def _parts_of_nifti(kind: Any, head: bytes, data: bytes, packed: bool, path: PathLike) -> Parts:
    header = kind.header_class.from_fileobj(io.BytesIO(head), check=False)
    size = int(header["vox_offset"]) + int(np.prod(header.get_data_shape())) * header.get_data_dtype().itemsize
    ensure_fits(size, path)
    if packed:
        data = unpacked(data, zlib.decompressobj(zlib.MAX_WBITS | 16), size)
    if len(data) < size:
        raise FileFormatError(f"it announces {size} bytes, and {len(data)} are there: it is truncated", path=path)
    image = kind.from_bytes(data)
    values = np.asarray(image.dataobj)
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    affine = np.asarray(image.affine, dtype=np.float64)
    return values, affine[:3, :3], affine[:3, 3], "right-anterior-superior"


def _listed(labels: NDArray[Any]) -> str:
    some = ", ".join(f"{label:g}" for label in labels[:12].tolist())
    return f"the labels {some}{', …' if len(labels) > 12 else ''}"
