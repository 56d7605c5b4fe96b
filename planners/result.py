"""What a planner returns."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.result_plot import draw_plan
from reliability.archive import read_arrays, write_arrays
from systems.validation import as_finite_array, as_numbers, check_number, is_integer

FORMAT_VERSION = 2
Array = NDArray[np.float64]
# Left out of a file where they are None.
_MAY_BE_NONE = frozenset({"reliability", "calibrated_probability", "robustness"})
_ARRAYS = frozenset({"reduced", "commands", "tree", "reliability"})
_COUNTS = ("n_checked", "n_rejected", "n_accepted_unreliable")


class PlanStatus(Enum):
    """How planning ended; each value says what to do about it."""

    SOLVED = "The plan reaches the goal."
    ITERATION_LIMIT = (
        "No plan was found within max_iterations. Raise max_iterations, or lower k so that more "
        "Unreliable transitions are accepted."
    )
    TIME_LIMIT = (
        "No plan was found within time_limit. Raise time_limit, or lower k so that more "
        "Unreliable transitions are accepted."
    )
    TERMINATED = (
        "No plan was found before OMPL's termination condition became true. Allow the planner "
        "more time, or lower k so that more Unreliable transitions are accepted."
    )
    DISTRUSTED = (
        "The plan reaches the goal, but it is less likely to go well than min_success. Raise "
        "restarts to plan again with other seeds, train the estimator on more executed plans like "
        "this one, or lower min_success."
    )


@dataclass(frozen=True, eq=False)
class PlanResult:
    """A plan, or why there is none, and what it took.

    Attributes
    ----------
    reduced : ndarray of shape (T + 1, reduced_dim)
        Reduced states, the start first; the start alone without a plan. A distrusted plan is
        here too.
    commands : ndarray of shape (T, command_dim)
    status : PlanStatus
    reliability : ndarray of shape (T,) or None
        Probability that each transition is Reliable; 1 or 0 from an estimator that only
        predicts, None without an estimator.
    planning_time, simplification_time : float
        Seconds; with restarts, of all searches together, as are the counts.
    n_checked : int
        Transitions that the estimator was asked about, in the search and in simplification.
    n_rejected : int
        Unreliable transitions that were not accepted.
    n_accepted_unreliable : int
        Unreliable transitions that were accepted by a draw.
    tree : ndarray of shape (n_edges, 2, configuration_dim)
        Configurations of accepted edges, in the direction of execution.
    random_state : int
        Seed that gives this result again.
    calibrated_probability : float or None, default=None
        Probability that the plan goes well, from the planner's ``calibration``; None where the
        planner has none or there is no plan.
    robustness : float or None, default=None
        Share of slightly varied models that predict the same end as the plan; None without a plan
        or an estimator, or if the system does not define ``vary``. See
        :func:`planners.plan_robustness.plan_robustness`.
    turning : float, default=0.0
        How much the motion changes from each transition to the next, in steps; see
        :func:`planners.plan_turning.plan_turning`.
    """

    reduced: Array
    commands: Array
    status: PlanStatus
    reliability: Array | None
    planning_time: float
    simplification_time: float
    n_checked: int
    n_rejected: int
    n_accepted_unreliable: int
    tree: Array
    random_state: int
    calibrated_probability: float | None = None
    robustness: float | None = None
    turning: float = 0.0

    @property
    def solved(self) -> bool:
        """Whether there is a plan that reaches the goal, trusted or not."""
        return self.status in (PlanStatus.SOLVED, PlanStatus.DISTRUSTED)

    @property
    def success(self) -> bool:
        """Whether there is a plan that reaches the goal and is to be trusted."""
        return self.status is PlanStatus.SOLVED

    @property
    def success_probability(self) -> float:
        """Probability that the plan goes well.

        It is ``calibrated_probability`` if the planner has a calibration. Else it is
        ``reliability_product`` times ``robustness``, if that is known; this orders plans well and
        is no frequency of success.
        """
        if self.calibrated_probability is not None:
            return self.calibrated_probability
        return self.reliability_product * (1.0 if self.robustness is None else self.robustness)

    @property
    def reliability_product(self) -> float:
        """Probability that all transitions are Reliable, if they don't depend on one another.

        1 without an estimator, and 0 without a plan.
        """
        if not self.solved:
            return 0.0
        return 1.0 if self.reliability is None else float(self.reliability.prod())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one npz file.

        Raises
        ------
        ValueError
            If this is not a whole plan: arrays of numbers that go together, counts, times,
            probabilities, and a seed.
        """
        values: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        for name in _MAY_BE_NONE:
            if values[name] is None:
                del values[name]
        _check_plan({**values, **{n: as_numbers(values[n], n) for n in _ARRAYS & values.keys()}})
        values["status"] = self.status.name
        # As text, since a seed may be larger than any of numpy's integers.
        values["random_state"] = str(self.random_state)
        write_arrays(path, values, format_version=FORMAT_VERSION)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> PlanResult:
        """Read a file that :meth:`save` wrote.

        Raises
        ------
        ValueError
            If the file is no such file, is truncated or damaged, has another format version, or
            holds what does not make a plan.
        """
        names = {field.name for field in fields(cls)}
        required = names - _MAY_BE_NONE
        arrays = read_arrays(path, required, format_version=FORMAT_VERSION, kind="a plan")
        try:
            values: dict[str, Any] = {name: arrays[name] for name in names & arrays.keys()}
            for name in values.keys() - _ARRAYS:
                values[name] = arrays[name].item()
            values["status"] = PlanStatus[values["status"]]
            values["random_state"] = int(values["random_state"])
            _check_plan(values)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path} is not a whole file of a plan ({error})") from error
        missing: dict[str, Any] = dict.fromkeys(_MAY_BE_NONE)
        return cls(**missing | values)

    def plot(self, axes: Any = None) -> Any:
        """Draw the search tree with the plan, and the reliability of each transition.

        For a quick look: of configurations, the tree shows the first two entries. How the system
        moves is shown by :func:`planners.show`.

        Parameters
        ----------
        axes : sequence of two matplotlib Axes, default=None
            None makes a figure.

        Returns
        -------
        axes : sequence of two matplotlib Axes
        """
        return draw_plan(self, axes)

    def __repr__(self) -> str:
        return (
            f"PlanResult({self.status.name}, {len(self.commands)} commands, "
            f"success_probability={self.success_probability:.3g}, "
            f"random_state={self.random_state})"
        )


