"""Signed distances that PyTorch can differentiate with respect to the points and to the vertices of the mesh.

``sh.torch.distance(solid, points, vertices)`` is `Solid.distance` of tensors. PyTorch is imported at the first call.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import SourceError, UnsupportedTypeError
from .packages import lazy_module
from .solids.solid import Solid

if TYPE_CHECKING:
    from torch import Tensor

__all__ = ["distance"]

torch: Any = lazy_module("torch", "tensors")


def distance(solid: Solid, points: Tensor, vertices: Tensor | None = None) -> Tensor:
    """Compute signed distances of points to a solid, negative inside, that PyTorch can differentiate.

    Let d be the distance of a point p, and q the nearest point of the surface, with barycentric weights w in a face
    with corners v. If p and v change by δp and δv, then d changes by ``∇d · (δp − Σ w δv)``. If q lies on the
    completion, which is held fixed, d does not depend on the vertices. Second derivatives are not computed, but zero.

    Parameters
    ----------
    solid : Solid
        A solid that `complete` made of a mesh. Complete the mesh again after an optimiser has moved its vertices.
    points : (..., 3) tensor
        Positions in the units of the solid, on any device.
    vertices : (k, 3) tensor, optional
        Vertices of the mesh that was completed, if derivatives with respect to them are wanted. By default only the
        points have derivatives.

    Returns
    -------
    (...) tensor
        Signed distances in the units of the solid, on the device of the points, and in their type if that is a
        floating-point type. They are computed on the CPU in double precision.

    Raises
    ------
    SourceError
        If the solid was not completed from a triangle mesh with these vertices.
    UnsupportedTypeError
        If `solid` is no `Solid`.
    MissingPackageError
        If PyTorch is not installed.

    See Also
    --------
    Solid.distance : Exact distance of points.
    sample_distances : Points with their distances, to learn from.

    Examples
    --------
    >>> import signedheat as sh
    >>> import torch
    >>> cube = torch.tensor([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)], requires_grad=True)
    >>> faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    >>> triangles = [corners for a, b, c, d in faces for corners in ([a, b, c], [a, c, d])]
    >>> solid = sh.complete((cube.detach().numpy(), triangles))
    >>> points = torch.tensor([[0.3, 0.4, 1.5]], requires_grad=True)
    >>> d = sh.torch.distance(solid, points, cube)
    >>> d.backward()
    >>> round(d.item(), 6), points.grad.tolist(), round(-cube.grad[:, 2].sum().item(), 6)
    (0.5, [[0.0, 0.0, 1.0]], 1.0)
    """
    if not isinstance(solid, Solid):
        raise UnsupportedTypeError(
            f"a {type(solid).__name__} is no Solid", remedy="pass sh.complete(mesh)", element="solid"
        )
    points = torch.as_tensor(points)
    points = points if points.is_floating_point() else points.to(torch.get_default_dtype())
    rows, shape = points.reshape(-1, points.shape[-1] if points.ndim else 1), points.shape[:-1]
    closest = solid.closest(rows.detach().cpu().double().numpy())
    nearest = torch.from_numpy(closest.points)
    if vertices is not None:
        if solid.source is None:
            raise SourceError(
                "the solid was not completed from one triangle mesh", remedy="complete a triangle mesh", element="solid"
            )
        vertices = torch.as_tensor(vertices)
        now, then = vertices.detach().cpu().double().numpy(), solid.source.vertices
        # rounding to single precision is smaller than this, and steps of an optimiser are larger
        if now.shape != then.shape or not np.abs(now - then).max() <= 1e-5 * np.abs(then).max():
            raise SourceError(
                "the vertices differ from those of the completed mesh",
                remedy="complete the mesh again after each step",
                element="vertices",
            )
        given = np.flatnonzero(closest.faces >= 0)
        corners = torch.from_numpy(solid.source.faces[closest.faces[given]].astype(np.int64))
        weights = torch.from_numpy(closest.barycentric[given])
        moves = vertices.cpu().double()
        moves = moves - moves.detach()
        nearest = nearest.index_add(0, torch.from_numpy(given), (weights[..., None] * moves[corners]).sum(dim=1))
    exact = rows.cpu().double()
    slopes = torch.from_numpy(closest.gradients)
    moved = (exact - exact.detach()) - (nearest - nearest.detach())
    values = torch.from_numpy(closest.distances) + (moved * slopes).sum(dim=1)
    return values.reshape(shape).to(device=points.device, dtype=points.dtype)
