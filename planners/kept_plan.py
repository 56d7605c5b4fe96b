"""Plans in the files of a store."""

from __future__ import annotations

from typing import Any

import numpy as np

from planners.result import PlanResult, PlanStatus
from reliability.item_files import Item

_ARRAYS = ("reduced", "commands", "reliability")
_NUMBERS = (
    "planning_time",
    "simplification_time",
    "n_checked",
    "n_rejected",
    "n_accepted_unreliable",
    "random_state",
    "calibrated_probability",
)


def item_of(plan: Any) -> Item:
    """Return what a store can hold of a plan: all but its tree. Of other results, nothing."""
    if not isinstance(plan, PlanResult):
        return Item({})
    arrays = {name: getattr(plan, name) for name in _ARRAYS}
    return Item(
        {"status": plan.status.name, **{name: getattr(plan, name) for name in _NUMBERS}},
        {name: array for name, array in arrays.items() if array is not None},
    )


def plan_of(item: Item) -> PlanResult | None:
    """Return the plan that :func:`item_of` was given, without its tree."""
    if not item.facts:
        return None
    dim = item.arrays["reduced"].shape[1]
    return PlanResult(
        **{name: item.arrays.get(name) for name in _ARRAYS},
        **{name: item.facts[name] for name in _NUMBERS},
        status=PlanStatus[item.facts["status"]],
        tree=np.empty((0, 2, dim)),
    )
