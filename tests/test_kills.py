"""Work that is killed or interrupted at random instants is whole when it is run again.

Each test kills many processes, which takes minutes. A server that has imported everything forks
them, so that kills fall into the work and not into imports. Work with processes of its own is
started afresh each time: in what a server forked, multiprocessing waits for joblib's idle workers.
"""

import contextlib
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect
from reliability import MLP, TransitionReliabilityClassifier, collect_transitions
from systems import PlanarArm, Rope

# Fewer, such as KILLS=10, on a busy machine.
N_KILLS = int(os.environ.get("KILLS", "100"))
INTERRUPTED = 130
SERVER = multiprocessing.get_context("forkserver")
SERVER.set_forkserver_preload(["test_kills", "skorch", "sklearn.utils.validation", "mujoco"])

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True, scope="module")
def path_of_the_server():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        yield


class Slower(Disc):
    """Takes a while to execute, so that kills fall between plans and into them."""

    def rollout(self, state, commands):
        time.sleep(0.01)
        return super().rollout(state, commands)


def collect(folder):
    data = collect_transitions(
        Slower(), BiasedRRTConnect(None), 30, random_state=1, path=folder / "data"
    )
    return pickle.dumps([data.reduced, data.command, data.y, data.plan])


def collect_in_two(folder):
    data = collect_transitions(
        Slower(), BiasedRRTConnect(None), 30, n_jobs=2, random_state=1, path=folder / "data"
    )
    return pickle.dumps([data.reduced, data.command, data.y, data.plan])


def train(folder):
    rng = np.random.default_rng(0)
    X = rng.normal(size=(3000, 6))
    classifier = TransitionReliabilityClassifier(
        MLP((16,)), max_epochs=12, patience=False, random_state=0, checkpoint=folder / "training"
    ).fit(X, X[:, 0] > X[:, 1] ** 2)
    return pickle.dumps([classifier.history_, classifier.decision_function(X)])


class HalfPlane:
    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9

    def predict(self, X):
        return (X[:, 3] > -0.5).astype(int)


def plan(folder):
    planner = BiasedRRTConnect(PlanarArm(), HalfPlane(), k=9, random_state=5)
    return planner.plan([-1.5, 0.3, 0.2], [1.5, 0.1, 0.0]).reduced.tobytes()


def execute_arm(folder):
    commands = np.tile([0.02, 0.01, -0.02], (300, 1))
    return np.array(PlanarArm().rollout([-1.5, 0.3, 0.2], commands).states).tobytes()


def plan_rope(folder):
    rope = Rope("engine_assembly")
    problem = rope.sample_problem(0)
    planner = BiasedRRT(rope, random_state=0, simplify=False)
    return planner.plan(rope.reduce(problem.start), problem.goal).reduced.tobytes()


def execute_rope(folder):
    rope = Rope("engine_assembly")
    problem = rope.sample_problem(0)
    commands = np.tile([0.0, 0.0, 0.005, 0.0, 0.0, 0.005], (40, 1))
    states = rope.rollout(problem.start, commands).states
    return np.array([rope.reduce(state) for state in states]).tobytes()


def run(work, folder):
    """Do the work in a process of its own, and keep its result in a file."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        (folder / "started").touch()
        result = work(folder)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    (folder / "result").write_bytes(result)


class Afresh(subprocess.Popen):
    """An interpreter that does some work, with what is used here of multiprocessing's Process."""

    def __init__(self, work, folder):
        code = (
            f"from pathlib import Path; import test_kills as t; "
            f"t.run(t.{work.__name__}, Path({str(folder)!r}))"
        )
        super().__init__([sys.executable, "-c", code])

    def is_alive(self):
        return self.poll() is None

    def join(self, timeout):
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.wait(timeout)

    exitcode = property(subprocess.Popen.poll)


def started(work, folder):
    """Start a process, and wait until it works."""
    (folder / "started").unlink(missing_ok=True)
    if work is collect_in_two:
        process = Afresh(work, folder)
    else:
        process = SERVER.Process(target=run, args=(work, folder))
        process.start()
    while not (folder / "started").exists() and process.is_alive():
        time.sleep(0.001)
    return process


def ended(process):
    process.join(timeout=120)
    assert not process.is_alive(), "it hangs"
    return process.exitcode


@cache
def undisturbed(work):
    """Return the result of work that nothing disturbs, and the seconds that it takes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        assert ended(started(work, folder)) == 0  # compiles, and fills caches
        for file in (folder / "result", folder / "training"):
            file.unlink(missing_ok=True)
        for file in (folder / "data").glob("*"):
            file.unlink()
        began = time.monotonic()
        assert ended(started(work, folder)) == 0
        return (folder / "result").read_bytes(), time.monotonic() - began


def disturb(work, number, rng, base):
    """Send a signal to processes of some work at random instants; return their exit codes.

    What is left of each is taken up by the next one. Once the work comes to its end, its result
    is compared with the undisturbed one, and the work begins anew.
    """
    expected, seconds = undisturbed(work)
    folder, codes = base / "0", []
    folder.mkdir()
    while len(codes) < N_KILLS:
        process = started(work, folder)
        time.sleep(rng.uniform(0, seconds))
        with contextlib.suppress(ProcessLookupError):
            os.kill(process.pid, number)
        code = ended(process)
        if code == 0:
            assert (folder / "result").read_bytes() == expected
            folder = base / str(len(list(base.iterdir())))
            folder.mkdir()
        else:
            codes.append(code)
    assert ended(started(work, folder)) == 0
    assert (folder / "result").read_bytes() == expected
    return codes


WORK = {"collect": collect, "collect-in-two": collect_in_two, "train": train}
ALONE = {
    "plan": plan,
    "execute-arm": execute_arm,
    "plan-rope": plan_rope,
    "execute-rope": execute_rope,
}


@pytest.mark.parametrize("name", WORK)
def test_what_was_killed_a_hundred_times_ends_with_the_same_bytes(name, tmp_path, rng):
    assert set(disturb(WORK[name], signal.SIGKILL, rng, tmp_path)) == {-signal.SIGKILL}


@pytest.mark.parametrize("name", WORK | ALONE)
def test_control_c_is_a_keyboard_interrupt_at_any_instant(name, tmp_path, rng):
    codes = disturb((WORK | ALONE)[name], signal.SIGINT, rng, tmp_path)
    assert set(codes) == {INTERRUPTED}
    assert not list(tmp_path.rglob("*.partial")), "nothing is left half-written"
