"""One round of learning: plans, the rows to learn from, the estimator, and what it is worth."""

from __future__ import annotations

import copy
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.advice import mostly_diverged
from reliability.collect import ON_ERROR, execute_plans, joined
from reliability.fitting import FitTask, LabelledPlans, balanced_accuracy, correct, unpickled
from reliability.identity import describe, describe_planner
from reliability.item_files import Item
from reliability.plan_execution import LABELS, Planner
from reliability.round_report import (
    PlanCounts,
    RoundReport,
    is_better,
    more_succeed,
    succeeded_plans,
)
from reliability.scenes import SceneArgument, SceneFamily
from reliability.store import Job, ResumableStore, run_jobs
from reliability.summary import Summary
from reliability.transitions import Transitions, named_features
from systems.validation import RandomState, as_seed, check_choice, check_count, check_number

_KIND = "estimators fitted in rounds, one in each file"


@dataclass(frozen=True, eq=False)
class Round:
    """A finished round.

    Attributes
    ----------
    transitions : Transitions
        Of the round's plans.
    rows : LabelledPlans
        Those of them to learn from.
    estimator : classifier
        Fitted on the rows of this round and of those before.
    succeeded : ndarray of bool of shape (n_validation,)
        At which validation problems plans with this estimator succeed.
    report : RoundReport
    """

    transitions: Transitions
    rows: LabelledPlans
    estimator: Any
    succeeded: NDArray[np.bool_]
    report: RoundReport


@dataclass(frozen=True)
class Folder:
    """Where rounds are kept, their seed, and how they are worked on.

    Attributes
    ----------
    seed : int
    store : ResumableStore or None
        Of the estimators. Plans are kept in folders of their own in it.
    n_jobs : int or None
    verbose : int
    """

    seed: int
    store: ResumableStore | None
    n_jobs: int | None
    verbose: int

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str] | None,
        recipe: Recipe,
        random_state: RandomState,
        n_jobs: int | None,
        verbose: int,
    ) -> Folder:
        """Open the folder, if there is to be one; a seed that was left open is the folder's."""
        seed = as_seed(random_state)
        if path is None:
            return cls(seed, None, n_jobs, verbose)
        adopt = ("random_state",) if random_state is None else ()
        store = ResumableStore(path, _KIND, {**recipe.describe(), "random_state": seed}, adopt)
        return cls(store.description["random_state"], store, n_jobs, verbose)

    def of_plans(self, name: str) -> Path | None:
        """Return the folder of some plans."""
        return None if self.store is None else self.store.folder / name

    def round_seeds(self, number: int) -> tuple[int, int]:
        """Return the seeds of a round's plans and of its fit."""
        # Collections use keys of one and two numbers.
        for_plans, for_fit = _seeds(self.seed, (number, 0, 0), 2)
        return for_plans, for_fit

    def validation_seed(self) -> int:
        """Return the seed of the problems that all rounds' estimators are compared on."""
        return _seeds(self.seed, (0, 0, 0, 0), 1)[0]


