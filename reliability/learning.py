"""Learning in rounds: collect, fit, collect with what was learned, fit again."""

from __future__ import annotations

import copy
import os
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.collect import check_choice, execute_plans, joined
from reliability.fitting import FitTask, LabelledPlans, balanced_accuracy, correct, unpickled
from reliability.identity import describe, describe_planner
from reliability.item_files import Item
from reliability.plan_execution import LABELS, Planner
from reliability.round_report import PlanCounts, RoundReport, is_better
from reliability.scenes import SceneArgument, SceneFamily
from reliability.store import Job, ResumableStore, run_jobs
from reliability.transitions import Transitions, join
from systems.validation import RandomState, as_seed, check_count, check_number

_KIND = "estimators fitted in rounds, one in each file"


@dataclass(frozen=True, eq=False)
class LearningResult:
    """What rounds of learning gave.

    Attributes
    ----------
    estimator : classifier
        Fitted on all rounds, with ``validation_accuracy_``.
    transitions : Transitions
        Of all rounds, one after another. Plan ids count on from round to round.
    round : ndarray of int of shape (n,)
        The round that each transition is of.
    rounds : list of RoundReport
    stopped_early : bool
        Whether there were fewer rounds than asked for, because the last one brought nothing.
    """

    estimator: Any
    transitions: Transitions
    round: NDArray[np.int64]
    rounds: list[RoundReport]
    stopped_early: bool

    def __str__(self) -> str:
        """Return the reports of all rounds."""
        return "\n".join([*map(str, self.rounds), *[_WHY_STOPPED] * self.stopped_early])


_WHY_STOPPED = (
    "Stopped early: the last round brought nothing. Neither did more of its plans succeed than of "
    "the round before, nor did it make the estimator better on plans that it had not seen, beyond "
    "chance. More n_plans in each round tell smaller differences from chance."
)


@dataclass(frozen=True, eq=False)
class _Round:
    """A finished round: its transitions, the rows to learn from, and the estimator after it."""

    counts: PlanCounts
    transitions: Transitions
    rows: LabelledPlans
    estimator: Any
    report: RoundReport


