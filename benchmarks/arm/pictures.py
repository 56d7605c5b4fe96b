"""Pictures of the arm experiment, after the paper's Fig. 5."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from systems import PlanarArm

N_POSES = 14
TITLES = {
    "ours": "With the classifier: the arm folds",
    "none": "Without: the straight way through horizontal",
}
STYLES = {
    "ours": "-",
    "ours, best of 6": "-",
    "literal": "-.",
    "none, holdable goals": "--",
    "none": ":",
}


def draw_motions(
    arm: PlanarArm, motions: dict[str, tuple[np.ndarray, np.ndarray]], path: Path
) -> None:
    """Draw planned and executed motions, light to dark as time passes.

    Parameters
    ----------
    arm : PlanarArm
    motions : dict of (planned, executed)
        Configurations, each of shape (T + 1, 3), by planner.
    path : Path
    """
    figure, axes = plt.subplots(1, len(motions), figsize=(9.5, 5.2), layout="constrained")
    for axis, (name, (planned, executed)) in zip(axes, motions.items(), strict=True):
        _draw_poses(axis, arm.joint_positions(planned), 1.2, ["tab:gray"] * N_POSES, alpha=0.3)
        _draw_poses(
            axis,
            arm.joint_positions(executed),
            2.4,
            plt.get_cmap("viridis").resampled(N_POSES).colors,
        )
        goal = arm.joint_positions(planned[-1:])[0]
        axis.plot(*goal.T, color="tab:red", linewidth=1.2, linestyle="--", label="goal")
        axis.plot(0, 0, "ks", markersize=7)
        axis.set(
            title=TITLES[name],
            xlabel="x (m)",
            ylabel="z (m)",
            aspect="equal",
            xlim=(-1.7, 1.7),
            ylim=(-1.7, 1.7),
        )
        axis.legend(loc="lower right", frameon=False)
    figure.suptitle("Executed arm from violet (start) to yellow (end); planned arm in grey")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_poses(
    axis: Axes, positions: np.ndarray, width: float, colors: list[str], alpha: float = 1.0
) -> None:
    shown = np.linspace(0, len(positions) - 1, N_POSES).astype(int)
    for color, pose in zip(colors, positions[shown], strict=True):
        axis.plot(*pose.T, color=color, alpha=alpha, linewidth=width, marker="o", markersize=2.5)
    axis.plot(*positions[:, 3].T, color="black", alpha=0.35, linewidth=0.8)


def draw_success(
    results: dict[str, dict[str, list[dict[str, float]]]],
    thresholds: tuple[float, ...],
    path: Path,
) -> None:
    """Draw the share of successes against β, one panel per kind of start."""
    figure, axes = plt.subplots(
        1, len(results), figsize=(9.5, 3.8), sharey=True, layout="constrained"
    )
    grid = np.geomspace(thresholds[0], thresholds[-1], 200)
    for axis, (title, records) in zip(axes, results.items(), strict=True):
        for name, rows in records.items():
            distances = np.array([row["distance"] for row in rows])
            share = (distances[:, None] < grid).mean(axis=0)
            axis.plot(grid, share, STYLES[name], linewidth=2, label=name)
        axis.axvline(0.075, color="tab:gray", linewidth=0.8)
        axis.set(title=title, xscale="log", xlabel="success threshold β (rad)", ylim=(0, 1.02))
        axis.legend(loc="lower right", fontsize=8, frameon=False)
    axes[0].set_ylabel("share of queries that succeed")
    figure.savefig(path, dpi=110)
    plt.close(figure)
