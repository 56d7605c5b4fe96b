"""Render the seven rope scenes: the rope at the start, green, and the goals, red.

Run ``python -m benchmarks.rope.scene_pictures [folder]``; it writes one picture per scene there.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.image

from systems import ROPE_COLOR, SCENE_NAMES, SceneRenderer, load_scene


def main(folder: Path) -> None:
    """Write ``<folder>/<scene>.png`` for every scene."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in SCENE_NAMES:
        scene = load_scene(name)
        with SceneRenderer(scene) as pictures:
            image = pictures.render([(scene.start_rope(), ROPE_COLOR)])
        matplotlib.image.imsave(folder / f"{name}.png", image)
        print(f"{folder / f'{name}.png'}: rope at rest {scene.rope_length:.2f} m")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "rope_scenes"))
