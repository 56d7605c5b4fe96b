"""Carrying out a plan, and planning again where the system leaves it."""

from __future__ import annotations

import copy
import time
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.distrust import DistrustedTransitions
from planners.execution import Execution, ExecutionStatus
from planners.goals import has_succeeded
from planners.planning_problem import can_start
from planners.remaining_plan import still_arrives
from reliability.scenes import SceneFamily
from systems.errors import SimulationDivergedError
from systems.goal_region import GoalRegion
from systems.system import Array, Problem, System
from systems.validation import as_array, as_seed, check_number, is_integer


def execute(
    system: System, planner: Any, problem: Problem, *, tolerance: float, max_replans: int = 0
) -> Execution:
    """Plan, carry the plan out, and plan again where it fails.

    As long as replans are left, the plan is carried out command by command, and a new one is made
    from the true state

    - where the system stopped at the boundary of a constraint;
    - where the plan ended and the goal was missed;
    - where a reduced state is not Close to the planned one, if g predicts that the rest of the
      plan does not arrive from there: a transition is not valid, or the last one ends farther than
      ``tolerance`` from the plan's end.

    Leaving a plan is not failing: where commands are places to go to, the next one leads back to
    it. A plan is therefore followed as long as g does not say that it fails.

    If no new plan is found, or none may start where the system is, the old one is carried out,
    and planning is tried again where it ends or the system stops. Once all replans are used up,
    the last plan is carried out to its end.

    A transition after which the system was not Close to the plan is not used again near that
    place in this execution: for new plans and the rest of the old one, g has no successor where a
    transition begins Close to it with about the same motion.

    Parameters
    ----------
    system : System
    planner : BiasedRRT, BiasedRRTConnect or alike
        A template: copies are given the system and a seed, the first one that of
        ``planner.random_state``. Its own system must be this one or None.
    problem : Problem
    tolerance : float
        How near to the goal the true state has to come, as :meth:`systems.System.succeeded`
        takes it.
    max_replans : int, default=0
        Plans to make after the first, those that were not found among them. 0 carries one plan
        out to its end, whatever happens.

    Returns
    -------
    Execution

    Raises
    ------
    ValueError
        If an argument is unfit, or the planner refuses the problem.

    Notes
    -----
    ``docs/execution.md`` says what this is worth on four systems, and where it does not help.

    References
    ----------
    Vemula et al. 2020 (CMAX), for distrusting transitions that failed.

    Examples
    --------
    >>> from planners import BiasedRRTConnect, execute
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> planner = BiasedRRTConnect(arm, random_state=0)
    >>> execute(arm, planner, arm.sample_problem(7), tolerance=0.1, max_replans=5)
    Execution(REACHED, 42 commands, 0 replans)
    """
    check_number(tolerance, "tolerance", 0, np.inf)
    check_max_replans(max_replans)
    if not isinstance(system, System):
        raise ValueError(f"system must be a System, got {system!r}.")
    SceneFamily(system).check_planner(planner)
    problem = _checked_problem(problem, system)
    run = _Run(system, planner, problem, float(tolerance))
    try:
        status = run.to_the_end(int(max_replans))
    except SimulationDivergedError:
        status = ExecutionStatus.SIMULATION_DIVERGED
    return run.ended(status)


def check_max_replans(value: Any) -> None:
    """Raise ``ValueError`` unless a value is a number of replans."""
    if not is_integer(value) or value < 0:
        raise ValueError(f"max_replans must be an integer of at least 0, got {value!r}.")


def _checked_problem(problem: Any, system: System) -> Problem:
    if not isinstance(problem, Problem):
        raise ValueError(f"problem must be a Problem, got {problem!r}.")
    if isinstance(problem.goal, GoalRegion):
        return problem
    goals = as_array(problem.goal, "problem.goal", (None, system.configuration_dim))
    return Problem(problem.start, goals)


