"""The checker for systems that users write."""

from __future__ import annotations

import numpy as np

from systems.contract_checks.attributes import check_attributes
from systems.contract_checks.copies import check_copies, check_pickles
from systems.contract_checks.execution import check_goals, check_rollout, walk
from systems.contract_checks.model import (
    check_close,
    check_features,
    check_propagate,
    check_reduce,
    check_steer,
    check_steps,
)
from systems.contract_checks.sampling import (
    check_ends,
    check_problem,
    check_samples,
    draw_configurations,
    goals_of,
)
from systems.contract_checks.variation import (
    check_close_varies,
    check_commands_matter,
    check_goal_reached_varies,
    draw_moves,
    wander,
)
from systems.system import Array, System
from systems.validation import is_integer

N_PROBLEMS = 4
N_ROWS = 16


def check_system(system: System, *, random_state: int = 0) -> None:
    """Check that planners, data collection and estimators can use a system.

    Draws a few problems, and moves from their starts towards random configurations, with the
    reduced model and with the true execution, here and once in another process. A system that
    passes can still be wrong where these moves do not lead.

    Parameters
    ----------
    system : System
    random_state : int, default=0

    Raises
    ------
    SystemContractError
        For the first fault that is found; the message names the method, what it returned and what
        is expected.
    """
    if not is_integer(random_state) or random_state < 0:
        raise ValueError(f"random_state must be an integer of at least 0, got {random_state!r}.")
    check_attributes(system)
    check_pickles(system)
    check_samples(system, random_state, N_ROWS)
    seeds = range(random_state, random_state + N_PROBLEMS)
    problems = [check_problem(system, seed) for seed in seeds]
    starts = np.array([check_reduce(system, problem.start) for problem in problems])
    rng = np.random.default_rng(random_state)
    _check_model(system, starts, rng)
    for problem, start, seed in zip(problems, starts, seeds, strict=True):
        check_ends(system, problem, start, seed)
    goals = [goals_of(system, problem, seed) for problem, seed in zip(problems, seeds, strict=True)]
    for problem, goal in zip(problems, goals, strict=True):
        commands = walk(system, problem, rng)
        executed = check_rollout(system, problem.start, commands)
        check_goals(system, problem, goal, executed)
    states = wander(system, starts, rng)
    check_close_varies(system, states)
    check_goal_reached_varies(system, goals, states)
    check_commands_matter(system, problems, rng)
    check_copies(system, problem, commands, random_state)


def _check_model(system: System, starts: Array, rng: np.random.Generator) -> None:
    """Check r, g, steering, Close and features from the starts of problems."""
    reduced = starts[rng.integers(len(starts), size=N_ROWS)]
    targets = draw_configurations(system, rng, N_ROWS)
    command = check_steer(system, reduced, targets)
    check_propagate(system, reduced, command)
    reduced, targets = draw_moves(system, starts, rng, N_ROWS)
    command = check_steer(system, reduced, targets)
    next_reduced, valid = check_propagate(system, reduced, command)
    predicted = reduced[valid], next_reduced[valid]
    check_steps(system, *predicted)
    check_close(system, *predicted)
    check_features(system, *predicted)