def learn_in_rounds(
    estimator: Any,
    planner: Planner,
    system: SceneArgument,
    *,
    n_rounds: int,
    n_plans: int,
    labels: str = "executed",
    exploring_k: float = 6.0,
    n_after: int = 1,
    path: str | os.PathLike[str] | None = None,
    n_jobs: int | None = None,
    random_state: RandomState = None,
    verbose: int = 0,
) -> LearningResult:
    """Collect transitions and fit an estimator, again and again.

    Round 0 makes plans without an estimator. Each later round makes them with the estimator that
    the rounds before gave, so that data come from where such plans lead, and is then learned
    from as well. It stops early after a round that brought nothing: neither did more of its plans
    succeed than of the round before, nor did they make the estimator better on plans that it had
    not seen, beyond chance (see :class:`RoundReport`).

    Parameters
    ----------
    estimator : classifier
        A template with ``fit``, ``predict`` and ``get_params``: a
        :class:`TransitionReliabilityClassifier` without a checkpoint, a classifier of
        scikit-learn, or a Pipeline that ends in one. Where its ``fit`` takes ``groups``, it is
        given the plans. Each ``random_state`` in it that is None follows from ``random_state``.
    planner : BiasedRRT, BiasedRRTConnect or alike
        A template with the parameters ``estimator`` and ``k``, which are set for each round. Its
        ``accuracy``, if None, is the estimator's ``validation_accuracy_``; an estimator that has
        none is given the accuracy of copies on plans that they were not fitted on (5-fold
        cross-validation over whole plans).
    system : System, sequence of Systems, or callable ``random_state -> System``
        Where plans are made, as in :func:`collect_transitions`. A callable makes other scenes in
        each round.
    n_rounds : int
    n_plans : int
        In each round.
    labels : {"executed", "plan", "both"}, default="executed"
        As in :func:`collect_transitions`. "executed" labels each command by what g predicts from
        where the true system was, so that a plan that goes wrong early gives labels to its end.
        "plan" gives the labels of the paper.
    exploring_k : float, default=6.0
        ``k`` of the planner from round 1 on. Not infinite, so that plans also go where the
        estimator is wrong, and the next round finds out.
    n_after : int, default=1
        How many of the Unreliable transitions that end a plan to learn from, where labels are of
        "plan": see :meth:`Transitions.trim_unreliable_tail`.
    path : path-like, default=None
        Folder in which each plan, and each round's estimator, is kept as soon as it is made. Call
        again with the same arguments to go on after an interruption, or with more ``n_rounds``.
        Estimators are kept as pickles: reading them runs code that the files name.
    n_jobs : int, default=None
        Processes that make plans and fit copies; the result does not depend on it.
    random_state : int, Generator, RandomState, SeedSequence or None
        Problems, scenes and seeds differ between rounds, and from those that
        :func:`collect_transitions` draws from the same ``random_state``.
    verbose : int, default=0
        1 shows progress, and prints a report after each round.

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
        If planning or executing raised an exception.
    """
    check_count(n_rounds, "n_rounds")
    recipe = _Recipe(estimator, planner, system, n_plans, labels, exploring_k, n_after)
    recipe.check()
    seed, store = as_seed(random_state), None
    if path is not None:
        adopt = ("random_state",) if random_state is None else ()
        store = ResumableStore(path, _KIND, {**recipe.describe(), "random_state": seed}, adopt)
        seed = store.description["random_state"]
    rounds: list[_Round] = []
    while len(rounds) < n_rounds and not (rounds and rounds[-1].report.brought_nothing):
        rounds.append(recipe.next_round(rounds, seed, store, n_jobs, verbose))
        if verbose:
            print(rounds[-1].report)
    result = LearningResult(
        estimator=rounds[-1].estimator,
        transitions=join([one.transitions for one in rounds]),
        round=np.repeat(np.arange(len(rounds)), [len(one.transitions) for one in rounds]),
        rounds=[one.report for one in rounds],
        stopped_early=len(rounds) < n_rounds,
    )
    if verbose and result.stopped_early:
        print(_WHY_STOPPED)
    return result


@dataclass(frozen=True)
class _Recipe:
    """What is done in each round: the arguments of :func:`learn_in_rounds` that say so."""

    estimator: Any
    planner: Planner
    system: SceneArgument
    n_plans: int
    labels: str
    exploring_k: float
    n_after: int

    def check(self) -> None:
        for name in ("fit", "predict", "get_params"):
            if isinstance(self.estimator, type) or not hasattr(self.estimator, name):
                raise ValueError(
                    f"estimator must be a classifier with the method {name}, got "
                    f"{self.estimator!r}."
                )
        parameters = self.planner.get_params() if hasattr(self.planner, "get_params") else {}
        if not {"estimator", "k"} <= set(parameters):
            raise ValueError(
                "planner must have the parameters estimator and k, as BiasedRRT has, for "
                f"set_params to set in each round; got {self.planner!r}."
            )
        check_count(self.n_plans, "n_plans")
        check_choice(self.labels, "labels", LABELS)
        check_number(self.exploring_k, "exploring_k", 0, np.inf)
        check_count(self.n_after, "n_after")

    def describe(self) -> dict[str, Any]:
        return {
            **SceneFamily(self.system).describe(),
            "planner": describe_planner(self._planner_with(None)),
            "estimator": describe(self.estimator),
            "labels": self.labels,
            "n_plans": int(self.n_plans),
            "n_after": int(self.n_after),
        }

    def next_round(
        self,
        done: list[_Round],
        seed: int,
        store: ResumableStore | None,
        n_jobs: int | None,
        verbose: int,
    ) -> _Round:
        began, name = time.perf_counter(), f"round-{len(done)}"
        for_plans, for_fit = _round_seeds(seed, len(done))
        items = execute_plans(
            self.system,
            self._planner_with(done[-1].estimator if done else None),
            self.n_plans,
            labels=self.labels,
            n_jobs=n_jobs,
            random_state=for_plans,
            path=None if store is None else store.folder / name,
            verbose=verbose,
        )
        transitions = _transitions(items, done, verbose)
        rows = transitions.trim_unreliable_tail(self.n_after)
        of_round = LabelledPlans(rows.features(self.system), rows.y, rows.plan)
        data = _stacked([*(one.rows for one in done), of_round])
        task = FitTask(self.estimator, data, for_fit, n_jobs)
        fit = run_jobs([Job(name, task, store)], n_jobs=1)[0]
        counts, estimator = PlanCounts.of(items), unpickled(fit)
        report = RoundReport(
            round=len(done),
            n_transitions=len(transitions),
            p_acc=float(estimator.validation_accuracy_),
            **vars(counts),
            **_measured(data, of_round, fit.arrays["right"]),
            **_compared(done, counts, of_round, fit.arrays["right"]),
            seconds=time.perf_counter() - began,
        )
        return _Round(counts, transitions, of_round, estimator, report)

    def _planner_with(self, estimator: Any) -> Planner:
        planner: Any = copy.copy(self.planner)
        planner.set_params(estimator=estimator, k=float(self.exploring_k))
        return planner


