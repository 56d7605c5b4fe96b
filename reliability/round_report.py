"""What a round of learning brought, in numbers, and whether it was more than chance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from reliability.item_files import Item
from reliability.plan_execution import DIVERGED, EXECUTED
from reliability.plan_gains import SIGNIFICANCE, gains_of_plans, p_value


@dataclass(frozen=True)
class RoundReport:
    """What became of a round's plans, and how good the estimators before and after it are.

    Rows that are not learned from (see ``n_after`` of :func:`reliability.learn_in_rounds`) are
    left out of all accuracies. Balanced accuracy is the mean of the shares of Reliable and of
    Unreliable transitions that are labelled right; guessing gives 0.5, whatever the labels;
    it is NaN where a label is missing.

    Attributes
    ----------
    round : int
        From 0.
    n_plans, n_solved, n_succeeded : int
        Problems of the round; those that were solved; those whose execution also came to its end,
        Close to where the plan ends. Plans of round 0 are made without an estimator, others with
        that of the round before and ``exploring_k``.
    n_validation, n_validation_succeeded : int
        Problems that are the same for all rounds and that nothing is learned from; those at which
        plans with the new estimator, made by the planner with its own ``k``, succeeded likewise.
    n_transitions : int
        Transitions of the round, all of them.
    n_learned : int
        Rows that the estimator is fitted on at the end of this round, of all rounds so far.
    base_rate : float
        Share of the more frequent label among the round's rows: the accuracy of an estimator
        that always gives the same answer. NaN without rows.
    unseen_balanced_accuracy : float
        Of the estimator that the round's plans were made with, on the round's rows. The planner
        leaves out most of what this estimator calls Unreliable, so that its plans show above all
        where it is wrong: near 0.5 does not make it a bad estimator. NaN in round 0.
    updated_balanced_accuracy : float
        On the same rows, of copies that were fitted on the earlier rounds and on other plans of
        this one. What it is above the one before is what the round taught.
    cross_validated_balanced_accuracy : float
        Of such copies on the rows of all rounds so far.
    p_acc : float
        The new estimator's ``validation_accuracy_``.
    success_improved : bool or None
        Whether plans with the new estimator succeeded at more validation problems than plans with
        the estimator before, beyond chance (sign test at 5 % over the problems at which only one
        of both succeeded). None in round 0.
    accuracy_improved : bool or None
        Whether ``updated_balanced_accuracy`` is above ``unseen_balanced_accuracy``, beyond chance
        (t-test over plans at 5 %). As the plans show above all where the earlier estimator is
        wrong, this rather goes on once too often than stops too early. None in round 0.
    seconds : float
        Spent on the round by this call; next to nothing for a round that was read.
    """

    round: int
    n_plans: int
    n_solved: int
    n_succeeded: int
    n_validation: int
    n_validation_succeeded: int
    n_transitions: int
    n_learned: int
    base_rate: float
    unseen_balanced_accuracy: float
    updated_balanced_accuracy: float
    cross_validated_balanced_accuracy: float
    p_acc: float
    success_improved: bool | None
    accuracy_improved: bool | None
    seconds: float

    @property
    def brought_nothing(self) -> bool:
        """Whether neither successes nor balanced accuracy rose beyond chance; not of round 0."""
        return self.round > 0 and not (self.success_improved or self.accuracy_improved)

    def __str__(self) -> str:
        """Return the numbers in four lines."""
        return (
            f"Round {self.round}: {self.n_solved} of {self.n_plans} problems solved, "
            f"{self.n_succeeded} succeeded; "
            f"{self.n_transitions:,} transitions, {self.n_learned:,} to learn from so far; "
            f"{self.seconds:.0f} s.\n"
            f"  With the new estimator, plans succeeded at {self.n_validation_succeeded} of "
            f"{self.n_validation} validation problems{_told(self.success_improved)}.\n"
            f"  Balanced accuracy on its plans: {self.unseen_balanced_accuracy:.3f} before, "
            f"{self.updated_balanced_accuracy:.3f} with what they taught"
            f"{_told(self.accuracy_improved)}; base rate {self.base_rate:.3f}.\n"
            f"  On all plans so far: balanced accuracy "
            f"{self.cross_validated_balanced_accuracy:.3f}, p_acc {self.p_acc:.3f}."
        )


@dataclass(frozen=True)
class PlanCounts:
    """How many of a round's plans were made, solved, and executed with success."""

    n_plans: int
    n_solved: int
    n_succeeded: int

    @classmethod
    def of(cls, items: Sequence[Item]) -> PlanCounts:
        """Count what became of plans."""
        outcomes = Counter(item.facts["outcome"] for item in items)
        n_solved = outcomes[EXECUTED] + outcomes[DIVERGED]
        return cls(len(items), n_solved, int(succeeded_plans(items).sum()))


def succeeded_plans(items: Sequence[Item]) -> NDArray[np.bool_]:
    """Say which plans were executed with success, shape (n,)."""
    return np.array([bool(item.facts.get("succeeded")) for item in items])


def more_succeed(succeeded: NDArray[np.bool_], before: NDArray[np.bool_]) -> bool:
    """Say whether plans succeed at more of the same problems than before, beyond chance."""
    only_now, only_before = int((succeeded & ~before).sum()), int((before & ~succeeded).sum())
    if not only_now:
        return False
    test = binomtest(only_now, only_now + only_before, alternative="greater")
    return bool(test.pvalue < SIGNIFICANCE)


def is_better(
    right: NDArray[np.bool_],
    right_before: NDArray[np.bool_],
    y: NDArray[np.int64],
    plan: NDArray[np.int64],
) -> bool:
    """Say whether balanced accuracy is higher than before on the same rows, beyond chance.

    Each plan's share of the difference is one observation. Plans that all have the same share, such
    as a single plan, do not show that it is more than chance.

    Parameters
    ----------
    right, right_before : ndarray of bool of shape (n,)
        Which rows are labelled right.
    y, plan : ndarray of int of shape (n,)
    """
    if len(np.unique(y)) < 2:
        return False
    difference = right.astype(float) - right_before
    shares = gains_of_plans(difference / np.bincount(y)[y], plan)
    return bool(np.ptp(shares) > 0 and p_value(shares, "greater") < SIGNIFICANCE)


def _told(improved: bool | None) -> str:
    return {None: "", True: " (more, beyond chance)", False: " (not more, beyond chance)"}[improved]
