"""Draws the rope's pictures of the page on concepts: run ``python docs/rope_figures.py``."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from planners import BiasedRRT
from systems import ROPE_COLOR, Rope, SceneRenderer, load_scene

PICTURES = Path(__file__).parent / "pictures"
SCENES = {
    "simple_hook": "Simple Hook",
    "multi_hook": "Multi Hook",
    "complex_hook": "Complex Hook",
    "engine_assembly": "Engine Assembly",
}
CHANNELS = ("obstacles and the world's edge", "band before", "band after")


def draw_scenes():
    """Draw the rope at rest, the goals and the obstacles of four of the paper's seven scenes."""
    figure, axes = plt.subplots(1, 4, figsize=(14, 3.1), layout="constrained")
    for axis, (name, title) in zip(axes, SCENES.items(), strict=True):
        scene = load_scene(name)
        with SceneRenderer(scene, width=640, height=480) as pictures:
            axis.imshow(pictures.render([(scene.start_rope(), ROPE_COLOR)]))
        axis.set(xticks=[], yticks=[], title=title)
    figure.savefig(PICTURES / "rope_scenes.png", dpi=80)


def draw_voxels():
    """Draw the three channels that VoxNet sees of one transition on Simple Hook."""
    rope = Rope("simple_hook")
    problem = rope.scene_problem()
    plan = BiasedRRT(rope, max_iterations=10**5, random_state=0).plan(
        rope.reduce(problem.start), problem.goal
    )
    middle = len(plan.commands) // 2
    row = rope.features(plan.reduced[[middle]], plan.reduced[[middle + 1]])
    voxels = np.unpackbits(row, axis=1).reshape(3, 32, 32, 32).astype(bool)
    figure, axes = plt.subplots(
        1, 3, figsize=(12, 4.2), layout="constrained", subplot_kw={"projection": "3d"}
    )
    colors = ("0.75", "tab:red", "tab:blue")
    for axis, channel, color, title in zip(axes, voxels, colors, CHANNELS, strict=True):
        axis.voxels(channel, facecolors=color, edgecolor="0.35", linewidth=0.1)
        axis.set(title=title, xlim=(0, 32), ylim=(0, 32), zlim=(0, 32), aspect="equal")
        axis.set(xticks=[], yticks=[], zticks=[])
        axis.view_init(elev=28, azim=55)
    figure.savefig(PICTURES / "rope_voxels.png", dpi=80, bbox_inches="tight", pad_inches=0.1)


if __name__ == "__main__":
    draw_scenes()
    draw_voxels()
