"""Planners that distrust: biased RRT and RRT-Connect on OMPL, for any estimator."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from planners.result import PlanResult, PlanStatus

if TYPE_CHECKING:
    from planners.check_transition import CheckTransition
    from planners.restarts import best_of_restarts
    from planners.rrt import BiasedRRT
    from planners.rrt_connect import BiasedRRTConnect

__all__ = [
    "BiasedRRT",
    "BiasedRRTConnect",
    "CheckTransition",
    "PlanResult",
    "PlanStatus",
    "best_of_restarts",
]

_HOMES = {
    "BiasedRRT": "planners.rrt",
    "BiasedRRTConnect": "planners.rrt_connect",
    "CheckTransition": "planners.check_transition",
    "best_of_restarts": "planners.restarts",
}


def __getattr__(name: str) -> Any:
    # OMPL, numba and scikit-learn are imported when a planner is first named.
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'planners' has no attribute {name!r}")
