"""Estimators that come with the library, and where they were learned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reliability.persistence import SKOPS, load_estimator
from systems.validation import check_choice

_FOLDER = Path(__file__).parent


def load_pretrained(name: str) -> Any:
    """Load an estimator that comes with the library.

    Its ``provenance_`` tells what it was learned from, and by ``provenance_["features"]`` which
    features it wants: those of ``Rope(scene, features=...)``.

    Parameters
    ----------
    name : {"rope", "rope_paper", "rope_vector"}
        For :class:`systems.Rope` in scenes of any obstacles:

        - "rope": boosted trees, learned in 1,142 scenes, for "clearance". Take this one.
        - "rope_paper": the paper's VoxNet, learned in Simple Hook alone, for "voxels". Needs torch.
        - "rope_vector": boosted trees, learned in Simple Hook alone, for "vector".

    Returns
    -------
    estimator : classifier
        Fitted.

    Raises
    ------
    ValueError
        If there is no such estimator; the message lists those that there are.
    ModuleNotFoundError
        If the estimator needs an extra that is not installed; the message names it.

    Examples
    --------
    >>> from reliability import load_pretrained
    >>> estimator = load_pretrained("rope")
    >>> estimator.provenance_["features"]
    'clearance'
    """
    names = tuple(sorted(file.stem for file in _FOLDER.glob(f"*{SKOPS}")))
    check_choice(name, "name", names)
    return load_estimator(_FOLDER / f"{name}{SKOPS}")
