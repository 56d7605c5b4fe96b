"""One plan of a collection: made, executed and labelled, or why it gave no transitions."""

from __future__ import annotations

import contextlib
import copy
import pickle
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from reliability.exploration import exploring
from reliability.item_files import Item
from reliability.labels import label_executed_transitions, label_transitions
from reliability.scenes import SceneFamily, plan_seeds
from reliability.transitions import Transitions, join
from systems.errors import SimulationDivergedError
from systems.system import Array, Problem, System

LABELS = ("plan", "executed", "both")
EXECUTED, UNSOLVED, DIVERGED, FAILED = "executed", "unsolved", "diverged", "failed"
_LONGEST_PROBLEM = 500


class Planner(Protocol):
    """What collection asks of a planner: those of :mod:`planners` have it."""

    system: Any
    random_state: Any

    def plan(self, start_reduced: NDArray[np.float64], goal: Any) -> Any:
        """Return a result with ``success``, ``reduced`` and ``commands``."""


class PlanFailedError(RuntimeError):
    """Planning, executing or labelling one of many plans raised an exception.

    Parameters
    ----------
    facts : dict
        ``plan``, the plan's number; ``scene``; ``random_state``, the planner's; ``problem`` and
        ``error``, in words. Kept in the attribute of the same name.
    cause : Exception
        The exception itself, which becomes ``__cause__``.
    """

    def __init__(self, facts: dict[str, Any], cause: Exception) -> None:
        super().__init__(facts, cause)
        self.facts = facts
        # An exception that comes from another process has lost its cause.
        self.__cause__ = cause

    @classmethod
    def of(
        cls, error: Exception, plan: int, scene: int, random_state: int, problem: Any
    ) -> PlanFailedError:
        """Make one of an exception, such that it can go to another process.

        Parameters
        ----------
        error : Exception
        plan, scene, random_state : int
        problem : Problem or None
            None if it had not been drawn.
        """
        words = "not drawn yet" if problem is None else repr(problem)
        if len(words) > _LONGEST_PROBLEM:
            words = f"{words[:_LONGEST_PROBLEM]}…"
        facts = {
            "plan": plan,
            "scene": scene,
            "random_state": random_state,
            "problem": words,
            "error": repr(error),
        }
        return cls(facts, _portable(error))

    def __str__(self) -> str:
        return tell_failure(self.facts)


@contextlib.contextmanager
def causes_restored() -> Iterator[None]:
    """Raise a ``PlanFailedError`` of another process as one of this process, with its cause."""
    try:
        yield
    except PlanFailedError as error:
        if error.__cause__ is not error.args[1]:  # the worker's traceback, as text
            error.add_note(str(error.__cause__))
        raise error from error.args[1]


def tell_failure(facts: dict[str, Any]) -> str:
    """Return a sentence about a plan that failed."""
    return (
        f"Plan {facts['plan']} (scene {facts['scene']}, random_state of the planner "
        f"{facts['random_state']}) failed with {facts['error']}. Its problem: {facts['problem']}"
    )


@dataclass(frozen=True)
class PlanTask:
    """Makes, executes and labels one plan of a collection.

    All that is random follows from the collection's seed and the plan's number.

    Attributes
    ----------
    source : System or callable
        The plan's system, or what makes it of ``scene``.
    scene : int
    planner : Planner
        A template, whose ``system`` and ``random_state`` are set.
    labels : {"plan", "executed", "both"}
    on_error : {"raise", "skip"}
    seed : int
    plan : int
    """

    source: System | Callable[[int], System]
    scene: int
    planner: Planner
    labels: str
    on_error: str
    seed: int
    plan: int

    def __call__(self) -> Item:
        """Return the transitions, or what became of the plan instead.

        Of an executed plan, the fact "succeeded" says whether the execution came to its end, and
        ended close to where the plan does.

        Raises
        ------
        PlanFailedError
            If the plan failed and ``on_error`` is "raise".
        """
        problem_seed, planner_seed, _ = plan_seeds(self.seed, self.plan)
        random_state = int(planner_seed.generate_state(1)[0])
        problem = None
        try:
            system = SceneFamily(self.source).system(self.scene)
            problem = system.sample_problem(problem_seed)
            return self._item(system, problem, random_state)
        except SimulationDivergedError:
            return Item({"outcome": DIVERGED})
        except Exception as error:
            failure = PlanFailedError.of(error, self.plan, self.scene, random_state, problem)
            if self.on_error == "raise":
                raise failure from error
            return Item({"outcome": FAILED, "failure": failure.facts})

    def _item(self, system: System, problem: Problem, random_state: int) -> Item:
        planner = copy.copy(self.planner)
        planner.system, planner.random_state = system, random_state
        with exploring():
            plan = planner.plan(system.reduce(problem.start), problem.goal)
        if not plan.success:
            return Item({"outcome": UNSOLVED})
        rollout = system.rollout(problem.start, plan.commands)
        executed = np.array([system.reduce(state) for state in rollout.states])
        parts = []
        if self.labels != "executed":
            parts.append(self._of_plan(system, plan, executed))
        if self.labels != "plan":
            parts.append(self._of_execution(system, plan, executed))
        transitions = join(parts)
        facts = {
            "outcome": EXECUTED,
            "n_transitions": len(transitions),
            "succeeded": rollout.n_completed == len(plan.commands)
            and bool(system.close(plan.reduced[-1:], executed[-1:])[0]),
        }
        return Item(facts, transitions.to_arrays())

    def _of_plan(self, system: System, plan: Any, executed: Array) -> Transitions:
        """Label the plan's own transitions; those that the execution never came to are left out."""
        n = len(executed) - 1
        y = label_transitions(plan.reduced, executed, system.close)[:n]
        return self._rows(
            plan.reduced[:n], plan.commands[:n], plan.reduced[1 : n + 1], y, np.arange(n), False
        )

    def _of_execution(self, system: System, plan: Any, executed: Array) -> Transitions:
        """Label what g predicts from the executed states."""
        found = label_executed_transitions(executed, plan.commands, system.propagate, system.close)
        commands = plan.commands[found.step]
        return self._rows(found.reduced, commands, found.next_reduced, found.y, found.step, True)

    def _rows(
        self,
        reduced: Array,
        command: Array,
        next_reduced: Array,
        y: NDArray[np.int64],
        step: NDArray[np.int64],
        from_execution: bool,
    ) -> Transitions:
        plan, scene = np.full(len(y), self.plan), np.full(len(y), self.scene)
        executed = np.full(len(y), from_execution)
        return Transitions(reduced, command, next_reduced, y, plan, step, scene, executed)


def _portable(error: Exception) -> Exception:
    """Return an exception that can go to another process, as like this one as possible."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(repr(error))
    return error
