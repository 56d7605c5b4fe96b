"""Learning which transitions of a reduced model can be trusted."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from reliability.labels import RELIABLE, UNRELIABLE, label_transitions
from reliability.transitions import Transitions

if TYPE_CHECKING:
    from reliability.backends import MLP, VoxNet
    from reliability.boosting import FastHistGradientBoostingClassifier
    from reliability.classifier import TransitionReliabilityClassifier
    from reliability.collect import collect_transitions
    from reliability.persistence import ModelFileError, load_estimator
    from reliability.summary import Summary

__version__ = "0.1.0"

__all__ = [
    "MLP",
    "RELIABLE",
    "UNRELIABLE",
    "FastHistGradientBoostingClassifier",
    "ModelFileError",
    "Summary",
    "TransitionReliabilityClassifier",
    "Transitions",
    "VoxNet",
    "collect_transitions",
    "label_transitions",
    "load_estimator",
]

_HOMES = {
    "MLP": "reliability.backends",
    "VoxNet": "reliability.backends",
    "FastHistGradientBoostingClassifier": "reliability.boosting",
    "TransitionReliabilityClassifier": "reliability.classifier",
    "collect_transitions": "reliability.collect",
    "ModelFileError": "reliability.persistence",
    "load_estimator": "reliability.persistence",
    "Summary": "reliability.summary",
}


def __getattr__(name: str) -> Any:
    # scikit-learn and joblib take a second to import, which labelling alone need not pay.
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'reliability' has no attribute {name!r}")
