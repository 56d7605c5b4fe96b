"""Plan for the rope in one scene without and with a classifier, execute, and look at it.

Run ``python -m benchmarks.rope complex_hook``. It plans from the scene's start, without a
classifier until a rope gets caught, and with the trained model that comes with the library
from the same seeds; it prints what became of the plans and writes pictures and an animation of the
caught rope beside the other one to ``--out``. The rope is green; the band, which is what the
planner believed, is orange. ``--train`` makes the models anew first, which takes hours.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
from PIL import Image

import reliability
from planners import BiasedRRT
from reliability import load_estimator
from systems import (
    BAND_COLOR,
    ROPE_COLOR,
    SCENE_NAMES,
    Problem,
    Rollout,
    Rope,
    SceneRenderer,
    load_scene,
)

MODELS = Path(reliability.__file__).with_name("pretrained")
K = 10.0
TIME_LIMIT = 60.0
TOLERANCE = 0.025
N_FRAMES = 36
MILLISECONDS_PER_FRAME = 120


@dataclass(frozen=True)
class Trial:
    """The bands of a plan, and what became of it."""

    bands: np.ndarray
    rollout: Rollout
    success: bool


def main(arguments: list[str] | None = None) -> None:
    """Plan, execute and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="simple_hook", choices=SCENE_NAMES)
    parser.add_argument("--model", type=Path, default=MODELS / "rope.skops")
    parser.add_argument("--features", default="voxels", help="of a model that doesn't say")
    parser.add_argument("--engine", choices=("mujoco", "pybullet"), default="mujoco")
    parser.add_argument("--plans", type=int, default=10, help="seeds to try at most")
    parser.add_argument("--size", type=int, nargs=2, default=(480, 360), help="of a picture")
    parser.add_argument("--out", type=Path, default=Path("build/rope"))
    parser.add_argument("--train", action="store_true", help="make the models anew")
    parser.add_argument("--models", type=Path, default=MODELS, help="where --train writes them")
    parser.add_argument("--training-plans", type=int, default=1500, help="of Simple Hook, a round")
    parser.add_argument("--jobs", type=int, default=-1, help="processes that collect data")
    options = parser.parse_args(arguments)
    folder = options.out / options.scene
    folder.mkdir(parents=True, exist_ok=True)
    width, height = options.size
    # Pictures come first: MuJoCo has to learn how to draw when it is imported.
    with SceneRenderer(load_scene(options.scene), width=width, height=height) as pictures:
        if options.train:
            from benchmarks.rope.training import train_all

            data = options.out / "training"
            train_all(data, options.models, options.training_plans, options.jobs)
        estimator = load_estimator(options.model)
        features = getattr(estimator, "provenance_", {}).get("features", options.features)
        rope = Rope(options.scene, options.engine, features)
        caught, worked = compare(rope, estimator, options.plans)
        for name, trial in (("caught", caught), ("worked", worked)):
            if trial is not None:
                draw_moments(pictures, trial, folder / f"{name}.png")
        if caught is not None and worked is not None:
            animate(pictures, (caught, worked), folder / "caught_and_worked.gif")
    print(f"Pictures are in {folder}.")


def compare(rope: Rope, estimator: Any, n_plans: int) -> tuple[Trial | None, Trial | None]:
    """Plan both ways, seed by seed, until one was caught without and one worked with it."""
    caught = worked = None
    problem, plain_rope = rope.scene_problem(), Rope(rope.scene, rope.engine)
    for seed in range(n_plans):
        without = attempt(plain_rope, problem, None, seed)
        with_it = attempt(rope, problem, estimator, seed)
        if caught is None and without is not None and not without.success:
            caught = without
        if worked is None and with_it is not None and with_it.success:
            worked = with_it
        if caught is not None and worked is not None:
            break
    if caught is None and worked is None:
        sys.exit(f"None of {n_plans} seeds gave a plan to show.")
    return caught, worked


def attempt(rope: Rope, problem: Problem, estimator: Any, seed: int) -> Trial | None:
    """Plan, execute and tell; None without a plan."""
    name = "without a classifier" if estimator is None else "with the classifier"
    planner = BiasedRRT(
        rope, estimator, k=K, max_iterations=10**6, time_limit=TIME_LIMIT, random_state=seed
    )
    plan = planner.plan(rope.reduce(problem.start), problem.goal)
    if not plan.success:
        print(f"seed {seed}, {name}: {plan.status.value}")
        return None
    rollout = rope.rollout(problem.start, plan.commands)
    success = rope.succeeded(rollout.states[-1], problem.goal, TOLERANCE)
    print(
        f"seed {seed}, {name}: planned in {plan.planning_time:.1f} s and smoothed in "
        f"{plan.simplification_time:.1f} s to {len(plan.commands)} transitions. "
        f"{rollout.stop_reason.value}"
    )
    return Trial(rope.bands(plan.reduced), rollout, success)


def draw_moments(pictures: SceneRenderer, trial: Trial, path: Path) -> None:
    """Put pictures of the start, the middle and the end of an execution beside one another."""
    n_states = len(trial.rollout.states)
    moments = (0, n_states // 2, n_states - 1)
    frames = [draw(pictures, trial, moment) for moment in moments]
    matplotlib.image.imsave(path, np.hstack(frames))


def animate(pictures: SceneRenderer, trials: tuple[Trial, Trial], path: Path) -> None:
    """Write an animation of executions side by side; who ends first waits."""
    longest = max(len(trial.rollout.states) for trial in trials)
    frames = []
    for moment in np.linspace(0, longest - 1, N_FRAMES).astype(int):
        views = [
            draw(pictures, trial, min(int(moment), len(trial.rollout.states) - 1))
            for trial in trials
        ]
        frames.append(Image.fromarray(np.hstack(views)))
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=[MILLISECONDS_PER_FRAME] * (N_FRAMES - 1) + [2000],
        loop=0,
    )


def draw(pictures: SceneRenderer, trial: Trial, moment: int) -> np.ndarray:
    """Draw the rope at a moment, and the band that was planned for it."""
    # A band is both gripper positions, and then its points.
    band = trial.bands[moment, 6:].reshape(-1, 3)
    nodes = trial.rollout.states[moment].nodes
    return pictures.render([(nodes, ROPE_COLOR), (band, BAND_COLOR)])


if __name__ == "__main__":
    main()
