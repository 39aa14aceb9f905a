"""Images with axes of their own, as medical programs write them: looked at along these axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..domains.digital_surface import DigitalSurface
from ..domains.polygon_mesh import PolygonMesh
from ..errors import FileFormatError
from ..fields.grid_field import GridField
from ..io import FIELD_FORMATS, load_field
from ..io.labels import NIFTI, LabelImage, format_of, read_labels

LISTED = 40
"""Different whole numbers up to which an image is one of labels."""


def field_or_image(path: str) -> Any:
    """A field, or the image that a file holds whose axes are not x, y, z; None for formats of neither."""
    if format_of(path) in NIFTI:
        return read_labels(path)
    if format_of(path) not in FIELD_FORMATS:
        return None
    try:
        return load_field(path)
    except FileFormatError as error:
        if format_of(path) == ".nrrd":
            try:
                return read_labels(path)
            except FileFormatError:
                raise error from None
        raise


def labels_of(image: LabelImage) -> list[int] | None:
    """The labels, if these are few whole numbers; otherwise the image holds a field."""
    values = image.labels.astype(np.int8) if image.labels.dtype == bool else image.labels
    found = np.unique(values[np.isfinite(values)])
    if len(found) > LISTED or (found != np.round(found)).any():
        return None
    return [int(label) for label in found]


def thing_of(image: LabelImage) -> GridField | PolygonMesh:
    """What an image shows, along its own axes: a field, or the boundary of all voxels with a label."""
    if labels_of(image) is None:
        return field_of(image)
    return DigitalSurface(image.labels != 0, image.spacing).squares


def field_of(image: LabelImage) -> GridField:
    """The values of an image as a field along its own axes."""
    return GridField(image.grid, image.labels.astype(np.float64))


def image_report(file: str, image: LabelImage) -> dict[str, Any]:
    """What `signedheat info` tells of an image."""
    values, labels = image.labels, labels_of(image)
    told: dict[str, Any] = {
        "file": file,
        "kind": "image of labels" if labels is not None else "image of a field",
        "shape": [int(n) for n in values.shape],
        "spacing": image.spacing.tolist(),
        "origin": image.origin.tolist(),
        "axes": image.axes.T.ravel().tolist(),
    }
    if image.space is not None:
        told["space"] = image.space
    if labels is None:
        return told | {"lowest": float(np.nanmin(values)), "highest": float(np.nanmax(values))}
    return told | {"labels": labels, "voxels": [int((values == label).sum()) for label in labels]}
