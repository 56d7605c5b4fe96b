"""What one wants to know of labels, features and an estimator before planning with it."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.frozen import FrozenEstimator

from reliability.advice import diagnosis_warnings
from reliability.base_rate import beats_base_rate
from reliability.calibration_curve import CalibrationCurve
from reliability.classifier import TransitionReliabilityClassifier
from reliability.diagnosis_plot import draw_diagnosis
from reliability.diagnosis_table import diagnosis_table
from reliability.feature_columns import constant_columns, duplicate_columns, unscaled_columns
from reliability.labels import RELIABLE
from reliability.scenes import SceneArgument
from reliability.summary import Summary
from reliability.transitions import Transitions, named_features
from reliability.unseen_plans import UnseenPredictions, predict_unseen
from systems.validation import check_count


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What labels, features and an estimator are worth, judged on whole plans it has not seen.

    ``str`` gives a table. A number that can't be told is NaN: what predictions are worth if all
    labels are the same or there is only one plan, probabilities of an estimator that gives none.

    Attributes
    ----------
    labels : Summary
        What the labels are, with ``labels.base_rate`` and ``labels.already_diverged_share``.
    n_folds : int or None
        Parts that the plans were split into; 0 if the estimator was judged as it is (a
        FrozenEstimator), None if it could not be judged.
    accuracy : float
        Share of transitions whose label is predicted.
    beats_base_rate : bool
        Whether ``accuracy`` is greater than ``base_rate`` by more than chance.
    balanced_accuracy : float
        Mean of the recalls of both labels; 0.5 is chance.
    reliable_recall, unreliable_recall : float
        Share of the transitions with this label for which it is predicted.
    onset_recall : float
        Share of the divergence onsets (:meth:`Transitions.divergence_onsets`) that are predicted
        to be Unreliable. Only these tell what makes executions go wrong.
    calibration : CalibrationCurve
        How often transitions of a predicted probability are Reliable.
    feature_ranges : ndarray of shape (n_features, 2)
        Least and greatest value of each feature.
    constant_features : tuple of int
        Columns that have one value only. Bytes of voxel grids (uint8), of which many are always
        empty, count neither here nor as duplicates.
    duplicate_features : tuple of pairs of int
        Columns that are equal: the first of them, and a later one.
    unscaled_features : tuple of int
        Columns of a size that a network learns badly from; none for other estimators.
    feature_names : tuple of str or None
        What the columns are called; None if the system does not say, and in warnings columns have
        their numbers then.
    """

    labels: Summary
    n_folds: int | None
    accuracy: float
    beats_base_rate: bool
    balanced_accuracy: float
    reliable_recall: float
    unreliable_recall: float
    onset_recall: float
    calibration: CalibrationCurve
    feature_ranges: NDArray[np.float64]
    constant_features: tuple[int, ...]
    duplicate_features: tuple[tuple[int, int], ...]
    unscaled_features: tuple[int, ...]
    feature_names: tuple[str, ...] | None

    @property
    def base_rate(self) -> float:
        """Accuracy of predicting the more frequent label for every transition."""
        return self.labels.base_rate

    @property
    def already_diverged_share(self) -> float:
        """Share of the Unreliable labels that only say that the execution had diverged before."""
        return self.labels.already_diverged_share

    @property
    def expected_calibration_error(self) -> float:
        """How far predicted probabilities are from the shares observed, in the mean."""
        return self.calibration.expected_error

    def accepted_unreliable(self, k: float) -> float:
        """Return the share of Unreliable transitions that planners with this k let through.

        These are the ones predicted to be Reliable, and of the others the share exp(-k p_acc) that
        planners accept at random, with ``accuracy`` for p_acc.

        Parameters
        ----------
        k : float

        Returns
        -------
        share : float

        References
        ----------
        McConachie et al. 2020, Algorithm 1.
        """
        return 1 - self.unreliable_recall * (1 - math.exp(-k * self.accuracy))

    @property
    def warnings(self) -> list[str]:
        """At most five sentences that say what is wrong and what to do, most important first."""
        return diagnosis_warnings(self)

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers and warnings as JSON can hold them; None stands for NaN."""
        labels = {
            name: getattr(self.labels, name)
            for name in (
                "n_transitions",
                "n_plans",
                "n_plans_of_rarer_label",
                "unreliable_share",
                "executed_share",
            )
        }
        own = {field.name: getattr(self, field.name) for field in fields(self)} | labels
        del own["labels"]
        own["feature_ranges"] = self.feature_ranges.tolist()
        own["calibration"] = {k: v.tolist() for k, v in self.calibration._asdict().items()}
        for name in (
            "base_rate",
            "already_diverged_share",
            "expected_calibration_error",
            "warnings",
        ):
            own[name] = getattr(self, name)
        own["duplicate_features"] = [list(pair) for pair in self.duplicate_features]
        for name in ("constant_features", "unscaled_features"):
            own[name] = list(own[name])
        own["feature_names"] = None if self.feature_names is None else list(self.feature_names)
        return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in own.items()}

    def __str__(self) -> str:
        """Return a table of the numbers, and the warnings below."""
        return diagnosis_table(self)

    __repr__ = __str__

    def plot(self, axes: Any = None) -> Any:
        """Draw calibration, recalls beside the base rate, and ranges of features.

        Parameters
        ----------
        axes : sequence of three matplotlib Axes, default=None
            None makes a figure.

        Returns
        -------
        axes : sequence of three matplotlib Axes
        """
        return draw_diagnosis(self, axes)


def diagnose(
    estimator: Any,
    transitions: Transitions,
    system: SceneArgument,
    *,
    cv: int = 5,
    n_jobs: int | None = None,
) -> Diagnosis:
    """Tell what labels, features and an estimator are worth, before planning with it.

    The plans are split into ``cv`` parts, and a clone of the estimator is trained anew without each
    part and judged on it: training transitions would flatter an estimator, and so would
    other transitions of plans that it was trained on. Give the transitions that you train on; the
    estimator may be fitted or not, and is left as it is. To judge a fitted one as it is, on
    transitions of plans that it has not seen, give ``sklearn.frozen.FrozenEstimator(estimator)``.

    To compare sets of features, see :func:`compare_features`.

    Parameters
    ----------
    estimator : classifier
        Any of scikit-learn, a Pipeline, a search or a
        :class:`TransitionReliabilityClassifier`. If its ``fit`` takes groups, it gets plan ids.
    transitions : Transitions
        At least one.
    system : System, sequence of Systems, or callable ``random_state -> System``
        As for :meth:`Transitions.features`.
    cv : int, default=5
        Parts, at least 2, and so many trainings; fewer if there are fewer plans.
    n_jobs : int, default=None
        Processes that train at the same time.

    Returns
    -------
    diagnosis : Diagnosis
        To be printed and plotted; ``diagnosis.warnings`` says what to do.

    Raises
    ------
    ValueError
        If an argument is unfit.

    Examples
    --------
    >>> from sklearn.linear_model import LogisticRegression
    >>> from planners import BiasedRRTConnect
    >>> from reliability import collect_transitions, diagnose
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> data = collect_transitions(arm, BiasedRRTConnect(arm), 20, random_state=0)
    >>> diagnosis = diagnose(LogisticRegression(max_iter=1000), data, arm)
    >>> diagnosis.n_folds
    5
    """
    check_arguments(estimator, transitions, cv)
    X, names = named_features(transitions, system)
    return judge(estimator, transitions, X.reshape(len(X), -1), names, cv, n_jobs)[0]


def judge(
    estimator: Any,
    transitions: Transitions,
    X: NDArray[Any],
    names: tuple[str, ...] | None,
    cv: int,
    n_jobs: int | None,
) -> tuple[Diagnosis, UnseenPredictions | None]:
    """Diagnose with features X, (n, n_features); also return the predictions, if there are any."""
    labels = Summary.of(transitions)
    n_folds = None
    predictions = None
    if labels.base_rate < 1 and (labels.n_plans > 1 or isinstance(estimator, FrozenEstimator)):
        n_folds = 0 if isinstance(estimator, FrozenEstimator) else min(int(cv), labels.n_plans)
        y, plan = transitions.y, transitions.plan
        predictions = predict_unseen(estimator, X, y, plan, n_folds, n_jobs, names)
    is_network = isinstance(estimator, TransitionReliabilityClassifier)
    ranges = np.column_stack([X.min(axis=0), X.max(axis=0)]).astype(float)
    constant = constant_columns(X, ranges)
    diagnosis = Diagnosis(
        labels=labels,
        n_folds=n_folds,
        **_scores(transitions, predictions),
        feature_ranges=ranges,
        constant_features=constant,
        duplicate_features=duplicate_columns(X, constant),
        unscaled_features=unscaled_columns(X, ranges) if is_network else (),
        feature_names=names,
    )
    return diagnosis, predictions


def check_arguments(estimator: Any, transitions: Any, cv: Any) -> None:
    """Raise ``ValueError`` unless these can be judged."""
    if not isinstance(transitions, Transitions) or not len(transitions):
        raise ValueError(
            "transitions must be Transitions, at least one, as collect_transitions returns them; "
            f"got {transitions!r}."
        )
    if isinstance(estimator, type) or not all(
        hasattr(estimator, name) for name in ("fit", "predict", "get_params")
    ):
        raise ValueError(
            "estimator must be a classifier with the methods of scikit-learn's (fit, predict and "
            f"get_params), got {estimator!r}."
        )
    check_count(cv, "cv")
    if cv < 2:
        raise ValueError(f"cv must be at least 2, got {cv}.")


def _scores(transitions: Transitions, predictions: UnseenPredictions | None) -> dict[str, Any]:
    if predictions is None:
        names = ("accuracy", "balanced_accuracy", "reliable_recall", "unreliable_recall")
        unknown = dict.fromkeys((*names, "onset_recall"), math.nan)
        nothing = CalibrationCurve.of(np.zeros(0, dtype=np.bool_), np.zeros(0))
        return {**unknown, "beats_base_rate": False, "calibration": nothing}
    reliable = transitions.y == RELIABLE
    right = predictions.reliable == reliable
    of_reliable, of_unreliable = right[reliable].mean(), right[~reliable].mean()
    told = np.isfinite(predictions.probability)
    return {
        "accuracy": float(right.mean()),
        "beats_base_rate": beats_base_rate(transitions.y, right, transitions.plan),
        "balanced_accuracy": float(of_reliable + of_unreliable) / 2,
        "reliable_recall": float(of_reliable),
        "unreliable_recall": float(of_unreliable),
        "onset_recall": float(right[transitions.divergence_onsets()].mean()),
        "calibration": CalibrationCurve.of(reliable[told], predictions.probability[told]),
    }
