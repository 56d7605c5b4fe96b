"""Edges of a planning tree, cut into transitions of at most one step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.compilation import compiled
from systems.validation import as_numbers, is_finite, is_number

Array = NDArray[np.float64]


def split_edges(
    starts: Array, ends: Array, step_size: float, angular: tuple[int, ...] = ()
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Cut straight edges into equal transitions no longer than ``step_size``.

    Parameters
    ----------
    starts, ends : ndarray of shape (n_edges, d)
    step_size : float
    angular : tuple of int, default=()
        Entries that are angles, which an edge turns the short way round.

    Returns
    -------
    origins, targets : ndarray of shape (n_transitions, d)
        In order along each edge; an edge of no length is one transition.
    edge : ndarray of int of shape (n_transitions,)
        The edge that each transition belongs to.

    Raises
    ------
    ValueError
        If the shapes differ, a number is not finite, or ``step_size`` is not positive.
    """
    begins, stops = as_numbers(starts, "starts"), as_numbers(ends, "ends")
    if begins.ndim != 2 or begins.shape != stops.shape:
        raise ValueError(
            f"starts and ends must have one shape, (n_edges, d), got {begins.shape} and "
            f"{stops.shape}."
        )
    if not (is_finite(begins) and is_finite(stops)):
        raise ValueError("starts and ends must be finite, got NaN or infinity.")
    if not is_number(step_size) or not 0 < step_size < np.inf:
        raise ValueError(f"step_size must be a positive number, got {step_size!r}.")
    if not angular:
        return _split_straight(begins, stops, float(step_size))
    return _split_turning(begins, stops, float(step_size), angular)


@compiled
def _split_straight(
    starts: Array, ends: Array, step_size: float
) -> tuple[Array, Array, NDArray[np.int64]]:
    n_edges, dim = starts.shape
    pieces = np.empty(n_edges, np.int64)
    for e in range(n_edges):
        squared = 0.0
        for i in range(dim):
            squared += (ends[e, i] - starts[e, i]) ** 2
        # The allowance keeps an edge of exactly m steps from becoming m + 1 by rounding.
        pieces[e] = max(1, int(np.ceil(np.sqrt(squared) / step_size - 1e-9)))
    total = pieces.sum()
    origins = np.empty((total, dim))
    targets = np.empty((total, dim))
    edge = np.empty(total, np.int64)
    row = 0
    for e in range(n_edges):
        for piece in range(pieces[e]):
            edge[row] = e
            for i in range(dim):
                length = ends[e, i] - starts[e, i]
                origins[row, i] = starts[e, i] + length * (piece / pieces[e])
                if piece + 1 < pieces[e]:
                    targets[row, i] = starts[e, i] + length * ((piece + 1) / pieces[e])
                else:
                    targets[row, i] = ends[e, i]
            row += 1
    return origins, targets, edge


@compiled
def _split_turning(
    starts: Array, ends: Array, step_size: float, angular: tuple[int, ...]
) -> tuple[Array, Array, NDArray[np.int64]]:
    unrolled = ends.copy()
    for e in range(starts.shape[0]):
        for i in angular:
            unrolled[e, i] = starts[e, i] + wrap_angle(ends[e, i] - starts[e, i])
    origins, targets, edge = _split_straight(starts, unrolled, step_size)
    for row in range(edge.shape[0]):
        for i in angular:
            origins[row, i] = wrap_angle(origins[row, i])
            targets[row, i] = wrap_angle(targets[row, i])
        # Despite rounding, an edge must end exactly at its vertex.
        if row + 1 == edge.shape[0] or edge[row + 1] != edge[row]:
            targets[row] = ends[edge[row]]
    return origins, targets, edge