def _check_plan(values: dict[str, Any]) -> None:
    """Raise ``ValueError`` unless values are those of one plan; what may be None may be missing."""
    if not isinstance(values["status"], PlanStatus):
        raise ValueError(f"status must be a PlanStatus, got {values['status']!r}.")
    if not is_integer(values["random_state"]):
        raise ValueError(f"random_state must be an integer, got {values['random_state']!r}.")
    for name in _COUNTS:
        if not is_integer(values[name]) or values[name] < 0:
            raise ValueError(f"{name} must be a number of transitions, got {values[name]!r}.")
    for name in ("planning_time", "simplification_time", "turning"):
        check_number(values[name], name, 0, np.inf)
    for name in _MAY_BE_NONE - _ARRAYS & values.keys():
        check_number(values[name], name, 0, 1)
    _check_arrays(values)


def _check_arrays(arrays: dict[str, Any]) -> None:
    n = arrays["commands"].shape[0] if arrays["commands"].ndim else 0
    expected = {
        "commands": (None, None),
        "reduced": (n + 1, None),
        "tree": (None, 2, None),
        "reliability": (n,),
    }
    for name, shape in expected.items():
        if name in arrays:
            as_finite_array(arrays[name], name, shape)
    if "reliability" in arrays and n:
        for extreme in (arrays["reliability"].min(), arrays["reliability"].max()):
            check_number(float(extreme), "reliability", 0, 1)
