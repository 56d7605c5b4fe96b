"""Which of several sets of features tells Reliable from Unreliable transitions best."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.frozen import FrozenEstimator

from reliability.diagnosis import Diagnosis, check_arguments, judge
from reliability.labels import RELIABLE
from reliability.plan_gains import SIGNIFICANCE, gains_of_plans, p_value
from reliability.transitions import Transitions, named_features

_COMPARED = ("balanced_accuracy", "reliable_recall", "onset_recall")


@dataclass(frozen=True, eq=False, repr=False)
class FeatureComparison:
    """What an estimator makes of each of several sets of features; ``str`` gives a table.

    Attributes
    ----------
    diagnoses : dict of str to Diagnosis
        By the sets' names, in the order given.
    p_values : dict of str to dict of str to float
        For each set but the first, how probable it is that its ``balanced_accuracy``,
        ``reliable_recall`` and ``onset_recall`` would differ so much from those of the first set by
        chance: a t-test of the differences that single plans make, since transitions of one plan go
        well or wrong together. Multiplied by the number of sets that are compared with the first
        (Bonferroni). NaN where predictions could not be judged.
    """

    diagnoses: dict[str, Diagnosis]
    p_values: dict[str, dict[str, float]]

    def to_dict(self) -> dict[str, Any]:
        """Return all numbers as JSON can hold them; None stands for NaN."""
        tests = {
            name: {key: None if math.isnan(p) else p for key, p in own.items()}
            for name, own in self.p_values.items()
        }
        found = {name: diagnosis.to_dict() for name, diagnosis in self.diagnoses.items()}
        return {"diagnoses": found, "p_values": tests}

    def __str__(self) -> str:
        """Return a table with a line for each set."""
        first, one = next(iter(self.diagnoses.items()))
        width = max(map(len, [*self.diagnoses, "features"])) + 1
        head = f"{'features':<{width}}{'columns':>8}{'balanced':>10}{'Reliable':>10}"
        return "\n".join(
            [
                f"{one.labels.n_transitions:,} transitions of {one.labels.n_plans:,} plans; "
                "balanced accuracy, recalls and calibration error on unseen plans",
                f"{head}{'onsets':>10}{'calibration':>13}",
                *(self._row(name, width) for name in self.diagnoses),
                f"* differs from {first!r} beyond chance (paired over plans, p < {SIGNIFICANCE})",
            ]
        )

    __repr__ = __str__

    def _row(self, name: str, width: int) -> str:
        diagnosis = self.diagnoses[name]
        row = f"{name:<{width}}{len(diagnosis.feature_ranges):>8}"
        for key in _COMPARED:
            p = self.p_values.get(name, {}).get(key, math.nan)
            row += f"{getattr(diagnosis, key):>8.3f}{' *' if p < SIGNIFICANCE else '  '}"
        return f"{row}{diagnosis.expected_calibration_error:>13.3f}".rstrip()


def compare_features(
    estimator: Any,
    transitions: Transitions,
    feature_sets: Mapping[str, Any],
    *,
    cv: int = 5,
    n_jobs: int | None = None,
) -> FeatureComparison:
    """Tell which features an estimator learns most from, on plans that it has not seen.

    Each set is judged as by :func:`diagnose`, all of them on the same parts of the plans.

    Parameters
    ----------
    estimator : classifier
        As for :func:`diagnose`; a clone of it is trained with each set.
    transitions : Transitions
    feature_sets : dict of str to System, sequence of Systems, callable, ndarray or DataFrame
        At least two, by name. A system, a sequence of systems or a callable ``random_state ->
        System`` describes the transitions as in :meth:`Transitions.features`; an array or a table
        of shape (n, n_features) holds features of one's own making. The others are compared with
        the first.
    cv : int, default=5
    n_jobs : int, default=None
        As for :func:`diagnose`.

    Returns
    -------
    comparison : FeatureComparison

    Raises
    ------
    ValueError
        If an argument is unfit.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.linear_model import LogisticRegression
    >>> from planners import BiasedRRTConnect
    >>> from reliability import collect_transitions, compare_features
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> data = collect_transitions(
    ...     arm, BiasedRRTConnect(arm), 30, labels="executed", random_state=0
    ... )
    >>> angles = np.hstack([data.reduced, data.next_reduced])
    >>> comparison = compare_features(
    ...     LogisticRegression(max_iter=1000), data, {"angles": angles, "directions of links": arm}
    ... )
    >>> comparison.p_values["directions of links"]["balanced_accuracy"] < 0.05
    True
    """
    check_arguments(estimator, transitions, cv)
    if isinstance(estimator, FrozenEstimator):
        raise ValueError(
            "estimator must be one that can be trained anew with each set of features, got "
            f"{estimator!r}."
        )
    if not isinstance(feature_sets, Mapping) or len(feature_sets) < 2:
        raise ValueError(
            "feature_sets must be a dict of at least two, names and what describes the "
            f"transitions, got {feature_sets!r}."
        )
    rows = {name: _rows(name, one, transitions) for name, one in feature_sets.items()}
    judged = {name: judge(estimator, transitions, *own, cv, n_jobs) for name, own in rows.items()}
    reliable = transitions.y == RELIABLE
    right = {
        name: None if predictions is None else predictions.reliable == reliable
        for name, (_, predictions) in judged.items()
    }
    first, *others = right
    return FeatureComparison(
        diagnoses={name: diagnosis for name, (diagnosis, _) in judged.items()},
        p_values={
            name: _p_values(right[first], right[name], transitions, len(others)) for name in others
        },
    )


def _rows(
    name: str, described_by: Any, transitions: Transitions
) -> tuple[NDArray[Any], tuple[str, ...] | None]:
    """Return features, (n, n_features), and their names, if they have any."""
    n = len(transitions)
    names = None
    if hasattr(described_by, "to_numpy"):
        names = tuple(map(str, described_by.columns))
        described_by = described_by.to_numpy()
    if not isinstance(described_by, np.ndarray):
        X, names = named_features(transitions, described_by)
        return X.reshape(n, -1), names
    if described_by.ndim != 2 or len(described_by) != n:
        raise ValueError(
            f"feature_sets[{name!r}] must have a row for each of the {n} transitions, got an array "
            f"of shape {described_by.shape}."
        )
    return described_by, names


def _p_values(
    one: NDArray[np.bool_] | None,
    other: NDArray[np.bool_] | None,
    transitions: Transitions,
    n_comparisons: int,
) -> dict[str, float]:
    if one is None or other is None:
        return dict.fromkeys(_COMPARED, math.nan)
    gain = other.astype(float) - one
    reliable = transitions.y == RELIABLE
    onset = transitions.divergence_onsets()
    # Each transition's part in the figure: the mean of both labels' recalls, or one label's recall.
    balanced = np.where(reliable, 1 / reliable.sum(), 1 / (~reliable).sum())
    weights = dict(zip(_COMPARED, (balanced, reliable, onset), strict=True))
    return {
        name: min(1.0, n_comparisons * p_value(gains_of_plans(gain * weight, transitions.plan)))
        for name, weight in weights.items()
    }
