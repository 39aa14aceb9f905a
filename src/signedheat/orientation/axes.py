"""Normals known up to sign, of points on an unknown surface, turned outwards together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ..geometry.signed_graph import Links, signs_of
from .empty_balls import sign_links
from .plane_fits import PlaneFits, fit_planes, noisy_sizes
from .thinning import spread_out

SPREAD = 0.35
"""Distance between the noisy points that stand for all, in reaches: noise that planes leave is small beside it."""
MOST = 100_000
"""Points for which tets are made; the others follow their neighbours."""
GIVEN_WEIGHT = 0.1
"""Weight of given signs, beside half of all that balls and neighbours tell about a point."""
DOUBTFUL = 3.0
"""Share of given signs that seem wrong, over that in which points contradict each other, up to which they stay."""
WORSE = 0.0015
"""Coherence by which larger neighbourhoods must gain, and which, once lost, no larger ones win back."""


@dataclass(frozen=True, eq=False)
class OutwardSigns:
    """Signs that turn axes outwards.

    Attributes
    ----------
    signs : (n,) float
        1 or −1.
    sided : bool
        Whether anything told which side is out.
    coherence : float
        Share of what pairs of points tell about each other that the signs agree with, less that which they contradict.
    """

    signs: NDArray[np.float64]
    sided: bool
    coherence: float


def fitted_outward(points: NDArray[np.float64]) -> tuple[PlaneFits, OutwardSigns]:
    """Planes near (n, 3) distinct points, and signs that turn their normals outwards.

    In noise, neighbourhoods too small fit planes to it, and too large ones to several sheets at once: either way the
    points contradict each other. The size with which they do so least is taken.
    """
    tried: list[tuple[PlaneFits, OutwardSigns]] = []
    for size in noisy_sizes(points) or (None,):
        fits = fit_planes(points, size)
        tried.append((fits, outward_signs(fits, fits.axes)))
        best = max(found.coherence for _, found in tried)
        if tried[-1][1].coherence < best - WORSE:
            break
    return next(one for one in tried if one[1].coherence >= best - WORSE)


def outward_signs(
    fits: PlaneFits, axes: NDArray[np.float64], given: bool = False, groups: NDArray[np.int64] | None = None
) -> OutwardSigns:
    """Signs that turn axes outwards.

    Parameters
    ----------
    fits : PlaneFits
        Where the points are, and how noisy.
    axes : (n, 3) float
        Unit normals, up to sign.
    given : bool
        Whether the axes' own signs are evidence. It is weak, and relative: if most are inverted, that is found out.
        They stay, or are all inverted, where hardly more of them seem wrong than points contradict each other.
    groups : (n,) int, optional
        Points of the same group, counted from 0, share one sign.
    """
    n = len(axes)
    chosen = spread_out(fits.places, SPREAD * fits.reaches) if fits.noisy else np.arange(n)
    if len(chosen) > MOST:
        chosen = np.sort(np.random.default_rng(0).choice(chosen, MOST, replace=False))
    places = fits.places[chosen]
    links, sided = sign_links(places, axes[chosen], fits.reaches[chosen], fits.noisy)
    m = len(chosen)
    if given:
        typical = 0.5 * float(np.median(links.strength(m + 1)[:m]))
        as_given = Links(np.arange(m), np.full(m, m + 1), np.full(m, GIVEN_WEIGHT * typical))
        links = Links.joined(links, as_given)
    nodes = np.arange(m + 2)
    if groups is not None:
        outside = int(groups.max()) + 1
        nodes = np.unique(np.append(groups[chosen], [outside, outside + 1]), return_inverse=True)[1].ravel()
    found = signs_of(links.renamed(nodes), int(nodes.max()) + 1)[nodes]
    signs = np.zeros(n)
    signs[chosen] = found[:m] * (found[m] if sided else found[m + 1] if given else 1.0)
    rest = np.flatnonzero(signs == 0)
    if len(rest):
        signs[rest] = _followed(places, axes[chosen] * signs[chosen, None], fits.places[rest], axes[rest])
    agreed = links.coherence(found)
    signs = signs if groups is None else _shared(signs, groups)
    if given and min((signs < 0).mean(), (signs > 0).mean()) <= DOUBTFUL * (1 - agreed):
        signs = np.full(n, 1.0 if signs.sum() >= 0 else -1.0)
    return OutwardSigns(signs, sided, agreed)


def _followed(
    places: NDArray[np.float64], normals: NDArray[np.float64], others: NDArray[np.float64], axes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Signs of axes at other places that agree with the normals around them."""
    distances, near = scipy.spatial.cKDTree(places).query(others, k=min(6, len(places)), workers=-1)
    distances, near = distances.reshape(len(others), -1), near.reshape(len(others), -1)
    weights = 1.0 / (distances + 1e-9 * max(float(distances.max()), np.finfo(float).tiny))
    cosines = np.einsum("nj,nkj->nk", axes, normals[near])
    return np.where((weights * cosines * np.abs(cosines)).sum(axis=1) >= 0, 1.0, -1.0)


def _shared(signs: NDArray[np.float64], groups: NDArray[np.int64]) -> NDArray[np.float64]:
    """Signs of the majority of each group."""
    return np.where(np.bincount(groups, signs) >= 0, 1.0, -1.0)[groups]
