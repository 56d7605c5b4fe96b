"""Choosing how a fitted classifier, with what is wrapped around it, is compiled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import (
    ExtraTreesClassifier,
    HistGradientBoostingClassifier,
    RandomForestClassifier,
)
from sklearn.frozen import FrozenEstimator
from sklearn.model_selection import (
    FixedThresholdClassifier,
    GridSearchCV,
    RandomizedSearchCV,
    TunedThresholdClassifierCV,
)
from sklearn.pipeline import Pipeline
from sklearn.tree import DecisionTreeClassifier, ExtraTreeClassifier

from reliability.answer_checks import one_per_row
from reliability.classifier import TransitionReliabilityClassifier
from reliability.fast_inference.compiled_inference import CompiledInference, Scores, from_decisions
from reliability.fast_inference.scaling import SCALERS, Transform, compile_scaler
from reliability.fast_inference.trees import compile_boosting, compile_forest
from reliability.fast_inference.wrappers import calibrated, compile_calibrator, with_threshold

# A subclass that has its own of these gives answers of its own.
_ANSWERING = ("predict", "predict_proba", "decision_function", "_raw_predict")
_FAST = "fast_decision_function"


def compile_inference(estimator: Any) -> CompiledInference | None:
    """Compile a fitted classifier of two classes, so that a few rows cost microseconds.

    Knows scikit-learn's decision trees, random forests, ``ExtraTreesClassifier`` and
    ``HistGradientBoostingClassifier``; estimators with a method ``fast_decision_function``, such
    as :class:`reliability.TransitionReliabilityClassifier`; and these inside a pipeline of
    scalers, a search over parameters, a threshold, a calibration or a ``FrozenEstimator``. The
    answers are those of the estimator's own methods.

    Planners call this for the estimators that they are given.

    Parameters
    ----------
    estimator : object
        Of which the present state is compiled: what is fitted again must be compiled again.

    Returns
    -------
    inference : CompiledInference or None
        None for all other estimators, and for those that are not fitted, or have other than two
        classes, several outputs or categorical features.

    Raises
    ------
    ValueError
        If the trees of a model are damaged.

    Examples
    --------
    >>> import numpy as np
    >>> from reliability import compile_inference
    >>> from sklearn.ensemble import RandomForestClassifier
    >>> X = np.random.default_rng(0).normal(size=(400, 3))
    >>> forest = RandomForestClassifier(10, random_state=0).fit(X, X[:, 0] > 0)
    >>> inference = compile_inference(forest)
    >>> scores = inference.score(np.array([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]]))
    >>> inference.is_second(scores), inference.probability(scores, 1)
    (array([ True, False]), array([1., 0.]))
    """
    if not _has_two_classes(estimator):
        return None
    if isinstance(estimator, HistGradientBoostingClassifier):
        inherits = _inherits_answers(estimator, HistGradientBoostingClassifier)
        return compile_boosting(estimator) if inherits else None
    rule = _RULES.get(type(estimator))
    if rule is not None:
        return rule(estimator)
    return _compile_fast(estimator) if _offers_fast(estimator) else None


def _has_two_classes(estimator: Any) -> bool:
    classes = getattr(estimator, "classes_", None)
    return classes is not None and len(classes) == 2 and np.ndim(classes) == 1


def _inherits_answers(estimator: Any, base: type) -> bool:
    return all(
        getattr(type(estimator), name, None) is getattr(base, name, None) for name in _ANSWERING
    )


def _offers_fast(estimator: Any) -> bool:
    """Whether there is a fast method, as derived as the public ones that it stands for."""
    if not hasattr(estimator, _FAST):
        return False
    for parent in type(estimator).__mro__:
        if _FAST in vars(parent):
            return True
        if any(name in vars(parent) for name in _ANSWERING):
            return False
    return True


def _compile_fast(estimator: Any) -> CompiledInference:
    ask, source = getattr(estimator, _FAST), f"{type(estimator).__name__}.{_FAST}"

    def score(rows: NDArray[Any]) -> Scores:
        return one_per_row(ask(rows), len(rows), source) if len(rows) else np.zeros(0)

    return from_decisions(score, type(estimator) is TransitionReliabilityClassifier)


def _compile_search(search: Any) -> CompiledInference | None:
    return compile_inference(search.best_estimator_)


def _compile_frozen(frozen: Any) -> CompiledInference | None:
    return compile_inference(frozen.estimator)


def _compile_pipeline(pipeline: Any) -> CompiledInference | None:
    steps = [step for _, step in pipeline.steps[:-1] if step is not None and step != "passthrough"]
    # scikit-learn calls a pipeline fitted if its last step is.
    if not all(type(step) in SCALERS and hasattr(step, "n_features_in_") for step in steps):
        return None
    transforms = [compile_scaler(step) for step in steps]
    final = compile_inference(pipeline.steps[-1][1])
    if final is None or None in transforms:
        return None
    return replace(final, score=_after([t for t in transforms if t], final.score))


def _after(
    transforms: list[Transform], score: Callable[[NDArray[Any]], Scores]
) -> Callable[[NDArray[Any]], Scores]:
    def score_transformed(rows: NDArray[Any]) -> Scores:
        for transform in transforms:
            rows = transform(rows)
        return score(rows)

    return score_transformed


def _compile_fixed_threshold(wrapper: Any) -> CompiledInference | None:
    inner = getattr(wrapper, "estimator_", wrapper.estimator)
    return _compile_threshold(wrapper, inner, wrapper.threshold, wrapper.pos_label)


def _compile_tuned_threshold(wrapper: Any) -> CompiledInference | None:
    label = wrapper._curve_scorer._get_pos_label()
    return _compile_threshold(wrapper, wrapper.estimator_, wrapper.best_threshold_, label)


def _compile_threshold(
    wrapper: Any, estimator: Any, threshold: Any, positive_label: Any
) -> CompiledInference | None:
    inner = compile_inference(estimator)
    positive = 1
    if positive_label is not None:
        found = np.flatnonzero(np.asarray(wrapper.classes_) == positive_label)
        if len(found) != 1:
            return None
        positive = int(found[0])
    if inner is None or not inner.scores_are_public:
        return None
    return with_threshold(inner, wrapper.response_method, threshold, positive)


def _compile_calibration(wrapper: Any) -> CompiledInference | None:
    members = []
    for part in wrapper.calibrated_classifiers_:
        inner = compile_inference(part.estimator)
        calibrator = compile_calibrator(part.calibrators[0], part.method)
        if inner is None or not inner.scores_are_public or calibrator is None:
            return None
        members.append((inner, calibrator))
    return calibrated(members)


_RULES: dict[type, Callable[[Any], CompiledInference | None]] = {
    DecisionTreeClassifier: compile_forest,
    ExtraTreeClassifier: compile_forest,
    RandomForestClassifier: compile_forest,
    ExtraTreesClassifier: compile_forest,
    GridSearchCV: _compile_search,
    RandomizedSearchCV: _compile_search,
    FrozenEstimator: _compile_frozen,
    Pipeline: _compile_pipeline,
    FixedThresholdClassifier: _compile_fixed_threshold,
    TunedThresholdClassifierCV: _compile_tuned_threshold,
    CalibratedClassifierCV: _compile_calibration,
}
