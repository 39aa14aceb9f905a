"""Voxels from images: digital surfaces, and labels with their place in the world."""

from __future__ import annotations

import gzip
from dataclasses import dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Frozen, read_only, short
from ..errors import FileFormatError, GeometryError, quoted
from ..fields.field import Field
from ..grids.grid import Grid
from ..packages import require
from ..shapes.exchange import VALUES_NAME
from ..shapes.foreign import Represented
from ..shapes.transforms import transform
from ..surfaces.digital_surface import DigitalSurface
from ..surfaces.polygon_mesh import PolygonMesh
from ..surfaces.triangle_mesh import TriangleMesh
from ..validation import array_of, finite_number, numbers
from .budgets import charge
from .field_files import CONVENTION, ensure_field_writable, made, save_field
from .files import PathLike, ensure_writable, extension, reading, replacing
from .image_files import NIBABEL, NIFTI, nibabel, read_image, write_nrrd

Mesh = TypeVar("Mesh", TriangleMesh, PolygonMesh)

VOLUME_FORMATS = (".npy", ".nrrd", ".vti")
LABEL_FORMATS = (*VOLUME_FORMATS, *NIFTI)
BYTES_PER_READ_VOXEL = 12
"""Memory for each voxel while the boundary of a volume is computed, as measured."""
SPACES = {
    "right-anterior-superior": (1, 1, 1),
    "left-posterior-superior": (-1, -1, 1),
    "left-anterior-superior": (-1, 1, 1),
}
"""Signs of the axes of a space, as NRRD files name it, in the coordinates of NIfTI files."""


