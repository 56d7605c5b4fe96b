"""Learning in rounds: collect, fit, collect with what was learned, fit again."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.learning_round import Folder, Recipe, Round
from reliability.plan_execution import Planner
from reliability.round_report import RoundReport
from reliability.scenes import SceneArgument
from reliability.transitions import Transitions, join
from systems.messages import tell
from systems.validation import RandomState, check_count


@dataclass(frozen=True, eq=False, repr=False)
class LearningResult:
    """What rounds of learning gave.

    Attributes
    ----------
    estimator : classifier
        The one whose plans succeeded at most of the validation problems, fitted on all rounds up
        to ``kept_round``, with ``validation_accuracy_``.
    kept_round : int
        The round at whose end ``estimator`` was fitted: of equally good ones the last, which has
        learned from more.
    transitions : Transitions
        Of all rounds, one after another. Plan ids count on from round to round.
    round : ndarray of int of shape (n,)
        The round that each transition is of.
    rounds : list of RoundReport
    stopped_early : bool
        Whether there were fewer rounds than asked for, because the last one brought nothing.
    """

    estimator: Any
    kept_round: int
    transitions: Transitions
    round: NDArray[np.int64]
    rounds: list[RoundReport]
    stopped_early: bool

    def __str__(self) -> str:
        """Return the reports of all rounds, and which estimator was kept."""
        return "\n".join([*map(str, self.rounds), self.conclusion])

    __repr__ = __str__

    @property
    def conclusion(self) -> str:
        """Why there were no more rounds, and which estimator was kept, in words."""
        counts = ", ".join(str(report.n_validation_succeeded) for report in self.rounds)
        kept = (
            f"Kept: the estimator of round {self.kept_round}. Plans with the estimators of rounds "
            f"0 to {len(self.rounds) - 1} succeeded at {counts} of "
            f"{self.rounds[0].n_validation} validation problems."
        )
        return f"{_WHY_STOPPED}\n{kept}" if self.stopped_early else kept


_WHY_STOPPED = (
    "Stopped early: the last round brought nothing. Neither did plans with its estimator succeed "
    "at more validation problems than with the estimator before, nor did it make the estimator "
    "better on plans that it had not seen, beyond chance. More n_plans and n_validation tell "
    "smaller differences from chance."
)


def learn_in_rounds(
    estimator: Any,
    planner: Planner,
    system: SceneArgument,
    *,
    n_rounds: int,
    n_plans: int | Sequence[int],
    n_validation: int = 100,
    labels: str = "executed",
    exploring_k: float = 6.0,
    n_after: int | None = None,
    on_error: str = "raise",
    path: str | os.PathLike[str] | None = None,
    n_jobs: int | None = None,
    random_state: RandomState = None,
    verbose: int = 0,
) -> LearningResult:
    """Collect transitions and fit an estimator, again and again, and keep the best.

    Round 0 makes plans without an estimator. Each later round makes them with the estimator that
    the rounds before gave, so that data come from where such plans lead, and is then learned
    from as well.

    A round can make an estimator worse. Each round's estimator therefore plans the same
    validation problems, which nothing is learned from. The one whose plans succeed at most of
    them is kept. It stops early after a round that brought nothing: neither did its estimator
    succeed at more validation problems than the one before, nor was it better on plans that it
    had not seen, beyond chance (see :class:`RoundReport`).

    Parameters
    ----------
    estimator : classifier
        A template with ``fit``, ``predict`` and ``get_params``: a
        :class:`TransitionReliabilityClassifier` without a checkpoint, a classifier of
        scikit-learn, or a Pipeline that ends in one. Where its ``fit`` takes ``groups``, it is
        given the plans. Each ``random_state`` in it that is None follows from ``random_state``.
    planner : BiasedRRT, BiasedRRTConnect or alike
        A template with the parameters ``estimator`` and ``k``, as it is to be used with the
        estimator in the end: this is how validation problems are planned. Rounds use it with
        ``exploring_k`` instead of its ``k``. Its ``accuracy``, if None, is the estimator's
        ``validation_accuracy_``; an estimator that has none is given the accuracy of copies on
        plans that they were not fitted on (5-fold cross-validation over whole plans).
    system : System, sequence of Systems, or callable ``random_state -> System``
        Where plans are made, as in :func:`collect_transitions`. A callable makes other scenes in
        each round, and for validation.
    n_rounds : int
    n_plans : int or sequence of int
        In each round. Of a sequence, the last number is that of all later rounds.
    n_validation : int, default=100
        Problems that each round's estimator plans at its end. With 100, two estimators that
        succeed equally often in the long run differ by up to 10 or so by chance.
    labels : {"executed", "plan", "both"}, default="executed"
        As in :func:`collect_transitions`. "executed" labels each command by what g predicts from
        where the true system was, so that a plan that goes wrong early gives labels to its end.
        "plan" gives the labels of the paper. Where a system stays down once it has fallen, as the
        arm does, "plan" or "both" are better: see ``docs/labels.md``.
    exploring_k : float, default=6.0
        ``k`` of the planner from round 1 on. Not infinite, so that plans also go where the
        estimator is wrong, and the next round finds out. Little hangs on it: 1, 3, 6, 10 and
        infinity gave 150, 139, 142, 148 and 141 successes of 200 on both of
        ``examples/own_systems`` together, which is chance.
    n_after : int, default=None
        How many of a plan's Unreliable transitions in a row to learn from, where labels are of
        "plan": see :meth:`Transitions.trim_unreliable_runs`. None learns from the first alone if,
        in round 0, more than two thirds of the labels only say that the plan had diverged before,
        and from all otherwise. ``docs/labels.md`` has what that is worth.
    on_error : {"raise", "skip"}, default="raise"
        As in :func:`collect_transitions`. A plan that is left out has not succeeded.
    path : path-like, default=None
        Folder in which each plan, and each round's estimator, is kept as soon as it is made. Call
        again with the same arguments to go on after an interruption, or with more ``n_rounds``
        or ``n_validation``.
        Estimators are kept as pickles: reading them runs code that the files name.
    n_jobs : int, default=None
        Processes that make plans and fit copies; the result does not depend on it.
    random_state : int, Generator, RandomState, SeedSequence or None
        Problems, scenes and seeds differ between rounds, from those of validation, and from those
        that :func:`collect_transitions` draws from the same ``random_state``.
    verbose : int, default=0
        1 shows progress, and tells a report after each round.

    Returns
    -------
    LearningResult

    Raises
    ------
    ValueError
        If an argument is unfit, or if no plan of round 0 gave a transition, or all have the same
        label.
    StoreError
        A ValueError. If ``path`` holds rounds that were made with other arguments, or files that
        are damaged.
    PlanFailedError
        If planning or executing raised an exception and ``on_error`` is "raise".
    """
    check_count(n_rounds, "n_rounds")
    numbers = tuple(n_plans) if isinstance(n_plans, Sequence | np.ndarray) else (n_plans,)
    recipe = Recipe(
        estimator,
        planner,
        system,
        numbers,
        n_validation,
        labels,
        exploring_k,
        n_after,
        on_error,
    )
    recipe.check()
    folder = Folder.open(path, recipe, random_state, n_jobs, verbose)
    rounds: list[Round] = []
    while len(rounds) < n_rounds and not (rounds and rounds[-1].report.brought_nothing):
        rounds.append(recipe.next_round(rounds, folder))
        if verbose:
            tell(str(rounds[-1].report))
    result = _result(rounds, n_rounds)
    if verbose:
        tell(result.conclusion)
    return result


def _result(rounds: list[Round], n_rounds: int) -> LearningResult:
    kept = max(range(len(rounds)), key=lambda i: (rounds[i].succeeded.sum(), i))
    return LearningResult(
        estimator=rounds[kept].estimator,
        kept_round=kept,
        transitions=join([one.transitions for one in rounds]),
        round=np.repeat(np.arange(len(rounds)), [len(one.transitions) for one in rounds]),
        rounds=[one.report for one in rounds],
        stopped_early=len(rounds) < n_rounds,
    )
