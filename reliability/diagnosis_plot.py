"""The picture of a diagnosis."""

from __future__ import annotations

from typing import Any

import numpy as np

from reliability.axes import drawing_axes
from reliability.calibration_curve import N_BINS

_SUSPICIOUS, _PLAIN = "tab:red", "tab:blue"


def draw_diagnosis(diagnosis: Any, axes: Any = None) -> Any:
    """Draw a diagnosis; see :meth:`Diagnosis.plot`."""
    axes = drawing_axes(axes, "Diagnosis.plot", 3, figsize=(13, 3.8))
    _draw_calibration(diagnosis, axes[0])
    _draw_recalls(diagnosis, axes[1])
    _draw_ranges(diagnosis, axes[2])
    return axes


def _draw_calibration(diagnosis: Any, ax: Any) -> None:
    curve = diagnosis.calibration
    share = curve.n_transitions / max(curve.n_transitions.sum(), 1)
    places = (np.minimum(np.floor(curve.predicted * N_BINS), N_BINS - 1) + 0.5) / N_BINS
    ax.bar(places, share, 0.9 / N_BINS, color="0.85", label="share of transitions")
    ax.plot([0, 1], [0, 1], ":", color="0.4", label="perfectly calibrated")
    ax.plot(curve.predicted, curve.observed, "o-", color=_PLAIN, label="estimator")
    ax.set(xlim=(0, 1), ylim=(0, 1), xlabel="predicted probability of Reliable")
    error = diagnosis.expected_calibration_error
    known = "no probabilities" if np.isnan(error) else f"expected calibration error {error:.3f}"
    ax.set(ylabel="share that is Reliable", title=known)
    ax.legend(loc="upper left", fontsize="small")


def _draw_recalls(diagnosis: Any, ax: Any) -> None:
    shares = {
        "accuracy": diagnosis.accuracy,
        "balanced\naccuracy": diagnosis.balanced_accuracy,
        "recall of\nReliable": diagnosis.reliable_recall,
        "recall of\nUnreliable": diagnosis.unreliable_recall,
        "recall of diver-\ngence onsets": diagnosis.onset_recall,
    }
    places = np.arange(len(shares))[::-1]
    values = np.nan_to_num(list(shares.values()))
    ax.barh(places, values, color=[_SUSPICIOUS if v < 0.5 else _PLAIN for v in values])
    for place, value in zip(places, shares.values(), strict=True):
        known = "unknown" if np.isnan(value) else f"{value:.2f}"
        ax.text(0.02, place, known, va="center", bbox={"color": "white", "alpha": 0.8, "pad": 1.5})
    ax.axvline(diagnosis.base_rate, ls="--", color="0.2", label="base rate")
    ax.axvline(0.5, ls=":", color="0.5", label="chance, balanced")
    ax.set_yticks(places, list(shares))
    ax.set(xlim=(0, 1), title="on plans that were not seen")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2, frameon=False)


def _draw_ranges(diagnosis: Any, ax: Any) -> None:
    low, high = diagnosis.feature_ranges.T
    columns = np.arange(len(low))
    odd = {*diagnosis.constant_features, *diagnosis.unscaled_features}
    odd |= {later for _, later in diagnosis.duplicate_features}
    suspicious = np.isin(columns, list(odd))
    for chosen, color, label in (
        (~suspicious, _PLAIN, "fit to learn from"),
        (suspicious, _SUSPICIOUS, "constant, duplicate or not of order one"),
    ):
        if chosen.any():
            ax.vlines(columns[chosen], low[chosen], high[chosen], color=color, lw=3, label=label)
            ax.plot(columns[chosen], low[chosen], "_", color=color)
    ax.set_yscale("symlog", linthresh=1.0)
    ax.set(xlabel="feature", ylabel="least to greatest value", title="ranges of the features")
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), frameon=False, fontsize="small")
