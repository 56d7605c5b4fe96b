"""The checker for systems that users write."""

from __future__ import annotations

import numpy as np

from systems.contract_checks.attributes import check_attributes, check_pickles
from systems.contract_checks.execution import check_goals, check_rollout, walk
from systems.contract_checks.model import (
    check_close,
    check_features,
    check_propagate,
    check_reduce,
    check_steer,
    check_steps,
)
from systems.contract_checks.sampling import check_problem, check_samples, draw_configurations
from systems.system import System

N_PROBLEMS = 4
N_ROWS = 16


def check_system(system: System, *, random_state: int = 0) -> None:
    """Check that planners, data collection and estimators can use a system.

    Draws a few problems, and moves from their starts towards random configurations, with the
    reduced model and with the true execution. A system that passes can still be wrong where these
    moves do not lead.

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
    check_attributes(system)
    check_pickles(system)
    check_samples(system, random_state, N_ROWS)
    problems = [check_problem(system, random_state + i) for i in range(N_PROBLEMS)]
    starts = np.array([check_reduce(system, problem.start) for problem in problems])
    rng = np.random.default_rng(random_state)
    reduced = starts[rng.integers(len(starts), size=N_ROWS)]
    targets = draw_configurations(system, rng, N_ROWS)
    command = check_steer(system, reduced, targets)
    next_reduced, valid = check_propagate(system, reduced, command)
    predicted = reduced[valid], next_reduced[valid]
    check_steps(system, *predicted)
    check_close(system, *predicted)
    check_features(system, *predicted)
    for problem in problems:
        commands = walk(system, problem, rng)
        executed = check_rollout(system, problem.start, commands)
        check_goals(system, problem, executed)