@dataclass(frozen=True, eq=False, repr=False)
class LabelImage(Represented, Frozen):
    """An image of voxels with labels, and its position in the world.

    The axes of the image may be rotated or mirrored in the world. An image with zeros and one other label can be given
    wherever a shape can, and stands for its `boundary` in the world. With more labels, distance to the `surface` of a
    label is measured on the `grid` along the axes of the image, and the results are written with their position in the
    world (`save`, `to_world`). Distances are the same in both, as the axes are at right angles.

    Attributes
    ----------
    labels : (nx, ny, nz) number
        The label of each voxel.
    axes : (3, 3) float
        The step from one voxel to the next along each axis of the image, in columns and in the units of the file.
    origin : (3,) float
        The centre of the first voxel in the world, in these units.
    space : str, optional
        The meaning of the axes of the world, as in NRRD files, such as ``"left-posterior-superior"``; by default it is
        not known.

    Raises
    ------
    GeometryError
        If the image does not have three axes, or they are not at right angles.

    See Also
    --------
    io.read_labels : Read an image of labels.
    DigitalSurface : The boundary of voxels.

    Examples
    --------
    >>> image = LabelImage(np.full((3, 4, 5), 7), axes=2.0 * np.eye(3), origin=np.zeros(3))
    >>> image.grid.upper.tolist(), image.surface(7).bounds.round()[1].tolist()
    ([4.0, 6.0, 8.0], [5.0, 7.0, 9.0])
    >>> image
    LabelImage(3 × 4 × 5 voxels of [2, 2, 2], the label 7)
    """

    labels: NDArray[np.generic]
    axes: Floats
    origin: Floats
    space: str | None = None

    def __post_init__(self) -> None:
        labels, axes, origin = (
            array_of(self.labels, "labels"),
            numbers(self.axes, "axes"),
            numbers(self.origin, "origin"),
        )
        if not isinstance(self.space, str | None):
            raise GeometryError(f"space is a name or None, not a {type(self.space).__name__}", element="space")
        if labels.ndim != 3 or labels.dtype.kind not in "biuf" or axes.shape != (3, 3) or origin.shape != (3,):
            raise GeometryError(
                f"labels, axes and origin of an image in space have the shapes (nx, ny, nz), (3, 3) and (3,), not "
                f"{labels.shape}, {axes.shape} and {origin.shape}",
                element="labels",
            )
        lengths = np.linalg.norm(axes, axis=0)
        if not (np.isfinite(axes).all() and (lengths > 0).all() and np.isfinite(origin).all()):
            raise GeometryError("its axes have no directions", remedy="write it again", element="axes")
        cosine = float(np.abs((axes / lengths).T @ (axes / lengths) - np.eye(3)).max())
        if cosine > 1e-4:  # NIfTI files hold axes in single precision
            raise GeometryError(
                f"its axes are not at right angles, but off by {np.degrees(np.arcsin(min(cosine, 1.0))):.3g}°",
                remedy="resample the image along right angles",
                element="axes",
            )
        if self.space is not None and not isinstance(self.space, str):
            raise GeometryError(
                f"the space of an image is named by words, not {quoted(self.space)}",
                remedy='pass for instance space="left-posterior-superior"',
                element="space",
            )
        for name, array in (("labels", labels), ("axes", axes), ("origin", origin)):
            object.__setattr__(self, name, read_only(array))

    @property
    def spacing(self) -> Floats:
        """(3,) distance between the centres of neighbouring voxels along x, y and z, in the units of the file."""
        return np.linalg.norm(self.axes, axis=0)

    @property
    def grid(self) -> Grid:
        """The grid of the centres of the voxels, along the axes of the image, with the first voxel at 0."""
        return Grid((0.0, 0.0, 0.0), self.spacing, self.labels.shape)

    @property
    def matrix(self) -> Floats:
        """(4, 4) matrix that maps positions (x, y, z, 1) along the axes of the image to positions in the world."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.axes / self.spacing, self.origin
        return matrix

    @property
    def boundary(self) -> TriangleMesh:
        """The smooth surface around the voxels with the only label other than 0, in the world: closed and manifold."""
        return self.to_world(self.surface())

    def surface(self, label: float | None = None) -> TriangleMesh:
        """Return the smooth surface around the voxels with a label, in coordinates along the axes of the image.

        Parameters
        ----------
        label : number, optional
            The label, which may be left out if the image has zeros and one other label.

        Returns
        -------
        TriangleMesh
            A closed and manifold mesh.

        Raises
        ------
        GeometryError
            If no voxel has the label, or none is given and the image has several.

        See Also
        --------
        io.LabelImage.to_world : Map the surface to the world.
        signed_distance : Distance to the surface.

        Examples
        --------
        >>> image = LabelImage(np.pad(np.full((2, 2, 2), 7), 1), axes=2.0 * np.eye(3), origin=np.zeros(3))
        >>> image.surface(7).bounds.tolist() == image.surface().bounds.tolist()
        True
        """
        if label is not None:
            label = finite_number(label, "label", error=GeometryError)
        else:
            present = np.unique(self.labels)
            others = present[present != 0]
            if len(others) != 1:
                raise GeometryError(
                    f"the image has {_listed(present)}", remedy="choose one by `label`, or --label", element="labels"
                )
            label = float(others[0])
        inside = self.labels == label
        if not inside.any():
            raise GeometryError(
                f"no voxel has the label {label:g}, but {_listed(np.unique(self.labels))}",
                remedy="choose another one",
                element=f"label {label:g}",
            )
        return DigitalSurface(inside, self.spacing).smooth_surface

    def to_world(self, surface: Mesh) -> Mesh:
        """Map a mesh from the axes of the image to the world. If the map mirrors it, its faces are flipped.

        Parameters
        ----------
        surface : TriangleMesh or PolygonMesh
            The mesh, such as `surface` returns.

        Returns
        -------
        TriangleMesh or PolygonMesh
            The mesh in the world.

        See Also
        --------
        io.LabelImage.surface : The surface along the axes of the image.

        Examples
        --------
        >>> image = LabelImage(np.pad(np.full((2, 2, 2), 7), 1), axes=2.0 * np.eye(3), origin=np.zeros(3))
        >>> image.to_world(image.surface(7)).n_vertices == image.surface(7).n_vertices
        True
        """
        return cast("Mesh", transform(surface, self.matrix))

    def save(self, field: Field[Grid], path: PathLike) -> None:
        """Write a field along the axes of the image, with its position in the world.

        Parameters
        ----------
        field : Field
            The field on `grid`, or on another grid or band along the axes of the image.
        path : str or path
            A ``.nrrd`` file, or with nibabel a ``.nii`` or ``.nii.gz`` file. If the axes of the image are those of the
            world, it may have any other format of fields on grids.

        Raises
        ------
        FileFormatError
            If the format cannot hold rotated axes or the space of the image, or the file cannot be written.

        See Also
        --------
        io.read_labels : Read an image.
        Field.save : Write a field that belongs to no image.

        Examples
        --------
        >>> image = LabelImage(np.pad(np.full((2, 2, 2), 7), 1), axes=2.0 * np.eye(3), origin=np.zeros(3))
        >>> import tempfile
        >>> import signedheat as sh
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     image.save(sh.signed_distance(image.surface(7), image.grid), f"{folder}/distance.nrrd")
        """
        self.ensure_writable(path)
        field = cast("Field[Grid]", field.expand())  # images have a value at every voxel
        first = self.matrix[:3, :3] @ field.domain.origin + self.origin
        axes = self.axes * (field.domain.spacing / self.spacing)
        if extension(path) in NIFTI:
            with replacing(path) as temporary:
                temporary.write_bytes(self._nifti(field, axes, first, path))
        elif extension(path) == ".nrrd":
            with replacing(path) as temporary:
                write_nrrd(temporary, field.values, axes, first, self.space, content=VALUES_NAME, convention=CONVENTION)
        else:
            save_field(replace(field, domain=Grid(first, field.domain.spacing, field.domain.shape), solid=None), path)

    def ensure_writable(self, path: PathLike) -> None:
        """Raise an error if a field cannot be written by `save`, before a long computation.

        Parameters
        ----------
        path : str or path
            The file, in a format that `save` supports.

        Raises
        ------
        FileFormatError
            If the format cannot hold rotated axes or the space of the image, or the file cannot be written.

        See Also
        --------
        io.LabelImage.save : Write the field.

        Examples
        --------
        >>> image = LabelImage(np.pad(np.full((2, 2, 2), 7), 1), axes=2.0 * np.eye(3), origin=np.zeros(3))
        >>> image.ensure_writable("distance.nrrd")
        """
        if extension(path) in NIFTI:
            require(*NIBABEL)
            ensure_writable(path, {extension(path)}, "a field")
            if self.space is not None and self.space not in SPACES:
                raise FileFormatError(
                    f"NIfTI files have no space '{self.space}'", remedy="write a .nrrd file", path=path
                )
            return
        ensure_field_writable(path)
        if extension(path) != ".nrrd" and not np.array_equal(self.axes, np.diag(self.spacing)):
            raise FileFormatError(
                "the axes of the image are rotated, which this format cannot hold",
                remedy="write a .nrrd or .nii file",
                path=path,
            )

    def __repr__(self) -> str:
        voxels = " × ".join(map(str, self.labels.shape))
        return f"LabelImage({voxels} voxels of {short(self.spacing)}, {_listed(np.unique(self.labels))})"

    def _nifti(self, field: Field[Grid], axes: Floats, first: Floats, path: PathLike) -> bytes:
        """Return a NIfTI file, packed if the name of `path` says so.

        `axes` are the (3, 3) steps from node to node, in columns, and `first` is the position of the first node.
        """
        affine = np.eye(4)
        affine[:3, :3], affine[:3, 3] = axes, first
        signs = SPACES[self.space] if self.space is not None else (1, 1, 1)
        image = nibabel.Nifti1Image(field.values, np.diag([*signs, 1]) @ affine)
        packed: bytes = image.to_bytes()
        return gzip.compress(packed, mtime=0) if extension(path) == ".nii.gz" else packed


def read_labels(path: PathLike) -> LabelImage:
    """Read an image of labels, such as a segmentation, with its position in the world.

    Parameters
    ----------
    path : str or path
        A ``.nrrd``, ``.vti`` or ``.npy`` file, or with nibabel a ``.nii`` or ``.nii.gz`` file. The axes of the image
        may be rotated and mirrored.

    Returns
    -------
    LabelImage
        The labels and their position in the world.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, damaged, has not three axes, or they are not at right angles.
    MissingPackageError
        If it is a NIfTI file, and nibabel is not installed.

    See Also
    --------
    io.LabelImage : An image of labels.
    io.read_volume : Read voxels.
    read : Read a shape or a solid.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/labels.npy", np.array([[[0, 3]], [[3, 3]]]))
    ...     read_labels(f"{folder}/labels.npy").surface(3).n_faces
    28
    """
    image = read_image(path, LABEL_FORMATS, "labels")
    with reading(path):
        return made(LabelImage, image.values, image.axes, image.origin, image.space)


def read_volume(path: PathLike, level: float | None = None, radius: float | None = None) -> DigitalSurface:
    """Read a set of voxels from an image, as a digital surface.

    Parameters
    ----------
    path : str or path
        A ``.nrrd``, ``.vti`` or ``.npy`` file. Origin and spacing of the latter are read from a ``.json`` file of the
        same name, or without it are 0 and 1.
    level : float, optional
        Voxels with values above it are inside. If it is not given, the image must have booleans, or zeros and ones.
    radius : float, optional
        Radius within which normals are estimated, in the units of the file, by default as for `DigitalSurface`.

    Returns
    -------
    DigitalSurface
        The boundary of the voxels that are inside, in the units of the file.

    Raises
    ------
    FileFormatError
        If the file is missing, of unknown format, truncated or damaged.
    GeometryError
        If the image is not a set of voxels.

    See Also
    --------
    io.read_labels : Read an image of labels.
    DigitalSurface : The boundary of voxels.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/one.npy", np.ones((1, 1, 1), dtype=bool))
    ...     read_volume(f"{folder}/one.npy").n_vertices
    8
    """
    with reading(path):
        image = read_image(path, VOLUME_FORMATS, "a volume")
        charge(bytes=BYTES_PER_READ_VOXEL * image.values.size)
        if image.values.ndim != 3:
            raise FileFormatError(f"a volume has 3 axes, and the image has {image.values.ndim}")
        inside = image.values if level is None else image.values > finite_number(level, "level")
        return DigitalSurface(inside, image.spacing, image.origin, radius)


def _listed(labels: NDArray[Any]) -> str:
    """Return words that list (k,) labels, at most twelve of them."""
    values = ", ".join(f"{label:g}" for label in labels[:12].tolist())
    return f"the label{'s' if len(labels) > 1 else ''} {values}{', …' if len(labels) > 12 else ''}"
