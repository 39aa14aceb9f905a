"""Votes of lines through a shape on which way its parts face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled


class Votes(NamedTuple):
    """Counts over crossings of lines with the parts of a shape, (n_parts,) each; votes are positive for "as it is".

    A line enters a solid where it meets it first and leaves it where it meets it last. Where that is the same
    crossing, it is seen from both sides and has no vote, so that sheets that lie open to both sides get none. Of a line
    with any other odd number of crossings something is missing somewhere: it has no vote.

    Attributes
    ----------
    crossings : int
        Crossings of any line.
    seen, seen_votes : int
        First and last crossings of lines, all parts together: the sides seen from outside; and their votes.
    own, own_votes : int
        The same, each part as if it were alone.
    even, even_votes : int
        Crossings of lines with an even number of them, all parts together; votes of entering and leaving in turn.
    """

    crossings: NDArray[np.int64]
    seen: NDArray[np.int64]
    seen_votes: NDArray[np.int64]
    own: NDArray[np.int64]
    own_votes: NDArray[np.int64]
    even: NDArray[np.int64]
    even_votes: NDArray[np.int64]


@compiled
def votes(starts: NDArray[np.int64], parts: NDArray[np.int64], entering: NDArray[np.bool_], n_parts: int) -> Votes:
    """Count the votes of all crossings: the parts crossed along lines, and whether lines come from where normals point.

    Examples
    --------
    >>> found = votes(np.array([0, 2, 3]), np.array([0, 0, 1]), np.array([True, False, True]), 2)
    >>> found.seen_votes.tolist(), found.seen.tolist()
    ([2, 0], [2, 2])
    """
    crossings, seen, seen_votes = np.zeros(n_parts, np.int64), np.zeros(n_parts, np.int64), np.zeros(n_parts, np.int64)
    own, own_votes = np.zeros(n_parts, np.int64), np.zeros(n_parts, np.int64)
    even, even_votes = np.zeros(n_parts, np.int64), np.zeros(n_parts, np.int64)
    latest = np.full(n_parts, -1, np.int64)
    for line in range(len(starts) - 1):
        begin, end = starts[line], starts[line + 1]
        for k in range(begin, end):
            part, vote = parts[k], 1 if entering[k] else -1
            crossings[part] += 1
            if (end - begin) % 2 == 0:
                even[part] += 1
                even_votes[part] += vote if (k - begin) % 2 == 0 else -vote
                if k == begin or k == end - 1:
                    seen[part] += 1
                    seen_votes[part] += vote if k == begin else -vote
            elif end - begin == 1:
                seen[part] += 2
            if latest[part] < begin:  # the first of the part on this line
                own[part] += 2
                own_votes[part] += vote
            latest[part] = k
        for k in range(begin, end):
            part = parts[k]
            if latest[part] == k:
                own_votes[part] -= 1 if entering[k] else -1
    return Votes(crossings, seen, seen_votes, own, own_votes, even, even_votes)


@compiled
def containers(
    starts: NDArray[np.int64], parts: NDArray[np.int64], entering: NDArray[np.bool_], bounding: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """(k,) part within which each crossing lies: of those that the line is in, the one it entered last; −1 for none.

    Each part faces out of itself. Only `bounding` parts, (n_parts,), have an inside. They count on lines that enter
    them as often as they leave them.

    Examples
    --------
    >>> bounding, entering = np.array([True, True]), np.array([True, True, False, False])
    >>> containers(np.array([0, 4]), np.array([0, 1, 1, 0]), entering, bounding).tolist()
    [-1, 0, 0, -1]
    """
    n_parts = len(bounding)
    found = np.full(len(parts), -1, dtype=np.int64)
    sums, latest = np.zeros(n_parts, np.int64), np.full(n_parts, -1, np.int64)
    longest = 0
    for line in range(len(starts) - 1):
        longest = max(longest, starts[line + 1] - starts[line])
    stack = np.empty(longest, np.int64)
    for line in range(len(starts) - 1):
        begin, end = starts[line], starts[line + 1]
        for k in range(begin, end):
            part = parts[k]
            if latest[part] < begin:
                sums[part] = 0
            latest[part] = k
            sums[part] += 1 if entering[k] else -1
        depth = 0
        for k in range(begin, end):
            part = parts[k]
            counts = bounding[part] and sums[part] == 0
            if counts and not entering[k]:
                at = depth - 1
                while at >= 0 and stack[at] != part:
                    at -= 1
                if at >= 0:
                    for above in range(at, depth - 1):
                        stack[above] = stack[above + 1]
                    depth -= 1
            at = depth - 1
            while at >= 0 and stack[at] == part:
                at -= 1
            if at >= 0:
                found[k] = stack[at]
            if counts and entering[k]:
                stack[depth] = part
                depth += 1
    return found


def imbalance(starts: NDArray[np.int64], entering: NDArray[np.bool_]) -> float:
    """Share of the crossings of lines that enter a shape without leaving it, or the other way round; 0 if it is closed.

    Examples
    --------
    >>> imbalance(np.array([0, 2, 4]), np.array([True, False, True, True]))
    0.5
    """
    sums = np.concatenate([[0], np.cumsum(np.where(entering, 1, -1))])
    return float(np.abs(np.diff(sums[starts])).sum() / max(len(entering), 1))
