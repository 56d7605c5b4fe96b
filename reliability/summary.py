"""What a collection holds, in a few numbers and two plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.advice import label_warnings
from reliability.axes import drawing_axes
from reliability.labels import UNRELIABLE
from reliability.transitions import Transitions


@dataclass(frozen=True, eq=False)
class Summary:
    """The balance and the size of labelled transitions.

    Attributes
    ----------
    n_transitions : int
    n_plans : int
        Plans that gave a transition.
    n_plans_of_rarer_label : int
        Plans that gave the less frequent one of the two labels.
    unreliable_share : float
        Of all transitions.
    divergence_onset_share : float
        Share of the Unreliable transitions at which an execution diverges from its plan; the
        others come after. NaN without any Unreliable one.
    executed_share : float
        Share of the transitions that are labelled from executed states.
    reliable_plan_share : float
        Share of the plans whose transitions are all Reliable.
    transitions_per_plan : ndarray of int of shape (n_plans,)
    reliable_before_divergence : ndarray of int
        Number of transitions before the first Unreliable one, of each plan that has one.
    """

    n_transitions: int
    n_plans: int
    n_plans_of_rarer_label: int
    unreliable_share: float
    divergence_onset_share: float
    executed_share: float
    reliable_plan_share: float
    transitions_per_plan: NDArray[np.int64]
    reliable_before_divergence: NDArray[np.int64]

    @classmethod
    def of(cls, transitions: Transitions) -> Summary:
        """Summarize transitions.

        Parameters
        ----------
        transitions : Transitions
            At least one.
        """
        if not isinstance(transitions, Transitions) or not len(transitions):
            raise ValueError(f"transitions must be Transitions, at least one, got {transitions!r}.")
        unreliable = transitions.y == UNRELIABLE
        plans, number, sizes = np.unique(transitions.plan, return_inverse=True, return_counts=True)
        first = np.full(len(plans), np.iinfo(np.int64).max)
        np.minimum.at(first, number[unreliable], transitions.step[unreliable])
        spoilt = np.isin(np.arange(len(plans)), number[unreliable])
        n_unreliable = int(unreliable.sum())
        rarer = unreliable if 2 * n_unreliable <= len(unreliable) else ~unreliable
        n_first = int(transitions.divergence_onsets().sum())
        return cls(
            n_transitions=len(transitions),
            n_plans=len(plans),
            n_plans_of_rarer_label=len(np.unique(number[rarer])),
            unreliable_share=float(unreliable.mean()),
            divergence_onset_share=n_first / n_unreliable if n_unreliable else float("nan"),
            executed_share=float(transitions.executed.mean()),
            reliable_plan_share=float(1 - spoilt.mean()),
            transitions_per_plan=sizes,
            reliable_before_divergence=first[spoilt],
        )

    @property
    def base_rate(self) -> float:
        """Share of the more frequent label: the accuracy of predicting it for every transition."""
        return max(self.unreliable_share, 1 - self.unreliable_share)

    @property
    def already_diverged_share(self) -> float:
        """Share of the Unreliable transitions that come after their plan's execution diverged."""
        return 1 - self.divergence_onset_share

    @property
    def warnings(self) -> list[str]:
        """What the labels alone show to be wrong, most important first, each with a remedy."""
        return label_warnings(self)

    def __str__(self) -> str:
        """Return the numbers in a few lines."""
        low, middle, high = np.quantile(self.transitions_per_plan, (0.1, 0.5, 0.9))
        of_those = (
            f"; at {self.divergence_onset_share:.1%} of those an execution diverges from its plan, "
            "the others come after"
            if self.unreliable_share
            else ""
        )
        return (
            f"{self.n_transitions:,} transitions of {self.n_plans:,} plans: "
            f"{self.transitions_per_plan.mean():.1f} a plan, {middle:.0f} in the median, "
            f"{low:.0f} to {high:.0f} from the 10th to the 90th percentile.\n"
            f"{self.unreliable_share:.1%} are Unreliable{of_those}.\n"
            f"{self.reliable_plan_share:.1%} of the plans are Reliable from start to end."
        )

    def plot(self, axes: Any = None) -> Any:
        """Draw how long plans are, and how far they go well.

        Parameters
        ----------
        axes : sequence of two matplotlib Axes, default=None
            None makes a figure.

        Returns
        -------
        axes : sequence of two matplotlib Axes
        """
        axes = drawing_axes(axes, "Summary.plot", 2, figsize=(9, 3), sharey=True)
        most = int(self.transitions_per_plan.max())
        bins = np.linspace(0, most, min(most, 40) + 1)
        axes[0].hist(self.transitions_per_plan, bins, color="tab:blue")
        axes[0].set(xlabel="transitions per plan", ylabel="plans")
        axes[1].hist(self.reliable_before_divergence, bins, color="tab:red")
        axes[1].set(xlabel="transitions before the first Unreliable one")
        axes[1].set_title(
            f"{1 - self.reliable_plan_share:.0%} of plans have one; "
            f"{self.unreliable_share:.0%} of transitions are Unreliable",
            fontsize="medium",
        )
        return axes
