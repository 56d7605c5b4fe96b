"""The table of a diagnosis."""

from __future__ import annotations

import math
from typing import Any


def diagnosis_table(diagnosis: Any) -> str:
    """Return the numbers of a diagnosis in lines, and its warnings below."""
    labels = diagnosis.labels
    rows = {
        "base rate (one label for every transition)": _share(diagnosis.base_rate),
        "accuracy": _share(diagnosis.accuracy),
        "balanced accuracy (chance is 0.5)": _share(diagnosis.balanced_accuracy),
        "recall of Reliable": _share(diagnosis.reliable_recall),
        "recall of Unreliable": _share(diagnosis.unreliable_recall),
        "recall of divergence onsets": _share(diagnosis.onset_recall),
        "Unreliable that k=1 lets through": _share(diagnosis.accepted_unreliable(1)),
        "Unreliable that k=10 lets through": _share(diagnosis.accepted_unreliable(10)),
        "expected calibration error": _share(diagnosis.expected_calibration_error),
        "Unreliable among the labels": _share(labels.unreliable_share),
        "  of these, only say: already diverged": _share(diagnosis.already_diverged_share),
        "labels from executed states": _share(labels.executed_share),
        "features": str(len(diagnosis.feature_ranges)),
        "  constant": str(len(diagnosis.constant_features)),
        "  equal to another": str(len(diagnosis.duplicate_features)),
    }
    table = "\n".join(f"{name:<44}{value:>8}" for name, value in rows.items())
    warnings = [f"{i}. {sentence}" for i, sentence in enumerate(diagnosis.warnings, 1)]
    return "\n".join(
        [
            f"{labels.n_transitions:,} transitions of {labels.n_plans:,} plans, {_how(diagnosis)}",
            table,
            "Warnings, most important first:" if warnings else "No warnings.",
            *warnings,
        ]
    )


def _how(diagnosis: Any) -> str:
    if diagnosis.n_folds is None:
        return "too few or too much alike to judge predictions"
    if diagnosis.n_folds == 0:
        return "judged by the estimator as it is"
    return f"each judged by a clone that has not seen its plan ({diagnosis.n_folds} folds)"


def _share(value: float) -> str:
    return "unknown" if math.isnan(value) else f"{value:.3f}"
