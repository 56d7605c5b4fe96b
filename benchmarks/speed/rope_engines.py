"""Transitions per second of the rope's two engines and of g with two PBD ropes, one at a time.

Run as ``python -m benchmarks.speed.rope_engines``; it takes about half a minute on one core. Each
rope executes the same path beside its hook, three times. For Γ, the engine's own share of the
time is printed too.
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from systems import Rope
from systems.rope.paper_scenes import load_scene
from systems.rope.simulation.engines import ENGINES
from systems.rope.simulation.quasistatic import RopeRollout

SCENES = ("simple_hook_short", "simple_hook", "simple_hook_long", "simple_hook_very_long")
STEP = 0.025
REPETITIONS = 3


class Stopwatch:
    """Adds up the time spent in one function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.seconds = 0.0

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        start = perf_counter()
        result = self.function(*arguments)
        self.seconds += perf_counter() - start
        return result


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
    scene = load_scene(scene_name)
    execution = RopeRollout(scene, engine)
    state = execution.settle(scene.start_rope())
    commands = beside_the_hook(scene.start, scene.rope_length)
    started = execution._engine()
    watch = Stopwatch(started.step)
    started.step = watch  # type: ignore[method-assign]
    start = perf_counter()
    for _ in range(REPETITIONS):
        execution.execute(state, commands)
    seconds = perf_counter() - start
    return REPETITIONS * len(commands) / seconds, watch.seconds / seconds


def measure_loose(scene_name: str) -> float:
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
        for engine in reversed(ENGINES):
            rate, share = measure(scene_name, engine)
            baseline = baseline or rate
            ratio = rate / baseline
            print(f"{scene_name:24}{engine:10}{rate:14.0f}{share:14.2f}{ratio:10.2f}", flush=True)
        rate = measure_loose(scene_name)
        print(f"{scene_name:24}{'g, loose':10}{rate:14.0f}{'':14}{rate / baseline:10.2f}")


if __name__ == "__main__":
    main()
