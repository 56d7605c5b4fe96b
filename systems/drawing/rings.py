"""Triangles between rings of vertices, of which round surfaces are made."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def ring_faces(n_rings: int, n_around: int) -> NDArray[np.int64]:
    """Return triangles that join each ring of vertices to the next.

    Parameters
    ----------
    n_rings, n_around : int
        Rings, and vertices of each.

    Returns
    -------
    faces : ndarray of int of shape (2 * (n_rings - 1) * n_around, 3)
        Vertex i of ring j has the number j * n_around + i.
    """
    ring, place = np.meshgrid(np.arange(n_rings - 1), np.arange(n_around), indexing="ij")
    here, right = ring * n_around + place, ring * n_around + (place + 1) % n_around
    above, above_right = here + n_around, right + n_around
    parts = (here, right, above_right), (here, above_right, above)
    return np.concatenate([np.stack(part, axis=2).reshape(-1, 3) for part in parts])
