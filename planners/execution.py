"""What came of carrying out a plan: what the system did, and why that ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from systems.system import Array


class ExecutionStatus(Enum):
    """How an execution ended; each value says what to do about it."""

    REACHED = "The system is within the tolerance of the goal."
    NO_PLAN = (
        "No plan was found from where the system was when it was made. The last plan's status "
        "says what to do about it."
    )
    MISSED = (
        "The system is Close to the end of its plan, and yet not within the tolerance of the goal. "
        "Ask for a larger tolerance, or make the system's close and goal_reached narrower."
    )
    CONSTRAINT = (
        "The system stopped at the boundary of a constraint, and no replan was left; stop_reason "
        "says which. Allow more replans (max_replans), or plan with an estimator."
    )
    START_NOT_ALLOWED = (
        "The system left its plan and was where no plan may start: far out of its bounds, or "
        "where propagate is not valid even for standing still. Make bounds and propagate allow "
        "what the true system can come to, or plan with an estimator that keeps away from there."
    )
    LEFT_PLAN = (
        "The system left its plan when no replan was left, and the rest of the plan did not lead "
        "to the goal. Allow more replans (max_replans), or plan with an estimator."
    )
    SIMULATION_DIVERGED = (
        "The simulator diverged, so what came next is not known. Look at the last state and the "
        "plan's command there; simulate in smaller steps if they are harmless."
    )


@dataclass(frozen=True, eq=False)
class Execution:
    """What a system did, which plans it followed, and why that ended.

    Attributes
    ----------
    status : ExecutionStatus
    stop_reason : Enum or None
        That of the last rollout; None if nothing was carried out.
    states : list of states
        The true start, and the true state after each command.
    commands : ndarray of shape (len(states) - 1, command_dim)
        Commands that were given; where the system stopped at the boundary of a constraint, the
        one under way too.
    plans : list of PlanResult
        All that were made, in order. One without ``success`` or without commands was not carried
        out; what came before it was.
    plan_starts : list of int
        For each plan, the number of the state from which it was made.
    planning_time : float
        Seconds that all plans took together.
    """

    status: ExecutionStatus
    stop_reason: Enum | None
    states: list[Any]
    commands: Array
    plans: list[Any]
    plan_starts: list[int]
    planning_time: float

    @property
    def success(self) -> bool:
        """Whether the system is within the tolerance of the goal."""
        return self.status is ExecutionStatus.REACHED

    @property
    def n_replans(self) -> int:
        """How many plans were made after the first."""
        return len(self.plans) - 1

    def __repr__(self) -> str:
        return (
            f"Execution({self.status.name}, {len(self.commands)} commands, "
            f"{self.n_replans} replans)"
        )
