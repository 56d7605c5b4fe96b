"""Plan for the rope in one scene without a classifier, execute the plans, and look at them.

Run ``python examples/rope.py simple_hook``; it plans until one plan has worked and one has got
caught, and writes pictures of both and an animation of the caught one to ``--out``. On the
pictures the rope is green; the band, which is what the planner believed, is orange.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib.image
import numpy as np
from PIL import Image

from planners import BiasedRRT, PlanResult
from systems import Problem, Rollout, Rope
from systems.band import band_points
from systems.rope_pictures import BAND_COLOR, ROPE_COLOR, ScenePictures
from systems.rope_scenes import SCENE_NAMES

TIME_LIMIT = 60.0
ENOUGH_SECONDS = 60.0
TOLERANCE = 0.025
N_FRAMES = 40
MILLISECONDS_PER_FRAME = 120


@dataclass(frozen=True)
class Trial:
    """A plan and what became of it."""

    plan: PlanResult
    rollout: Rollout
    success: bool


def main(arguments: list[str] | None = None) -> None:
    """Plan, execute and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="simple_hook", choices=SCENE_NAMES)
    parser.add_argument("--engine", choices=("mujoco", "pybullet"), default="mujoco")
    parser.add_argument("--plans", type=int, default=30, help="plans to try at most")
    parser.add_argument("--size", type=int, nargs=2, default=(720, 480), help="of pictures")
    parser.add_argument("--out", type=Path, default=Path("build/rope"))
    options = parser.parse_args(arguments)
    rope = Rope(options.scene, options.engine)
    folder = options.out / options.scene
    folder.mkdir(parents=True, exist_ok=True)
    width, height = options.size
    # Pictures come first: MuJoCo has to learn how to draw when it is imported.
    with ScenePictures(rope.scene, width=width, height=height) as pictures:
        trials = first_of_each(rope, rope.scene_problem(), options.plans)
        for success, trial in trials.items():
            name = "worked" if success else "caught"
            draw_moments(pictures, trial, folder / f"{name}.png")
            if not success:
                animate(pictures, trial, folder / f"{name}.gif")
    print(f"Pictures are in {folder}.")


def first_of_each(rope: Rope, problem: Problem, n_plans: int) -> dict[bool, Trial]:
    """Plan with one seed after another until one plan has worked and one has not.

    In some scenes nearly all plans end in one way; the search for the other ends after a minute.
    """
    found: dict[bool, Trial] = {}
    deadline = time.perf_counter() + ENOUGH_SECONDS
    start = rope.reduce(problem.start)
    for seed in range(n_plans):
        planner = BiasedRRT(rope, max_iterations=10**6, time_limit=TIME_LIMIT, random_state=seed)
        plan = planner.plan(start, problem.goal)
        if not plan.success:
            print(f"seed {seed}: {plan.status.value}")
            continue
        rollout = rope.rollout(problem.start, plan.commands)
        success = rope.succeeded(rollout.states[-1], problem.goal, TOLERANCE)
        print(
            f"seed {seed}: planned in {plan.planning_time:.1f} s and smoothed in "
            f"{plan.simplification_time:.1f} s to {len(plan.commands)} transitions. "
            f"{rollout.stop_reason.value}"
        )
        found.setdefault(success, Trial(plan, rollout, success))
        if len(found) == 2 or time.perf_counter() > deadline:
            break
    if not found:
        sys.exit(f"None of {n_plans} plans was found within {TIME_LIMIT:g} s each.")
    return found


def draw_moments(pictures: ScenePictures, trial: Trial, path: Path) -> None:
    """Put pictures of the start, the middle and the end of an execution beside one another."""
    n_states = len(trial.rollout.states)
    moments = (0, n_states // 2, n_states - 1)
    frames = [draw(pictures, trial, moment) for moment in moments]
    matplotlib.image.imsave(path, np.hstack(frames))


def animate(pictures: ScenePictures, trial: Trial, path: Path) -> None:
    """Write an animation of an execution."""
    moments = np.linspace(0, len(trial.rollout.states) - 1, N_FRAMES).astype(int)
    frames = [Image.fromarray(draw(pictures, trial, int(moment))) for moment in moments]
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=[MILLISECONDS_PER_FRAME] * (N_FRAMES - 1) + [2000],
        loop=0,
    )


def draw(pictures: ScenePictures, trial: Trial, moment: int) -> np.ndarray:
    """Draw the rope at a moment, and the band that was planned for it."""
    band = band_points(trial.plan.reduced[moment])
    nodes = trial.rollout.states[moment].nodes
    return pictures.render([(nodes, ROPE_COLOR), (band, BAND_COLOR)])


if __name__ == "__main__":
    main()
