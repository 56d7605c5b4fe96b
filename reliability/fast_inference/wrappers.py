"""Thresholds and calibration around a classifier that is compiled already."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit
from sklearn.isotonic import IsotonicRegression

from reliability.fast_inference.compiled_inference import (
    CompiledInference,
    Scores,
    from_probabilities,
)

Reading = Callable[[Scores], Scores]


def with_threshold(
    inner: CompiledInference, response_method: str, threshold: Any, positive: int
) -> CompiledInference | None:
    """Return an inference whose predictions follow a threshold of scikit-learn's wrappers.

    Parameters
    ----------
    inner : CompiledInference
    response_method : {"auto", "predict_proba", "decision_function"}
        What is compared with the threshold; "auto" takes probabilities.
    threshold : {"auto"} or float
        "auto" is 0.5 for probabilities, 0 for decisions.
    positive : int
        The class, 0 or 1, that is predicted from the threshold on.

    Returns
    -------
    inference : CompiledInference or None
        None if ``inner`` has no such response.
    """
    response = _response_to_threshold(inner, response_method, positive)
    if response is None:
        return None
    read, usual = response
    least = usual if isinstance(threshold, str) else threshold

    def is_second(scores: Scores) -> NDArray[np.bool_]:
        reaches: NDArray[np.bool_] = read(scores) >= least
        return reaches if positive == 1 else ~reaches

    return replace(inner, is_second=is_second)


def _response_to_threshold(
    inner: CompiledInference, response_method: str, positive: int
) -> tuple[Reading, float] | None:
    """Return what is compared with a threshold, and the threshold that "auto" stands for."""
    if response_method != "decision_function":
        return (lambda scores: inner.probability(scores, positive)), 0.5
    decision, sign = inner.decision, 1 if positive == 1 else -1
    if decision is None:
        return None
    return (lambda scores: sign * decision(scores)), 0.0


def calibrated(
    members: Sequence[tuple[CompiledInference, Reading]],
) -> CompiledInference:
    """Return the mean of calibrated probabilities, as ``CalibratedClassifierCV`` computes it.

    Parameters
    ----------
    members : sequence of (CompiledInference, callable)
        Classifiers, and what maps the response of each to the probability of the second class.
    """

    def score(rows: NDArray[Any]) -> NDArray[np.float64]:
        total = np.zeros((len(rows), 2))
        for inner, calibrate in members:
            response = _response_to_calibrate(inner, inner.score(rows))
            second = np.asarray(calibrate(response), dtype=np.float64)
            total[:, 0] += 1.0 - second
            total[:, 1] += second
        total /= len(members)
        return total

    return from_probabilities(score)


def compile_calibrator(calibrator: Any, method: str) -> Reading | None:
    """Return a fitted calibrator's ``predict`` as a quick function; None if it is not known here.

    Parameters
    ----------
    calibrator : object
        An ``IsotonicRegression``, or scikit-learn's logistic regression of one variable.
    method : str
        ``CalibratedClassifierCV``'s.
    """
    if method == "sigmoid":
        return lambda response: expit(-(calibrator.a_ * response + calibrator.b_))
    if method != "isotonic" or type(calibrator) is not IsotonicRegression:
        return None
    if calibrator.out_of_bounds != "clip":
        return None
    x, y = calibrator.X_thresholds_, calibrator.y_thresholds_
    low, high = calibrator.X_min_, calibrator.X_max_
    # SciPy's interpolation, which the calibrator calls, is NumPy's in double precision.
    is_double = x.dtype == np.float64 and y.dtype == np.float64
    interpolate = (lambda at: np.interp(at, x, y)) if is_double else calibrator.f_

    def calibrate(response: Scores) -> NDArray[Any]:
        clipped = np.clip(response.astype(x.dtype), low, high)
        calibrated: NDArray[Any] = interpolate(clipped).astype(x.dtype)
        return calibrated

    return calibrate


def _response_to_calibrate(inner: CompiledInference, scores: Scores) -> Scores:
    """Return what calibration takes: decisions where there are any, else probabilities."""
    return inner.decision(scores) if inner.decision else inner.probability(scores, 1)
