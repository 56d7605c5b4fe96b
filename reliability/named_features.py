"""Features by name: tables of them, and which of them an estimator was fitted on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reliability.listing import listed


@dataclass(frozen=True)
class Columns:
    """The features that an estimator is given, and how.

    Attributes
    ----------
    order : tuple of int or None
        Which columns, in the estimator's order; None for all of them as they are.
    names : sequence of str or None
        What the estimator knows them by, which gets tables then; None for arrays.
    """

    order: tuple[int, ...] | None = None
    names: Sequence[str] | None = None

    def select(self, X: NDArray[Any]) -> NDArray[Any]:
        """Return the columns, as an array."""
        return X if self.order is None else X[:, self.order]

    def of(self, X: NDArray[Any]) -> Any:
        """Return what the estimator is to be given: a table if it knows the columns by name."""
        rows = self.select(X)
        if self.names is None or not _has_pandas():
            return rows
        return as_table(rows, self.names)


def as_table(X: NDArray[Any], names: Sequence[str]) -> Any:
    """Return features as a pandas DataFrame.

    Raises
    ------
    ImportError
        If pandas is not installed.
    """
    try:
        from pandas import DataFrame
    except ImportError as error:
        raise ImportError("Tables of features are pandas DataFrames: install pandas.") from error
    return DataFrame(X, columns=list(names))


def columns_to_ask(
    estimator: Any, names: Sequence[str] | None, n_features: int, whose: str = "system"
) -> Columns:
    """Return the columns that a fitted estimator is to be asked with.

    If it was fitted on a table, it gets the columns of these names, wherever they stand. If it
    has names of its own for all of them, or the system says none, it gets all columns in the
    system's order.

    Parameters
    ----------
    estimator : estimator
    names : sequence of str or None
        Of the system's features.
    n_features : int
        The system's.
    whose : str, default="system"
        Names the system in messages.

    Raises
    ------
    ValueError
        If some of the names are missing, or the number of features is another.
    """
    fitted = getattr(estimator, "feature_names_in_", None)
    if fitted is not None and names is not None and set(fitted) & set(names):
        missing = [name for name in fitted if name not in set(names)]
        if missing:
            raise ValueError(
                f"estimator was fitted on features that {whose} does not have: {listed(missing)}. "
                "Fit it on transitions of this system."
            )
        order = tuple(map(list(names).index, fitted))
        return Columns(None if order == tuple(range(n_features)) else order, fitted)
    expected = getattr(estimator, "n_features_in_", n_features)
    if expected != n_features:
        by_name = "" if fitted is None else f" ({listed(fitted)})"
        remedy = "fit it on transitions of this system."
        if fitted is not None and names is None:
            remedy = (
                "say what these are called, in the system's feature_names_out, so that those that "
                f"the estimator knows can be found, or {remedy}"
            )
        raise ValueError(
            f"estimator was fitted on {expected} features{by_name}, and {whose} gives "
            f"{n_features}; {remedy}"
        )
    return Columns(None, fitted)


def columns_to_fit(estimator: Any, names: Sequence[str] | None) -> Columns:
    """Return the columns to fit an estimator on: by name if a part of it selects them so.

    Raises
    ------
    ValueError
        If it selects by name, and there are no names.
    """
    if not _selects_by_name(estimator):
        return Columns()
    if names is None:
        raise ValueError(
            "estimator selects features by name (ColumnTransformer), and system does not say what "
            "they are called: give it feature_names_out."
        )
    return Columns(None, names)


def _selects_by_name(estimator: Any) -> bool:
    # Importing it takes a second, which collecting transitions need not pay.
    from sklearn.compose import ColumnTransformer

    parts = [estimator, *estimator.get_params(deep=True).values()]
    return any(
        isinstance(part, ColumnTransformer)
        and any(_is_by_name(columns) for _, _, columns in part.transformers)
        for part in parts
    )


def _is_by_name(columns: Any) -> bool:
    if isinstance(columns, slice):
        columns = [columns.start, columns.stop]
    # make_column_selector and its like look at the columns of a table.
    return callable(columns) or any(isinstance(one, str) for one in np.ravel(columns).tolist())


def _has_pandas() -> bool:
    try:
        import pandas  # noqa: F401
    except ImportError:
        return False
    return True
