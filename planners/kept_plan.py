"""Plans in the files of a store."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from planners.result import PlanResult, PlanStatus
from reliability.item_files import Item


def item_of(plan: Any) -> Item:
    """Return what a store can hold of a plan: all but its tree. Of other results, nothing."""
    if not isinstance(plan, PlanResult):
        return Item({})
    values = {field.name: getattr(plan, field.name) for field in fields(plan)}
    del values["tree"]
    arrays = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    facts = {name: value for name, value in values.items() if name not in arrays}
    return Item({**facts, "status": plan.status.name}, arrays)


def plan_of(item: Item) -> PlanResult | None:
    """Return the plan that :func:`item_of` was given, without its tree."""
    if not item.facts:
        return None
    status = PlanStatus[item.facts["status"]]
    no_tree = np.empty((0, 2, item.arrays["reduced"].shape[1]))
    return PlanResult(**{**item.facts, **item.arrays, "status": status, "tree": no_tree})