@dataclass(frozen=True)
class Recipe:
    """What is done in each round: the arguments of :func:`reliability.learn_in_rounds` that say so.

    ``n_plans`` has one number or more; the last is that of all later rounds as well.
    """

    estimator: Any
    planner: Planner
    system: SceneArgument
    n_plans: Sequence[int]
    n_validation: int
    labels: str
    exploring_k: float
    n_after: int | None
    on_error: str

    def check(self) -> None:
        """Raise ``ValueError`` that names an unfit argument."""
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
        if not self.n_plans:
            raise ValueError("n_plans must hold at least one number of plans, got none.")
        for number in self.n_plans:
            check_count(number, "n_plans")
        check_count(self.n_validation, "n_validation")
        check_choice(self.labels, "labels", LABELS)
        check_number(self.exploring_k, "exploring_k", 0, np.inf)
        if self.n_after is not None:
            check_count(self.n_after, "n_after")
        check_choice(self.on_error, "on_error", ON_ERROR)

    def describe(self) -> dict[str, Any]:
        """Describe all that the estimators of the rounds depend on."""
        return {
            **SceneFamily(self.system).describe(),
            "planner": describe_planner(self._exploring(None)),
            "estimator": describe(self.estimator),
            "labels": self.labels,
            "n_plans": _without_repeats(self.n_plans),
            "n_after": None if self.n_after is None else int(self.n_after),
        }

    def next_round(self, done: list[Round], folder: Folder) -> Round:
        """Do the round after those that are done."""
        began, name = time.perf_counter(), f"round-{len(done)}"
        for_plans, for_fit = folder.round_seeds(len(done))
        items = self._plans(
            self._exploring(done[-1].estimator if done else None),
            _plans_of_round(self.n_plans, len(done)),
            name,
            for_plans,
            folder,
        )
        transitions = self._transitions(items, done, folder.verbose)
        rows = self._informative(transitions, done[0].transitions if done else transitions)
        X, names = named_features(rows, self.system)
        of_round = LabelledPlans(X, rows.y, rows.plan, names)
        data = _stacked([*(one.rows for one in done), of_round])
        task = FitTask(self.estimator, data, for_fit, folder.n_jobs)
        fit = run_jobs([Job(name, task, folder.store)], n_jobs=1)[0]
        estimator = unpickled(fit)
        succeeded = self._validate(estimator, len(done), folder)
        report = RoundReport(
            round=len(done),
            n_transitions=len(transitions),
            p_acc=float(estimator.validation_accuracy_),
            n_validation=len(succeeded),
            n_validation_succeeded=int(succeeded.sum()),
            **vars(PlanCounts.of(items)),
            **_measured(data, of_round, fit.arrays["right"]),
            **_compared(done, succeeded, of_round, fit.arrays["right"]),
            seconds=time.perf_counter() - began,
        )
        return Round(transitions, of_round, estimator, succeeded, report)

    def _informative(self, transitions: Transitions, of_round_0: Transitions) -> Transitions:
        """Return the transitions to learn from."""
        if self.n_after is not None:
            return transitions.trim_unreliable_runs(self.n_after)
        if mostly_diverged(Summary.of(of_round_0)):
            return transitions.trim_unreliable_runs(1)
        return transitions

    def _exploring(self, estimator: Any) -> Planner:
        planner: Any = copy.copy(self.planner)
        planner.set_params(estimator=estimator, k=float(self.exploring_k))
        return planner

    def _validate(self, estimator: Any, number: int, folder: Folder) -> NDArray[np.bool_]:
        """Say at which of the validation problems plans with an estimator succeed."""
        planner: Any = copy.copy(self.planner)
        planner.set_params(estimator=estimator)
        seed, name = folder.validation_seed(), f"validation-{number}"
        return succeeded_plans(self._plans(planner, self.n_validation, name, seed, folder))

    def _plans(
        self, planner: Planner, n_plans: int, name: str, seed: int, folder: Folder
    ) -> list[Item]:
        return execute_plans(
            self.system,
            planner,
            n_plans,
            labels=self.labels,
            on_error=self.on_error,
            n_jobs=folder.n_jobs,
            random_state=seed,
            path=folder.of_plans(name),
            verbose=folder.verbose,
        )

    def _transitions(self, items: list[Item], done: list[Round], verbose: int) -> Transitions:
        """Return a round's transitions; none if an estimator lets the planner find no plan."""
        n_rows = sum(item.facts.get("n_transitions", 0) for item in items)
        if done and not n_rows:
            return done[0].transitions[:0]
        transitions = joined(items, verbose)
        n_before = sum(_plans_of_round(self.n_plans, number) for number in range(len(done)))
        transitions.plan = transitions.plan + n_before
        return transitions


def _seeds(seed: int, key: tuple[int, ...], n: int) -> list[int]:
    drawn = np.random.SeedSequence(seed, spawn_key=key).generate_state(n, np.uint64)
    return [int(one >> np.uint64(1)) for one in drawn]


def _plans_of_round(n_plans: Sequence[int], number: int) -> int:
    return int(n_plans[min(number, len(n_plans) - 1)])


def _without_repeats(n_plans: Sequence[int]) -> list[int] | int:
    """Leave out the last numbers that say the same as the one before."""
    numbers = [int(number) for number in n_plans]
    while numbers[-2:-1] == numbers[-1:]:
        numbers.pop()
    return numbers if len(numbers) > 1 else numbers[0]


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
    done: list[Round],
    succeeded: NDArray[np.bool_],
    of_round: LabelledPlans,
    right: NDArray[np.bool_],
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
        "success_improved": more_succeed(succeeded, done[-1].succeeded),
        "accuracy_improved": is_better(right[n_before:], right_before, y, of_round.plan),
    }


def _stacked(parts: list[LabelledPlans]) -> LabelledPlans:
    return LabelledPlans(
        np.concatenate([part.X for part in parts]),
        np.concatenate([part.y for part in parts]),
        np.concatenate([part.plan for part in parts]),
        parts[0].names,
    )
