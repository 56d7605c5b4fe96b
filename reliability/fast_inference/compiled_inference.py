"""What a compiled classifier is: scores, and how to read them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

Scores = NDArray[Any]


@dataclass(frozen=True)
class CompiledInference:
    """The answers of a fitted classifier of two classes, without the cost of its public methods.

    A score is computed once for each row, and all answers are read from it. Functions take and
    return arrays with one entry or row for each row of features.

    Attributes
    ----------
    score : callable
        Maps feature rows of shape (n, n_features) to scores, of any shape that starts with n.
        Raises ``ValueError`` for rows that the classifier's own methods refuse.
    is_second : callable
        Maps scores to booleans of shape (n,): whether ``predict`` returns ``classes_[1]``.
    probability : callable
        Maps scores and a class, 0 or 1, to that column of ``predict_proba``.
    decision : callable or None
        Maps scores to ``decision_function``; None if the classifier has no such method.
    scores_are_public : bool
        Whether ``probability`` and ``decision`` are known to be those of the public methods, so
        that a wrapper's threshold or calibration can be applied to them.
    """

    score: Callable[[NDArray[Any]], Scores]
    is_second: Callable[[Scores], NDArray[np.bool_]]
    probability: Callable[[Scores, int], NDArray[np.float64]]
    decision: Callable[[Scores], Scores] | None
    scores_are_public: bool = True


def from_decisions(
    score: Callable[[NDArray[Any]], Scores], scores_are_public: bool = True
) -> CompiledInference:
    """Return the inference of a classifier whose decision function is a log-odds.

    Its probability of the second class is the logistic function of the decision.

    Parameters
    ----------
    score : callable
        Maps feature rows to ``decision_function``, shape (n,).
    scores_are_public : bool, default=True
    """
    return CompiledInference(score, _is_positive, _logistic, _unchanged, scores_are_public)


def from_probabilities(score: Callable[[NDArray[Any]], Scores]) -> CompiledInference:
    """Return the inference of a classifier that predicts the class of the largest probability.

    Parameters
    ----------
    score : callable
        Maps feature rows to ``predict_proba``, shape (n, 2).
    """
    return CompiledInference(score, _second_is_larger, _column, None)


def _is_positive(decisions: Scores) -> NDArray[np.bool_]:
    return decisions > 0


def _logistic(decisions: Scores, column: int) -> NDArray[np.float64]:
    second: NDArray[np.float64] = expit(decisions.astype(np.float64))
    return second if column == 1 else 1 - second


def _unchanged(decisions: Scores) -> Scores:
    return decisions


def _second_is_larger(probabilities: Scores) -> NDArray[np.bool_]:
    # Of equal columns, argmax takes the first.
    return probabilities[:, 1] > probabilities[:, 0]


def _column(probabilities: Scores, column: int) -> NDArray[np.float64]:
    return probabilities[:, column]
