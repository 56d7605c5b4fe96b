"""Gradient boosting that can be asked for quick answers outside of planners as well."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier
from sklearn.utils.metaestimators import available_if

from reliability.documentation_link import DocumentationLink
from reliability.fast_inference.compiling import compile_inference


def _can_be_compiled(classifier: FastHistGradientBoostingClassifier) -> bool:
    return compile_inference(classifier) is not None


class FastHistGradientBoostingClassifier(DocumentationLink, HistGradientBoostingClassifier):
    """scikit-learn's ``HistGradientBoostingClassifier`` and a method for a few rows at a time.

    Parameters, attributes and all answers are scikit-learn's. Planners compile
    ``HistGradientBoostingClassifier`` itself, and ask it as quickly as this class.
    """

    @available_if(_can_be_compiled)
    def fast_decision_function(self, X: NDArray[Any]) -> NDArray[np.float64]:
        """Return ``decision_function`` of rows in a few microseconds each.

        There is no such method before fitting, for more than two classes or for categorical
        features.

        Parameters
        ----------
        X : ndarray of shape (n, n_features)
            NaN where a value is missing.

        Returns
        -------
        decision : ndarray of shape (n,)
            Positive where ``classes_[1]`` is predicted.
        """
        inference = compile_inference(self)
        if inference is None:
            raise AttributeError("There is no fast_decision_function for this model.")
        return inference.score(X)
