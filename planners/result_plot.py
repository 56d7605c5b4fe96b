"""The picture of a plan and its search."""

from __future__ import annotations

from typing import Any

import numpy as np

from reliability.axes import drawing_axes

_TREE, _PLAN = "0.7", "0.35"
_COLORS = "RdYlBu"


def draw_plan(plan: Any, axes: Any = None) -> Any:
    """Draw a plan; see :meth:`PlanResult.plot`."""
    axes = drawing_axes(axes, "PlanResult.plot", 2, figsize=(10, 3.8))
    _draw_tree(plan, axes[0])
    _draw_reliability(plan, axes[1])
    return axes


def _draw_tree(plan: Any, axis: Any) -> None:
    x, y = 0, min(1, plan.tree.shape[2] - 1)
    # NaN between the edges makes one line of them all, which is drawn faster than many.
    edges = np.insert(plan.tree[:, :, [x, y]], 2, np.nan, axis=1).reshape(-1, 2)
    axis.plot(*edges.T, color=_TREE, linewidth=0.7, label="search tree")
    axis.plot(*plan.reduced[:, [x, y]].T, color=_PLAN, linewidth=1, label="plan")
    if plan.reliability is not None and len(plan.reliability):
        middles = (plan.reduced[1:, [x, y]] + plan.reduced[:-1, [x, y]]) / 2
        axis.scatter(
            *middles.T, c=plan.reliability, cmap=_COLORS, vmin=0, vmax=1, s=22, zorder=3
        ).set(edgecolor="0.3", linewidth=0.4)
    axis.plot(*plan.reduced[0, [x, y]], "ko", label="start")
    axis.set(xlabel=f"configuration[{x}]", ylabel=f"configuration[{y}]")
    axis.set_title(plan.status.name, fontsize="medium")
    axis.legend(fontsize="small")


def _draw_reliability(plan: Any, axis: Any) -> None:
    axis.set(ylim=(-0.03, 1.03), xlabel="transition", ylabel="reliability")
    if plan.reliability is None or not len(plan.reliability):
        why = "no estimator" if plan.solved else "no plan"
        axis.text(0.5, 0.5, why, ha="center", transform=axis.transAxes, color="0.4")
        return
    numbers = np.arange(1, len(plan.reliability) + 1)
    axis.step(numbers, plan.reliability, where="mid", color=_PLAN, linewidth=1)
    axis.scatter(numbers, plan.reliability, c=plan.reliability, cmap=_COLORS, vmin=0, vmax=1, s=22)
    axis.set_title(f"success_probability {plan.success_probability:.2g}", fontsize="medium")
