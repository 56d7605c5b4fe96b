"""A path through reduced states."""

from __future__ import annotations

from typing import NamedTuple

from systems.system import Array


class Path(NamedTuple):
    """Reduced states, and the commands that lead from each to the next.

    Attributes
    ----------
    reduced : ndarray of shape (T + 1, reduced_dim)
    commands : ndarray of shape (T, command_dim)
    """

    reduced: Array
    commands: Array
