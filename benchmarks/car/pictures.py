"""Pictures of the car, after the paper's Figs. 3 and 4."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes

from benchmarks.car.compared_planners import BETA, plan_query
from benchmarks.car.label_noise import Noise, bins
from planners import PlanResult
from reliability import RELIABLE
from systems import Car, CarScene, Circle, ConvexPolygon, Problem, random_car_scene

GREEN, RED = "tab:green", "tab:red"
FAN_SCENE = CarScene(
    (Circle(1.75, 0.5, 0.45), ConvexPolygon(((-1.1, -1.2), (0.0, -1.2), (-0.5, -0.35)))),
    (-1.2, -1.3, 2.3, 1.3),
)
SPEED_SCENE = CarScene((Circle(1.65, 0.13, 0.5),), (0.0, -0.8, 2.3, 0.8))
SPEED_POSE, SPEED_COMMAND = (0.3, 0.0, 0.0), (0.45, -0.2, -0.85)
SPEEDS = (0.5, 1.75, 2.0)
FAN_POSE, TURN_OF_FAN = np.array([0.3, 0.0, 0.0]), 0.6
DEMO_SEED = 31
SECONDS_PER_FRAME = 0.3


def draw_all(classifier: Any, out: Path, n_tries: int) -> None:
    """Save the pictures of the paper's example, and of one query in a random scene."""
    draw_fan(classifier, out / "fan.png")
    draw_speeds(out / "speeds.png")
    scene, problem, plans = find_demonstration(classifier, n_tries)
    draw_trees(scene, problem, plans, out / "trees.png")
    animate(scene, problem, plans, out / "executions.gif")


def draw_fan(classifier: Any, path: Path) -> None:
    """Draw what the classifier says of many commands from one pose (the paper's Fig. 3)."""
    car = Car(FAN_SCENE)
    commands = _all_around()
    reduced = np.repeat([FAN_POSE], len(commands), axis=0)
    following, valid = car.propagate(reduced, commands)
    reliable = classifier.predict(car.features(reduced[valid], following[valid])) == RELIABLE
    figure, axis = plt.subplots(figsize=(5.8, 4.6), layout="constrained")
    _draw_scene(axis, FAN_SCENE)
    for end, good in zip(following[valid], reliable, strict=True):
        color = GREEN if good else RED
        axis.plot(*np.transpose([FAN_POSE[:2], end[:2]]), color=color, linewidth=0.7, alpha=0.5)
        _draw_arrow(axis, end, color, size=0.5)
    _draw_car(axis, FAN_POSE, "black")
    axis.plot([], [], color=GREEN, marker=">", label="Reliable")
    axis.plot([], [], color=RED, marker=">", label="Unreliable")
    axis.legend(loc="upper left", fontsize=9, framealpha=1)
    axis.set_title("Commands from one pose; no straight way touches anything", fontsize=10)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def _all_around() -> np.ndarray:
    """Return displacements in all directions, turned as on a circle where that can be driven."""
    bearing = np.arange(-np.pi, np.pi, np.pi / 24)
    turn = np.clip(2 * np.arctan(np.tan(bearing)), -TURN_OF_FAN, TURN_OF_FAN)
    rows = [
        np.column_stack([length * np.cos(bearing), length * np.sin(bearing), turn])
        for length in (0.5, 0.8)
    ]
    return np.concatenate(rows)


