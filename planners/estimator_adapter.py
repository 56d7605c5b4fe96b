"""The one place that asks an estimator about transitions."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.utils.validation import check_is_fitted

from reliability.answer_checks import check_numbers, column_of_probabilities, is_label
from reliability.labels import RELIABLE, UNRELIABLE
from reliability.named_features import Columns, columns_to_ask
from systems.features.names import feature_names
from systems.system import Array, System

if TYPE_CHECKING:
    from reliability.fast_inference.compiled_inference import CompiledInference

_NUMBERS: dict[Any, bool] = {RELIABLE: True, UNRELIABLE: False}
_NAMES = {"reliable": True, "unreliable": False}


class EstimatorAdapter(Protocol):
    """What planners see of an estimator, whatever it is.

    All methods take reduced states before and after transitions, two ndarrays of shape
    (n, reduced_dim), and raise ``ValueError`` where the estimator returns something that is no
    answer.

    Attributes
    ----------
    answers_fast : bool
        Whether a search may ask about single transitions, rather than about many at a time.
    """

    answers_fast: bool

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        """Say which transitions are classified as Reliable, as ``predict`` does, shape (n,)."""

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        """Return the probability that each transition is Reliable, shape (n,).

        It is that of ``predict_proba``; 0 and 1 for an estimator without.
        """

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        """Return :meth:`classify` and :meth:`probability` for the price of one where possible."""


def adapt_estimator(system: System, estimator: Any) -> EstimatorAdapter:
    """Return what asks an estimator about transitions of a system in the quickest right way.

    Parameters
    ----------
    system : System
    estimator : estimator or None
        Anything fitted with ``predict`` and ``classes_``, which are 1 and 0, or "reliable" and
        "unreliable" in any case. None trusts every transition.

    Raises
    ------
    ValueError
        If the estimator lacks a method, has other classes, or was fitted on other features.
    sklearn.exceptions.NotFittedError
        If the estimator is not fitted.
    """
    if estimator is None:
        return _Constant(True)
    classes = _checked_classes(estimator)
    meanings = _meanings(classes)
    columns = _columns(system, estimator)
    if len(classes) == 1:
        return _Constant(meanings[0])
    # Importing scikit-learn's ensembles takes a second, which planning without them need not pay.
    from reliability.fast_inference.compiling import compile_inference

    inference = compile_inference(estimator)
    if inference is None:
        return _Public(system, columns, estimator, classes, meanings.index(True))
    return _Compiled(system, columns, estimator, inference, meanings.index(True))


def _answers_fast(estimator: Any) -> bool:
    """Whether an estimator was made to answer for single transitions.

    Compiled trees answer quickly as well. Yet over 30 problems of the arm they planned no faster
    with OMPL's RRT-Connect, which asks about single transitions, than with the one that asks
    about many at a time: that one asks about 15 to 30 % fewer.
    """
    offers = hasattr(estimator, "fast_decision_function")
    return offers and not getattr(estimator, "prefers_batches", False)


class _Constant:
    """Without an estimator, or with one that knows a single class: always the same answer."""

    answers_fast = True

    def __init__(self, reliable: bool) -> None:
        self._reliable = reliable

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        return np.full(len(reduced), self._reliable)

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        return np.full(len(reduced), float(self._reliable))

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        return self.classify(reduced, next_reduced), self.probability(reduced, next_reduced)


class _Compiled:
    """An estimator that is asked through :func:`reliability.compile_inference`."""

    def __init__(
        self,
        system: System,
        columns: Columns,
        estimator: Any,
        inference: CompiledInference,
        reliable: int,
    ) -> None:
        self._describe = _described_by(system, columns)
        self._source = f"{type(estimator).__name__}, compiled,"
        self._inference = inference
        self._reliable = reliable
        self.answers_fast = _answers_fast(estimator)

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        return self._is_reliable(self._scores(reduced, next_reduced))

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        scores = self._scores(reduced, next_reduced)
        return self._inference.probability(scores, self._reliable)

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        scores = self._scores(reduced, next_reduced)
        probability = self._inference.probability(scores, self._reliable)
        return self._is_reliable(scores), probability

    def _is_reliable(self, scores: NDArray[Any]) -> NDArray[np.bool_]:
        return self._inference.is_second(scores) == self._reliable

    def _scores(self, reduced: Array, next_reduced: Array) -> NDArray[Any]:
        scores = self._inference.score(self._describe(reduced, next_reduced))
        check_numbers(scores, self._source)
        return scores


class _Public:
    """An estimator that is asked through ``predict`` and ``predict_proba``."""

    answers_fast = False

    def __init__(
        self,
        system: System,
        columns: Columns,
        estimator: Any,
        classes: list[Any],
        reliable: int,
    ) -> None:
        self._system = system
        self._columns = columns
        self._predict = estimator.predict
        self._predict_proba = getattr(estimator, "predict_proba", None)
        self._name = type(estimator).__name__
        self._classes = classes
        self._reliable = reliable

    def classify(self, reduced: Array, next_reduced: Array) -> NDArray[np.bool_]:
        return self._classify_rows(self._rows(reduced, next_reduced))

    def probability(self, reduced: Array, next_reduced: Array) -> Array:
        return self._probability_of_rows(self._rows(reduced, next_reduced))

    def evaluate(self, reduced: Array, next_reduced: Array) -> tuple[NDArray[np.bool_], Array]:
        rows = self._rows(reduced, next_reduced)
        return self._classify_rows(rows), self._probability_of_rows(rows)

    def _classify_rows(self, rows: Any) -> NDArray[np.bool_]:
        if len(rows) == 0:
            return np.zeros(0, dtype=np.bool_)
        label = self._classes[self._reliable]
        return is_label(
            self._predict(rows), label, self._classes, len(rows), f"{self._name}.predict"
        )

    def _probability_of_rows(self, rows: Any) -> Array:
        if self._predict_proba is None or len(rows) == 0:
            return self._classify_rows(rows).astype(np.float64)
        return column_of_probabilities(
            self._predict_proba(rows),
            self._reliable,
            len(self._classes),
            len(rows),
            f"{self._name}.predict_proba",
        )

    def _rows(self, reduced: Array, next_reduced: Array) -> Any:
        return self._columns.of(self._system.features(reduced, next_reduced))


def _checked_classes(estimator: Any) -> list[Any]:
    if not hasattr(estimator, "predict"):
        raise ValueError(f"estimator must have the method predict, got {estimator!r}.")
    if hasattr(estimator, "fit"):
        check_is_fitted(estimator)
    if not hasattr(estimator, "classes_"):
        raise ValueError(f"estimator must be a fitted classifier with classes_, got {estimator!r}.")
    return np.asarray(estimator.classes_, dtype=object).tolist()


def _meanings(classes: list[Any]) -> list[bool]:
    """Say for each class whether it is Reliable."""
    meanings = [_means_reliable(label) for label in classes]
    if None in meanings or not classes or len(set(meanings)) != len(classes):
        raise ValueError(
            f"estimator must have the classes {RELIABLE} (Reliable) and {UNRELIABLE} (Unreliable), "
            f'or "reliable" and "unreliable", got {classes}.'
        )
    return [meaning is True for meaning in meanings]


def _means_reliable(label: Any) -> bool | None:
    if isinstance(label, str):
        return _NAMES.get(label.lower())
    if not isinstance(label, Hashable):
        return None
    return _NUMBERS.get(label)


def _columns(system: System, estimator: Any) -> Columns:
    """Return which of the system's features the estimator is to be asked with."""
    state = np.zeros((1, system.reduced_dim))
    n_features = system.features(state, state).shape[1]
    names = feature_names(system, n_features)
    return columns_to_ask(estimator, names, n_features, type(system).__name__)


def _described_by(system: System, columns: Columns) -> Callable[[Array, Array], NDArray[Any]]:
    """Return what describes transitions in these columns, at no cost where they are all."""
    if columns.order is None:
        return system.features
    return lambda reduced, following: columns.select(system.features(reduced, following))
