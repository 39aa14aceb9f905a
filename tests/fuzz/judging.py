"""What holds for every answer: inputs as they were, NaN announced, no infinity, no number beyond reason."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

import signedheat as sh
from fuzz.frame import Wrong, fail_on_warnings
from signedheat.arrays import fingerprint

BEYOND_REASON = 100.0
"""Times the length of all edges, or the diameter and the levels."""


@dataclass(frozen=True)
class Subject:
    """A case that is built while it is checked, since building is what may be refused."""

    seed: int

    @property
    def random(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)


def subject(random: np.random.Generator, _: Any) -> Subject:
    """For `family`: a seed, and no more."""
    return Subject(int(random.integers(2**62)))


@contextmanager
def unchanged(*arrays: Any) -> Iterator[None]:
    """Arrays are the same afterwards, whatever becomes of the call."""
    given = [a for a in arrays if isinstance(a, np.ndarray) and a.dtype != object]
    before = [fingerprint(a) for a in given]
    try:
        yield
    finally:
        if [fingerprint(a) for a in given] != before:
            raise Wrong("changed input", str([a.shape for a in given]))


def announced(call: Callable[[], Any]) -> tuple[Any, bool]:
    """The result of a call, and whether it warned of parts that no source reaches; other warnings are failures."""
    with warnings.catch_warnings(record=True) as caught:
        fail_on_warnings("always")
        result = call()
    return result, any(issubclass(w.category, sh.errors.UnreachedWarning) for w in caught)


def judge(values: np.ndarray, warned: bool, size: float, about: str = "values") -> None:
    """Raise `Wrong` unless values are finite where they are told to be, and not beyond reason."""
    values = np.asarray(values)
    if np.isinf(values).any():
        raise Wrong("infinite", f"{about}: {np.isinf(values).sum()} of {values.size}")
    if np.isnan(values).any() and not warned:
        raise Wrong("NaN without a word", f"{about}: {np.isnan(values).sum()} of {values.size}")
    most = np.abs(values[np.isfinite(values)]).max(initial=0.0)
    if most > BEYOND_REASON * size:
        raise Wrong("beyond reason", f"{about}: {most:.3g}, in a domain of size {size:.3g}")


def length_of_edges(domain: Any) -> float:
    """Length of all edges of a surface or of a tet mesh: no way is longer."""
    mesh = (
        domain.boundary
        if isinstance(domain, sh.TetMesh)
        else domain.triangulation
        if hasattr(domain, "triangulation")
        else domain.mesh
    )
    corners = mesh.vertices[mesh.faces]
    return float(np.abs(corners - np.roll(corners, 1, axis=1)).sum() + 1e-12 * np.abs(corners).max())


def levels_of(constraint: Any) -> float:
    """The largest level that a constraint asks for."""
    return float(np.abs(constraint.values).max()) if isinstance(constraint, sh.constraints.LevelValues) else 0.0
