"""Copies of ``examples/*.py`` with a heading each, which is what the gallery is made from.

Examples run in the folder of these copies, so that the pictures they write are not left among the
examples.
"""

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).parents[1]
HEADING = """Gallery
=======

First code to read, run and change: each file stands alone, has at most 60 lines, and runs in less
than a minute on two quiet cores, from any folder. The pictures and outputs are of the code as it
stands.
"""
# In the order in which to read them; a file that is not listed comes last, titled by its name.
TITLES = {
    "quickstart": "The whole road in one file",
    "any_estimator": "Any estimator steers a planner",
    "arm": "The arm folds before it rises",
    "car": "The car drives through the gate",
    "rope": "The rope passes the hook",
    "held_out_plans": "Whole plans are held out",
    "own_system": "A system of your own",
    "own_simulator": "A system of your own in PyBullet",
    "own_scene": "A rope scene of your own",
    "rope_shapes": "Shapes, a draped start and a goal for one gripper",
}


def write(folder):
    """Write all examples below a folder, and return where they are.

    Parameters
    ----------
    folder : Path
        What it holds of an earlier build is removed.

    Returns
    -------
    Path
    """
    examples = folder / "examples"
    shutil.rmtree(folder, ignore_errors=True)
    examples.mkdir(parents=True)
    (examples / "GALLERY_HEADER.rst").write_text(HEADING)
    for file in sorted((ROOT / "examples").glob("*.py")):
        title = TITLES.get(file.stem, file.stem.replace("_", " ").capitalize())
        heading = f'"""\n{title}\n{"=" * len(title)}\n\n'
        code = re.sub(r'^"""', lambda _, heading=heading: heading, file.read_text(), count=1)
        (examples / file.name).write_text(code)
    return examples


def reading_order(filename):
    """Return the key by which the gallery's files are sorted."""
    order, name = list(TITLES), Path(filename).stem
    return order.index(name) if name in order else len(order), name