def draw_speeds(path: Path) -> None:
    """Draw one command executed from one pose at three speeds (the paper's Fig. 4)."""
    car = Car(SPEED_SCENE)
    predicted = np.add(SPEED_POSE, SPEED_COMMAND)
    figure, axes = plt.subplots(1, 3, figsize=(9.0, 2.7), layout="constrained")
    for axis, speed in zip(axes, SPEEDS, strict=True):
        start = [*SPEED_POSE, speed, 0.0]
        trace = car.trace(start, [SPEED_COMMAND])
        completed = car.execute([start], [SPEED_COMMAND])[1][0]
        close = car.close(predicted[None], trace[-1:, :3])[0]
        color, outcome = (GREEN, "arrives") if close else ("tab:orange", "swings wide")
        if not completed:
            color, outcome = RED, "hits the obstacle"
        _draw_scene(axis, SPEED_SCENE)
        _draw_car(axis, np.array(SPEED_POSE), "black")
        _draw_car(axis, predicted, "tab:gray", dashed=True)
        axis.plot(*trace[:, :2].T, color=color, linewidth=2)
        _draw_car(axis, trace[-1], color)
        axis.set_title(f"{speed} m/s: {outcome}", fontsize=10)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_calibration(noise: Noise, path: Path) -> None:
    """Draw the reliability diagram and the distribution of shares."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
    axes[0].plot([0, 1], [0, 1], color="tab:gray", linewidth=0.8)
    for name, probability in (("classifier", noise.raw), ("calibrated", noise.calibrated)):
        rows = bins(probability, noise.share)
        rows = rows[rows[:, 2] >= 20]
        axes[0].plot(rows[:, 0], rows[:, 1], marker="o", label=name)
    axes[0].set(
        xlabel="probability of Reliable",
        ylabel="share of speeds with which it is",
        title="Reliability diagram",
    )
    axes[0].legend(frameon=False)
    axes[1].hist(noise.share, bins=21, color="tab:gray")
    axes[1].set(
        yscale="log",
        xlabel="share of speeds with which it is Reliable",
        ylabel="transitions",
        title="Between 0 and 1 the label is noise",
    )
    figure.savefig(path, dpi=90)
    plt.close(figure)


def find_demonstration(
    classifier: Any, n_tries: int
) -> tuple[CarScene, Problem, dict[str, PlanResult]]:
    """Find a query on which the car drives far with the classifier and crashes without."""
    for i in range(n_tries):
        scene = random_car_scene(np.random.SeedSequence([DEMO_SEED, i]))
        car = Car(scene)
        problem = car.sample_problem(np.random.SeedSequence([DEMO_SEED, i, 1]))
        if np.linalg.norm(problem.goal[0, :2] - problem.start[:2]) < 4 and i + 1 < n_tries:
            continue
        plans = {name: plan_query(name, scene, classifier, problem, i) for name in ("none", "ours")}
        ends = [car.rollout(problem.start, plan.commands) for plan in plans.values()]
        crashed = ends[0].n_completed < len(plans["none"].commands)
        if crashed and car.succeeded(ends[1].states[-1], problem.goal, BETA):
            break
    return scene, problem, plans


def draw_trees(scene: CarScene, problem: Problem, plans: dict[str, PlanResult], path: Path) -> None:
    """Draw both searches, the plans that they found, and what came of them."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 5.2), layout="constrained")
    for axis, (name, plan) in zip(axes, plans.items(), strict=True):
        trace = Car(scene).trace(problem.start, plan.commands)
        _draw_query(axis, scene, problem)
        for one, other in plan.tree[:, :, :2]:
            axis.plot(*np.transpose([one, other]), color="tab:blue", linewidth=0.5, alpha=0.5)
        axis.plot(*plan.reduced[:, :2].T, color="black", linestyle="--", label="plan")
        axis.plot(*trace[:, :2].T, color="tab:orange", linewidth=2, label="execution")
        _draw_car(axis, trace[-1], _outcome(scene, problem, trace[-1]))
        axis.set_title(_title(name))
        axis.legend(loc="upper right", fontsize=8)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def animate(scene: CarScene, problem: Problem, plans: dict[str, PlanResult], path: Path) -> None:
    """Animate both executions side by side."""
    car = Car(scene)
    every = round(SECONDS_PER_FRAME / 0.01)
    traces = [car.trace(problem.start, plan.commands) for plan in plans.values()]
    frames = [np.vstack([trace[:-1:every], trace[-1]]) for trace in traces]
    n_frames = max(map(len, frames)) + 8
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.9), layout="constrained")

    def draw(frame: int) -> list[Any]:
        for axis, states, (name, plan) in zip(axes, frames, plans.items(), strict=True):
            axis.clear()
            _draw_query(axis, scene, problem)
            axis.plot(*plan.reduced[:, :2].T, color="black", linestyle="--", linewidth=0.8)
            shown = states[: frame + 1]
            axis.plot(*shown[:, :2].T, color="tab:orange", linewidth=2)
            ended = len(shown) == len(states)
            _draw_car(axis, shown[-1], _outcome(scene, problem, shown[-1]) if ended else "black")
            axis.set_title(_title(name), fontsize=10)
        return []

    animation = FuncAnimation(figure, draw, frames=n_frames)
    animation.save(path, PillowWriter(fps=round(2 / SECONDS_PER_FRAME)), dpi=64)
    plt.close(figure)


def _outcome(scene: CarScene, problem: Problem, state: np.ndarray) -> str:
    return GREEN if Car(scene).succeeded(state, problem.goal, BETA) else RED


def _title(name: str) -> str:
    return "With the classifier" if name == "ours" else "Without"


def _draw_query(axis: Axes, scene: CarScene, problem: Problem) -> None:
    _draw_scene(axis, scene)
    _draw_car(axis, problem.start, "tab:gray")
    _draw_car(axis, problem.goal[0], GREEN, dashed=True)


def _draw_scene(axis: Axes, scene: CarScene) -> None:
    x_min, y_min, x_max, y_max = scene.bounds
    for obstacle in scene.obstacles:
        axis.fill(*obstacle.outline.T, color="0.65", linewidth=0)
    axis.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal", xticks=[], yticks=[])


def _draw_car(axis: Axes, pose: np.ndarray, color: str, dashed: bool = False) -> None:
    outline = Car().outline(pose)
    axis.plot(*outline.T, color=color, linewidth=1.3, linestyle="--" if dashed else "-")
    _draw_arrow(axis, pose, color)


def _draw_arrow(axis: Axes, pose: np.ndarray, color: str, size: float = 1.0) -> None:
    heading = np.array([np.cos(pose[2]), np.sin(pose[2])])
    left = np.array([-heading[1], heading[0]])
    tail = pose[:2] + 0.1 * heading * (size == 1)
    corners = [tail + 0.2 * size * heading, tail + 0.08 * size * left, tail - 0.08 * size * left]
    axis.add_patch(plt.Polygon(corners, color=color, linewidth=0))
