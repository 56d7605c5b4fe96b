"""Planners side by side on the same problems."""

from __future__ import annotations

from typing import Any

import numpy as np

from planners.share import draw_share
from reliability.axes import drawing_axes


class Comparison:
    """Planners side by side on the same problems; see :meth:`Evaluation.compare`.

    Parameters
    ----------
    evaluations : dict of str to Evaluation

    Attributes
    ----------
    evaluations : dict of str to Evaluation
    """

    def __init__(self, evaluations: dict[str, Any]) -> None:
        if not evaluations:
            raise ValueError("evaluations must hold at least one Evaluation, got none.")
        self.evaluations = evaluations
        self._first_name, self._first = next(iter(evaluations.items()))
        for name, one in evaluations.items():
            if not _same_problems(one, self._first):
                raise ValueError(
                    f"evaluations must be of the same problems: {name!r} has {one.n_problems} of "
                    f"random_state {one.random_state}, tolerance {one.tolerance:g}, and "
                    f"{self._first_name!r} {self._first.n_problems} of {self._first.random_state}, "
                    f"tolerance {self._first.tolerance:g}, or they are in other scenes."
                )

    def differing(self, name: str) -> tuple[int, int, float]:
        """Compare a planner with the first one, problem by problem.

        Returns
        -------
        only_this, only_first : int
            Problems in which just one of the two succeeds.
        p_value : float
            The sign test's (the exact McNemar test): how probable a difference at least as large
            is if both are equally good.
        """
        from scipy.stats import binomtest

        this, first = self.evaluations[name].succeeded, self._first.succeeded
        only_this, only_first = int((this & ~first).sum()), int((first & ~this).sum())
        n = only_this + only_first
        return only_this, only_first, float(binomtest(only_this, n).pvalue) if n else 1.0

    def to_dict(self) -> dict[str, Any]:
        """Return :meth:`Evaluation.to_dict` of each, and how each differs from the first."""
        keys = ("only_this", "only_first", "p_value")
        return {
            name: {
                **one.to_dict(),
                "against_first": dict(zip(keys, self.differing(name), strict=True)),
            }
            for name, one in self.evaluations.items()
        }

    def __str__(self) -> str:
        """Return a table with a line for each planner."""
        width = max(map(len, [*self.evaluations, "planner"]))
        lines = [
            f"{self._first.n_problems} problems, tolerance {self._first.tolerance:g}, "
            f"random_state {self._first.random_state}",
            f"{'planner':{width}s}  solved  successes   95 % interval   time (s)  AUC   "
            f"only this : only {self._first_name} succeeds",
        ]
        for name, one in self.evaluations.items():
            share, median = one.success_share, np.median(one.planning_time)
            auc = "  - " if np.isnan(one.success_auc) else f"{one.success_auc:4.2f}"
            lines.append(
                f"{name:{width}s}  {one.n_solved:6d}  {one.n_succeeded:9d}  "
                f"{share.low:6.1%} - {share.high:6.1%}  {median:8.3g}  {auc}"
                + (f"  {self._told_difference(name)}" if one is not self._first else "")
            )
        return "\n".join(lines)

    __repr__ = __str__

    def _told_difference(self, name: str) -> str:
        only_this, only_first, p_value = self.differing(name)
        return f"{only_this:3d} : {only_first:d}  (p = {p_value:.2g})"

    def plot(self, axis: Any = None) -> Any:
        """Draw each planner's share of executed successes with its interval.

        Parameters
        ----------
        axis : matplotlib Axes, default=None
            None makes a figure.

        Returns
        -------
        axis : matplotlib Axes
        """
        axis = drawing_axes(
            axis, "Comparison.plot", 1, figsize=(6.5, 1.2 + 0.4 * len(self.evaluations))
        )
        for row, one in enumerate(self.evaluations.values()):
            draw_share(axis, row, one.success_share, horizontal=True)
        axis.set_yticks(range(len(self.evaluations)), list(self.evaluations))
        axis.set(xlim=(0, 1), ylim=(len(self.evaluations) - 0.5, -0.5))
        axis.set(xlabel=f"share of executed successes in {self._first.n_problems} problems")
        return axis


def _same_problems(one: Any, other: Any) -> bool:
    return (
        one.random_state == other.random_state
        and one.tolerance == other.tolerance
        and np.array_equal(one.scene, other.scene)
    )
