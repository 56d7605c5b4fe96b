"""Transitions per second of the rope's two engines and of g with two PBD ropes, one at a time.

Run as ``python -m benchmarks.speed.rope_engines``; it takes about half a minute on one core. Each
rope executes the same path beside its hook, three times. For Γ, the engine's own share of the
time is printed too.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from systems import Rope

SCENES = ("simple_hook_short", "simple_hook", "simple_hook_long", "simple_hook_very_long")
STEP = 0.025
# The function of each engine that advances its simulation.
STEPS = {"pybullet": "stepSimulation", "mujoco": "mj_step"}
REPETITIONS = 3


@contextmanager
def timed(module: Any, name: str) -> Iterator[list[float]]:
    """Note the seconds of each call of a module's function."""
    function, seconds = getattr(module, name), []

    def call(*arguments: Any) -> Any:
        began = perf_counter()
        result = function(*arguments)
        seconds.append(perf_counter() - began)
        return result

    setattr(module, name, call)
    try:
        yield seconds
    finally:
        setattr(module, name, function)


def beside_the_hook(start: np.ndarray, rope_length: float) -> np.ndarray:
    """Return the commands that pull a rope past its hook on one side."""
    apart = 0.35 * rope_length
    beside = np.array([[-1.1, -0.1, 0.0], [-1.1, -0.1 - apart, 0.0]])
    beyond = beside + np.array([2.2, 0.0, 0.0])
    commands = []
    for origin, target in ((start, beside), (beside, beyond)):
        move = (target - origin).ravel()
        count = int(np.ceil(np.linalg.norm(move) / STEP))
        commands += [move / count] * count
    return np.array(commands)


def measure(scene_name: str, engine: str) -> tuple[float, float]:
    """Return transitions per second and the share of them inside the engine's step."""
    rope = Rope(scene_name, engine)
    state = rope.scene_problem().start
    commands = beside_the_hook(rope.scene.start, rope.scene.rope_length)
    with timed(import_module(engine), STEPS[engine]) as in_step:
        began = perf_counter()
        for _ in range(REPETITIONS):
            rope.rollout(state, commands)
        seconds = perf_counter() - began
    return REPETITIONS * len(commands) / seconds, sum(in_step) / seconds


def measure_model(scene_name: str) -> float:
    """Return how many transitions per second g makes with a band and two PBD ropes."""
    rope = Rope(scene_name, features="clearance")
    start = rope.reduce(rope.scene_problem().start)[None]
    commands = beside_the_hook(rope.scene.start, rope.scene.rope_length)[:, None]
    rope.propagate(start, commands[0])
    began = perf_counter()
    for _ in range(REPETITIONS):
        reduced = start
        for command in commands:
            reduced, _ = rope.propagate(reduced, command)
    return REPETITIONS * len(commands) / (perf_counter() - began)


def main() -> None:
    """Print the table."""
    print(f"{'scene':24}{'engine':10}{'transitions/s':>14}{'engine share':>14}{'speed-up':>10}")
    for scene_name in SCENES:
        baseline = None
        for engine in STEPS:
            rate, share = measure(scene_name, engine)
            baseline = baseline or rate
            ratio = rate / baseline
            print(f"{scene_name:24}{engine:10}{rate:14.0f}{share:14.2f}{ratio:10.2f}", flush=True)
        rate = measure_model(scene_name)
        print(f"{scene_name:24}{'g':10}{rate:14.0f}{'':14}{rate / baseline:10.2f}")


if __name__ == "__main__":
    main()