@dataclass(eq=False)
class _Run:
    """An execution under way."""

    system: System
    planner: Any
    problem: Problem
    tolerance: float
    states: list[Any] = field(init=False)
    commands: list[Array] = field(default_factory=list)
    plans: list[Any] = field(default_factory=list)
    plan_starts: list[int] = field(default_factory=list)
    planning_time: float = 0.0
    stop_reason: Enum | None = None

    def __post_init__(self) -> None:
        self.states = [self.problem.start]
        self._distrusted = DistrustedTransitions(self.system)
        self._seed = as_seed(getattr(self.planner, "random_state", None))
        self._remaining: NDArray[Any] = np.empty((0, 0))
        self._followed: Array = self._reduced()[None]

    def to_the_end(self, max_replans: int) -> ExecutionStatus:
        self._plan()
        if not self.plans[0].success:
            return ExecutionStatus.NO_PLAN
        hindrance = None
        while len(self.plans) <= max_replans:
            self._follow(give_up=hindrance is None)
            if self._arrived():
                return ExecutionStatus.REACHED
            over = len(self._remaining) == 0
            hindrance = self._replan()
            if over and hindrance is not None:
                return hindrance
        return self._finish(hindrance)

    def ended(self, status: ExecutionStatus) -> Execution:
        commands = np.array(self.commands) if self.commands else self.plans[0].commands[:0]
        return Execution(
            status,
            self.stop_reason,
            self.states,
            commands,
            self.plans,
            self.plan_starts,
            self.planning_time,
        )

    def _plan(self) -> bool:
        """Plan from where the system is; return whether there is a plan to carry out."""
        planner = copy.copy(self.planner)
        planner.system = self._distrusted.left_out_of(self.system)
        planner.random_state = self._seed_of_plan(len(self.plans))
        began = time.perf_counter()
        plan = planner.plan(self._reduced(), self.problem.goal)
        self.planning_time += time.perf_counter() - began
        self.plans.append(plan)
        self.plan_starts.append(len(self.states) - 1)
        if plan.success and len(plan.commands):
            self._remaining, self._followed = plan.commands, plan.reduced
        return bool(plan.success)

    def _replan(self) -> ExecutionStatus | None:
        """Plan anew; return None, or why the old plan is still the one to follow."""
        if not can_start(self.system, self._reduced()):
            return ExecutionStatus.START_NOT_ALLOWED
        if not self._plan():
            return ExecutionStatus.NO_PLAN
        return None if len(self.plans[-1].commands) else ExecutionStatus.MISSED

    def _follow(self, give_up: bool) -> None:
        """Carry the plan out until it ends or the system stops, or is given up if it may be."""
        while len(self._remaining):
            number = len(self._followed) - 1 - len(self._remaining)
            planned, following = self._followed[number : number + 2]
            before, command = self._reduced(), self._remaining[:1]
            completed = self._give(command)
            if completed and self.system.close(following[None], self._reduced()[None])[0]:
                continue
            self._distrust(before, command, (planned, following))
            if give_up and self._can_do_better():
                return

    def _can_do_better(self) -> bool:
        """Say whether g predicts that the rest of the plan fails, where a new one may start."""
        system, here, end = self.system, self._reduced(), self._followed[-1]
        if not can_start(system, here):
            return False
        trusted = self._distrusted.left_out_of(system)
        return not still_arrives(trusted, here, self._remaining, end, self.tolerance)

    def _finish(self, hindrance: ExecutionStatus | None) -> ExecutionStatus:
        """Carry out what remains of the plan; return how it ended, or what kept from replanning."""
        stopped = len(self._remaining) and not self._give(self._remaining)
        if self._arrived():
            return ExecutionStatus.REACHED
        if hindrance is not None:
            return hindrance
        if stopped:
            return ExecutionStatus.CONSTRAINT
        missed = self.system.close(self._followed[-1:], self._reduced()[None])[0]
        return ExecutionStatus.MISSED if missed else ExecutionStatus.LEFT_PLAN

    def _give(self, commands: Array) -> bool:
        """Have commands carried out; return whether all were, and forget the rest otherwise."""
        rollout = self.system.rollout(self.states[-1], commands)
        states = list(rollout.states)[1:]
        self.states.extend(states)
        self.commands.extend(commands[: len(states)])
        self.stop_reason = rollout.stop_reason
        completed = bool(rollout.n_completed == len(commands))
        self._remaining = self._remaining[len(commands) if completed else len(self._remaining) :]
        return completed

    def _distrust(self, before: Array, command: Array, planned: tuple[Array, Array]) -> None:
        """Remember what g predicts from where the system was, or else what was planned."""
        following, valid = self.system.propagate(before[None], command)
        self._distrusted.add(*((before, following[0]) if valid[0] else planned))

    def _arrived(self) -> bool:
        return has_succeeded(self.system, self.problem, self.states[-1], self.tolerance)

    def _reduced(self) -> Array:
        return self.system.reduce(self.states[-1])

    def _seed_of_plan(self, number: int) -> int:
        if number == 0:
            return self._seed
        seeds = np.random.SeedSequence(self._seed, spawn_key=(number,))
        return int(seeds.generate_state(1)[0])
