"""What can only be seen from outside a process: memory, exit, interruption, imports."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import psutil
import pytest


def run(code, **parameters):
    return subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
        **parameters,
    )


PLAN = """
import numpy as np
from planners import BiasedRRT, BiasedRRTConnect
from systems import PlanarArm

class Picky:
    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9
    def predict(self, X):
        return (X[:, 3] > -0.5).astype(int)

arm = PlanarArm()
start, goal = np.array([-1.5, 0.3, 0.2]), np.array([[1.5, 0.1, 0.0]])
"""


def test_nothing_complains_at_exit():
    process = run(
        PLAN
        + """
for planner in (BiasedRRTConnect, BiasedRRT):
    for estimator in (None, Picky()):
        kept = planner(arm, estimator, k=3, random_state=0)
        result = kept.plan(start, goal)
try:
    BiasedRRT(arm, Picky(), k=np.inf, max_iterations=50).plan(start, -goal)
    raise KeyError
except KeyError:
    print("done")
"""
    )
    assert process.stdout == "done\n"
    assert process.stderr == ""


def test_two_thousand_plans_do_not_grow_memory():
    process = run(
        PLAN
        + """
import gc, psutil
def memory():
    gc.collect()
    return psutil.Process().memory_info().rss / 2**20

def plan(n):
    for seed in range(n):
        planner = (BiasedRRTConnect, BiasedRRT)[seed % 2]
        estimator = (None, Picky())[seed // 2 % 2]
        planner(arm, estimator, random_state=seed, max_iterations=300).plan(start, goal)

plan(300)
before = memory()
plan(2000)
print(memory() - before)
"""
    )
    assert float(process.stdout) < 8, "MiB over 2,000 plans"


def test_a_fresh_process_plans_the_same():
    code = PLAN + "print(BiasedRRTConnect(arm, Picky(), random_state=3).plan(start, goal).reduced)"
    assert run(code).stdout == run(code).stdout


@pytest.mark.parametrize("planner", ["BiasedRRTConnect", "BiasedRRT"])
@pytest.mark.parametrize("fast", [True, False])
def test_control_c_interrupts_a_search(planner, fast):
    code = (
        PLAN
        + f"""
import signal
# A shell's background job, and so its children, would ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)

class Never(Picky):
    def predict(self, X):
        return np.zeros(len(X), dtype=int)
    if {fast}:
        def fast_decision_function(self, X):
            return -np.ones(len(X))

# Compiling takes seconds in a fresh checkout, and is not what is interrupted here.
{planner}(arm, Never(), k=np.inf, max_iterations=200).plan(start, goal)
print("searching", flush=True)
{planner}(arm, Never(), k=np.inf, max_iterations=10**9).plan(start, goal)
"""
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline() == "searching\n"
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=3)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    finally:
        process.kill()
    assert error.rstrip().endswith("KeyboardInterrupt")


def test_importing_the_packages_imports_nothing_heavy():
    process = run(
        """
        import sys
        import planners, reliability, systems
        heavy = {"torch", "skorch", "sklearn", "ompl", "mujoco", "pybullet", "numba", "joblib"}
        print(sorted(heavy & set(sys.modules)))
        """
    )
    assert process.stdout == "[]\n"


def test_planning_with_a_loaded_model_needs_no_torch(arm_classifier, tmp_path):
    import joblib

    joblib.dump(arm_classifier, tmp_path / "model.joblib")
    process = run(
        PLAN
        + f"""
import sys
from reliability import load_estimator
model = load_estimator({str(tmp_path / "model.joblib")!r})
print(BiasedRRTConnect(arm, model, random_state=0).plan(start, goal).success)
print("torch" in sys.modules)
"""
    )
    assert process.stdout == "True\nFalse\n"


COLLECT = """
import os, signal, sys
from planners import BiasedRRTConnect
from reliability import collect_transitions
from toy_systems import Disc

class Deadly(Disc):
    def rollout(self, state, commands):
        if sum(name.endswith("item") for name in os.listdir(sys.argv[2])) == int(sys.argv[1]):
            os.kill(os.getpid(), signal.SIGKILL)
        return super().rollout(state, commands)

for path in sys.argv[2:]:
    collect_transitions(Deadly(), BiasedRRTConnect(None), 24, random_state=1, path=path)
"""


def test_a_collection_that_was_killed_goes_on_and_ends_with_the_same_bytes(tmp_path):
    killed, whole = tmp_path / "killed", tmp_path / "whole"

    def collect(limit, *paths):
        command = [sys.executable, "-c", COLLECT, str(limit), *map(str, paths)]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        return subprocess.run(command, env=environment, timeout=300).returncode

    assert collect(9, killed) == -signal.SIGKILL
    assert len(list(killed.glob("*.item"))) == 9
    assert collect(999, killed, whole) == 0
    contents = [
        {file.name: file.read_bytes() for file in path.iterdir()} for path in (killed, whole)
    ]
    assert contents[0] == contents[1]
    assert len(contents[0]) == 24 + 1


ENDLESS = """
import os, sys, time
from pathlib import Path
from planners import BiasedRRTConnect
from reliability import collect_transitions
from toy_systems import Disc

class Endless(Disc):
    def rollout(self, state, commands):
        (Path(sys.argv[1]) / str(os.getpid())).touch()
        time.sleep(600)

collect_transitions(Endless(), BiasedRRTConnect(None), 24, n_jobs=2, random_state=1)
"""


def test_workers_end_when_the_process_that_they_work_for_is_killed(tmp_path):
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-c", ENDLESS, str(tmp_path)]
    with subprocess.Popen(command, env=environment) as parent:
        workers = []
        while len(workers) < 2 and parent.poll() is None:
            time.sleep(0.1)
            workers = [psutil.Process(int(file.name)) for file in tmp_path.iterdir()]
        parent.kill()
    assert len(workers) == 2
    _, alive = psutil.wait_procs(workers, timeout=30)
    for worker in alive:
        worker.kill()
    assert not alive
