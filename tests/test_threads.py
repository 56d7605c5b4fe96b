"""Collections in threads: each thread has a simulator of its own."""

import joblib
import numpy as np
import pytest

from planners import BiasedRRT, BiasedRRTConnect
from reliability import collect_transitions
from systems import Car, PlanarArm, Rope

N_THREADS = 4
SYSTEMS = [
    pytest.param(PlanarArm, BiasedRRTConnect, 12, id="arm"),
    pytest.param(Car, BiasedRRTConnect, 12, id="car"),
    pytest.param(lambda: Rope("engine_assembly"), BiasedRRT, 4, id="rope"),
    pytest.param(
        lambda: Rope("engine_assembly", engine="pybullet"),
        BiasedRRT,
        4,
        id="rope-pybullet",
        marks=pytest.mark.slow,
    ),
]


@pytest.mark.parametrize(("make_system", "planner", "n_plans"), SYSTEMS)
def test_threads_collect_the_data_of_a_series(make_system, planner, n_plans):
    def collect():
        system = make_system()
        return collect_transitions(
            system, planner(system), n_plans, labels="both", random_state=0, n_jobs=N_THREADS
        )

    with joblib.parallel_config("threading"):
        together = collect()
    with joblib.parallel_config("sequential"):
        alone = collect()
    for column in ("reduced", "command", "next_reduced", "y", "plan", "executed"):
        np.testing.assert_array_equal(getattr(together, column), getattr(alone, column))