def _round_seeds(seed: int, number: int) -> tuple[int, int]:
    """Return the seeds of a round's plans and of its fit."""
    # Collections use keys of one and two numbers.
    drawn = np.random.SeedSequence(seed, spawn_key=(number, 0, 0)).generate_state(2, np.uint64)
    for_plans, for_fit = (int(one >> np.uint64(1)) for one in drawn)
    return for_plans, for_fit


def _transitions(items: list[Item], done: list[_Round], verbose: int) -> Transitions:
    """Return a round's transitions; none if an estimator lets the planner find no plan."""
    n_rows = sum(item.facts.get("n_transitions", 0) for item in items)
    if done and not n_rows:
        return done[0].transitions[:0]
    transitions = joined(items, verbose)
    transitions.plan = transitions.plan + len(done) * len(items)
    return transitions


def _measured(
    data: LabelledPlans, of_round: LabelledPlans, right: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the entries of a round's report that are about the new estimator.

    ``right`` says which rows of ``data``, of which the round's are the last, copies that were not
    fitted on their plans labelled right.
    """
    n_before = len(right) - len(of_round.y)
    reliable = np.mean(of_round.y) if len(of_round.y) else np.nan
    return {
        "n_learned": len(right),
        "base_rate": float(max(reliable, 1 - reliable)),
        "updated_balanced_accuracy": balanced_accuracy(right[n_before:], of_round.y),
        "cross_validated_balanced_accuracy": balanced_accuracy(right, data.y),
    }


def _compared(
    done: list[_Round], counts: PlanCounts, of_round: LabelledPlans, right: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the entries of a round's report that compare it with the round before."""
    if not done:
        return {
            "unseen_balanced_accuracy": float("nan"),
            "success_improved": None,
            "accuracy_improved": None,
        }
    n_before, y = len(right) - len(of_round.y), of_round.y
    right_before = correct(done[-1].estimator, of_round)
    return {
        "unseen_balanced_accuracy": balanced_accuracy(right_before, y),
        "success_improved": counts.more_succeeded_than(done[-1].counts),
        "accuracy_improved": is_better(right[n_before:], right_before, y, of_round.plan),
    }


def _stacked(parts: list[LabelledPlans]) -> LabelledPlans:
    return LabelledPlans(
        np.concatenate([part.X for part in parts]),
        np.concatenate([part.y for part in parts]),
        np.concatenate([part.plan for part in parts]),
    )
