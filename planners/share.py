"""Shares of a number of trials, with intervals."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from systems.validation import MOST, is_integer


class Share(NamedTuple):
    """How many of several, with the interval that holds the true share with confidence 0.95.

    Attributes
    ----------
    n, total : int
    low, high : float
        Wilson's interval.
    """

    n: int
    total: int
    low: float
    high: float

    @classmethod
    def of(cls, n: int, total: int) -> Share:
        """Compute the interval; it is 0 to 1 if there are none.

        Raises
        ------
        ValueError
            If these are no integers, or ``n`` is not from 0 to ``total``.
        """
        from scipy.stats import binomtest

        if not is_integer(total) or not 0 <= total <= MOST:
            raise ValueError(f"total must be an integer from 0 to 2**63 - 1, got {total!r}.")
        if not is_integer(n) or not 0 <= n <= total:
            raise ValueError(f"n must be an integer from 0 to total, {total}, got {n!r}.")
        if total == 0:
            return cls(0, 0, 0.0, 1.0)
        interval = binomtest(int(n), int(total)).proportion_ci(method="wilson")
        return cls(n, total, float(interval.low), float(interval.high))

    def __str__(self) -> str:
        if not self.total:
            return "0 of 0"
        return (
            f"{self.n} of {self.total}, {self.n / self.total:.1%} "
            f"({self.low:.1%} to {self.high:.1%})"
        )


def draw_share(axis: Any, place: float, share: Share, *, horizontal: bool = False) -> None:
    """Draw a share and its interval at a place of the other axis."""
    middle = share.n / share.total
    # Rounding may put an interval's end a hair inside the share itself.
    reach = np.maximum([[middle - share.low], [share.high - middle]], 0)
    style = {"fmt": "o", "color": "tab:blue", "capsize": 3}
    if horizontal:
        axis.errorbar(middle, place, xerr=reach, **style)
    else:
        axis.errorbar(place, middle, yerr=reach, **style)
        axis.annotate(
            f"{share.total}", (place, share.high), (0, 4), textcoords="offset points", ha="center"
        )
