"""What came of planning and executing on many problems, as tables and plots."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.comparison import Comparison
from planners.execution import ExecutionStatus
from planners.share import Share, draw_share
from reliability.axes import drawing_axes
from systems.system import Array

_N_BINS = 5


@dataclass(frozen=True, eq=False, repr=False)
class Evaluation:
    """What came of a planner's plans on unseen problems; entries are in the problems' order.

    Attributes
    ----------
    tolerance : float
    max_replans : int
    random_state : int
        Gives the same problems again.
    scene : ndarray of int of shape (n_problems,)
        Ids of the scenes, as in :class:`reliability.Transitions`.
    solved : ndarray of bool of shape (n_problems,)
        Whether the first plan reaches the goal by g.
    status : list of ExecutionStatus
        How each execution ended.
    stop_reason : list of str or None
        The last rollout's, in words; None if nothing was carried out.
    planning_time : ndarray of shape (n_problems,)
        Seconds, of all plans of a problem together.
    n_transitions : ndarray of int of shape (n_problems,)
        Of the first plan.
    n_replans : ndarray of int of shape (n_problems,)
    success_probability : ndarray of shape (n_problems,)
        Of the first plan; NaN if the planner's results have none.
    plans : list of PlanResult
        The first plan, or why there is none, without its tree; None for a planner that returns
        anything else.
    """

    tolerance: float
    max_replans: int
    random_state: int
    scene: NDArray[np.int64]
    solved: NDArray[np.bool_]
    status: list[ExecutionStatus]
    stop_reason: list[str | None]
    planning_time: Array
    n_transitions: NDArray[np.int64]
    n_replans: NDArray[np.int64]
    success_probability: Array
    plans: list[Any] = field(default_factory=list)

    @classmethod
    def of(
        cls,
        outcomes: Sequence[Mapping[str, Any]],
        tolerance: float,
        max_replans: int,
        random_state: int,
    ) -> Evaluation:
        """Put the outcomes of single problems, at least one, together.

        Parameters
        ----------
        outcomes : sequence of dict
            For each problem, a value for each attribute that has one per problem; the status by
            its name.
        tolerance, max_replans, random_state
            As in :func:`evaluate`.
        """
        columns = {name: [one[name] for one in outcomes] for name in outcomes[0]}
        columns["status"] = [ExecutionStatus[name] for name in columns["status"]]
        lists = ("status", "stop_reason", "plans")
        values: dict[str, Any] = {
            name: column if name in lists else np.array(column) for name, column in columns.items()
        }
        return cls(tolerance, max_replans, random_state, **values)

    @property
    def n_problems(self) -> int:
        """How many problems there were."""
        return len(self.status)

    @property
    def n_solved(self) -> int:
        """For how many problems the first plan reaches the goal by g."""
        return int(self.solved.sum())

    @property
    def succeeded(self) -> NDArray[np.bool_]:
        """Whether the true system came within the tolerance of each goal."""
        return np.array([status is ExecutionStatus.REACHED for status in self.status])

    @property
    def n_succeeded(self) -> int:
        """In how many problems the true system came within the tolerance of the goal."""
        return int(self.succeeded.sum())

    @property
    def solved_share(self) -> Share:
        """Solved problems among all, with Wilson's interval."""
        return Share.of(self.n_solved, self.n_problems)

    @property
    def success_share(self) -> Share:
        """Executed successes among all problems, with Wilson's interval."""
        return Share.of(self.n_succeeded, self.n_problems)

    @property
    def executed_plans(self) -> tuple[list[Any], NDArray[np.bool_]]:
        """The plans that were carried out, and whether each succeeded.

        What :class:`SuccessCalibration` learns from:
        ``SuccessCalibration().fit(*evaluation.executed_plans)``.

        Raises
        ------
        ValueError
            If ``max_replans`` is not 0: a success is then not the first plan's alone.
        """
        if self.max_replans:
            raise ValueError(
                "executed_plans are those of an evaluation without replans: a success after "
                f"replanning is not the first plan's. Here max_replans is {self.max_replans}."
            )
        carried_out = [plan for plan, solved in zip(self.plans, self.solved, strict=True) if solved]
        return carried_out, self.succeeded[self.solved]

    @property
    def success_auc(self) -> float:
        """How well ``success_probability`` tells plans that succeed from those that fail.

        The area under the ROC curve of the solved problems: 1 is perfect, 0.5 chance. NaN if all
        succeed or none, or if all probabilities are the same, as without an estimator.
        """
        from sklearn.metrics import roc_auc_score

        succeeded, probability = self.succeeded[self.solved], self.success_probability[self.solved]
        told_apart = len(np.unique(succeeded)) == 2 and len(np.unique(probability)) > 1
        if not told_apart or np.isnan(probability).any():
            return float("nan")
        return float(roc_auc_score(succeeded, probability))

    @staticmethod
    def compare(evaluations: Mapping[str, Evaluation]) -> Comparison:
        """Set planners that were given the same problems side by side.

        Parameters
        ----------
        evaluations : dict of str to Evaluation
            By the planners' names; the others are compared with the first.

        Raises
        ------
        ValueError
            If they are not of the same problems: of the same ``random_state``, scenes and number.
        """
        if not isinstance(evaluations, Mapping):
            raise ValueError(f"evaluations must be a dict, got {evaluations!r}.")
        for name, one in evaluations.items():
            if not isinstance(one, Evaluation):
                raise ValueError(f"evaluations[{name!r}] must be an Evaluation, got {one!r}.")
        return Comparison(dict(evaluations))

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers as JSON can hold them: the totals, and a list with every problem."""
        return {
            "tolerance": self.tolerance,
            "max_replans": self.max_replans,
            "random_state": self.random_state,
            "n_problems": self.n_problems,
            "solved": self.solved_share._asdict(),
            "succeeded": self.success_share._asdict(),
            "planning_time": _centre(self.planning_time),
            "n_transitions": _centre(self.n_transitions[self.solved]),
            "success_auc": _json_number(self.success_auc),
            "status": {status.name: n for status, n in Counter(self.status).most_common()},
            "stop_reason": dict(Counter(filter(None, self.stop_reason)).most_common()),
            "problems": [self._problem(i) for i in range(self.n_problems)],
        }

    def _problem(self, i: int) -> dict[str, Any]:
        return {
            "scene": int(self.scene[i]),
            "solved": bool(self.solved[i]),
            "succeeded": self.status[i] is ExecutionStatus.REACHED,
            "status": self.status[i].name,
            "stop_reason": self.stop_reason[i],
            "planning_time": float(self.planning_time[i]),
            "n_transitions": int(self.n_transitions[i]),
            "n_replans": int(self.n_replans[i]),
            "success_probability": _json_number(float(self.success_probability[i])),
        }

    def __str__(self) -> str:
        """Return the numbers in a table, and how executions ended and what to do about it."""
        time, steps = _centre(self.planning_time), self.n_transitions[self.solved]
        lines = [
            f"{self.n_problems} problems, tolerance {self.tolerance:g}, at most {self.max_replans} "
            f"replans, random_state {self.random_state}",
            f"solved               {self.solved_share}",
            f"executed successes   {self.success_share}",
            f"planning time        {time['median']:.3g} s in the median, {time['mean']:.3g} s in "
            "the mean",
        ]
        if len(steps):
            lines.append(
                f"transitions          {np.median(steps):.0f} in the median, {steps.mean():.1f} in "
                "the mean, of the first plans"
            )
        if self.max_replans:
            lines.append(f"replans              {self.n_replans.mean():.2f} in the mean")
        if not np.isnan(self.success_auc):
            lines.append(
                f"success_probability  {self.success_probability[self.solved].mean():.2f} in the "
                f"mean of solved problems; AUC of success {self.success_auc:.2f}"
            )
        lines += ["How executions ended:"]
        lines += [
            f"{n:5d}  {status.name}: {status.value}"
            for status, n in Counter(self.status).most_common()
        ]
        reasons = Counter(filter(None, self.stop_reason)).most_common()
        return "\n".join(
            [*lines, "Why the last rollouts ended:", *(f"{n:5d}  {why}" for why, n in reasons)]
            if reasons
            else lines
        )

    __repr__ = __str__

    def plot(self, axes: Any = None) -> Any:
        """Draw how executions ended, and success against ``success_probability``.

        Parameters
        ----------
        axes : sequence of two matplotlib Axes, default=None
            None makes a figure.

        Returns
        -------
        axes : sequence of two matplotlib Axes
        """
        axes = drawing_axes(axes, "Evaluation.plot", 2, figsize=(9, 3.2))
        counts = Counter(status.name for status in self.status).most_common()
        names = [name.lower().replace("_", " ") for name, _ in counts]
        colors = ["tab:green" if name == "reached" else "tab:red" for name in names]
        bars = axes[0].barh(names, [n for _, n in counts], color=colors)
        axes[0].bar_label(bars, padding=2)
        axes[0].invert_yaxis()
        axes[0].margins(x=0.12)
        axes[0].set(xlabel="problems", title=f"{self.n_succeeded} executed successes")
        axes[0].title.set_fontsize("medium")
        self._plot_probabilities(axes[1])
        return axes

    def _plot_probabilities(self, axis: Any) -> None:
        probability = self.success_probability[self.solved]
        axis.plot([0, 1], [0, 1], color="0.7", linestyle=":")
        axis.set(xlabel="success_probability", ylabel="share of successes", xlim=(-0.03, 1.03))
        axis.set(ylim=(-0.03, 1.12), title="Solved problems, in equal parts")
        axis.title.set_fontsize("medium")
        if np.isnan(probability).any():
            return
        order, succeeded = np.argsort(probability, kind="stable"), self.succeeded[self.solved]
        parts = [part for part in np.array_split(order, _N_BINS) if len(part)]
        if len(np.unique(probability)) == 1:
            parts = [order]
        for part in parts:
            share = Share.of(int(succeeded[part].sum()), len(part))
            draw_share(axis, float(probability[part].mean()), share)


def _centre(values: NDArray[Any]) -> dict[str, float | None]:
    if not len(values):
        return {"median": None, "mean": None}
    return {"median": float(np.median(values)), "mean": float(np.mean(values))}


def _json_number(value: float) -> float | None:
    return None if np.isnan(value) else value
