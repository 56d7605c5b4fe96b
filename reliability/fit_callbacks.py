"""Scikit-learn's callbacks, which are told how far a ``fit`` has come; from version 1.9 on."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any

try:
    from sklearn.callback import CallbackSupportMixin, with_callbacks
except ImportError:  # scikit-learn before 1.9

    class CallbackSupportMixin:  # type: ignore[no-redef]
        """Stands for what this version of scikit-learn does not have."""

    def with_callbacks(method: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return the method as it is."""
        return method


__all__ = ["CallbackSupportMixin", "FitTasks"]


@with_callbacks
def _tear_down(estimator: Any) -> None:
    """Do nothing, after which scikit-learn lets the estimator's callbacks clean up."""


class FitTasks:
    """Tells an estimator's callbacks of its ``fit``, and of each epoch in it.

    Without callbacks it does nothing.

    Parameters
    ----------
    estimator : estimator
        One with ``set_callbacks``.
    max_epochs : int
    X, y : ndarray
        As they were given to ``fit``, checked.
    metadata : dict
        What else was given to ``fit``.
    """

    def __init__(
        self, estimator: Any, max_epochs: int, X: Any, y: Any, metadata: dict[str, Any]
    ) -> None:
        self.any = bool(getattr(estimator, "_skl_callbacks", None))
        self._estimator = estimator
        self._max_epochs = max_epochs
        self._told = {"estimator": estimator, "X": X, "y": y, "metadata": metadata}
        self._fit: Any = None
        self._epoch: Any = None

    def __enter__(self) -> FitTasks:
        """Tell that ``fit`` begins."""
        if self.any:
            self._fit = self._estimator._init_callback_context(max_subtasks=self._max_epochs)
            self._fit.call_on_fit_task_begin(**self._told)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Tell that ``fit`` is done, unless it failed, and let callbacks clean up in any case."""
        if not self.any:
            return
        try:
            if error is None:
                self._fit.call_on_fit_task_end(**self._told, reconstruction_attributes={})
        finally:
            _tear_down(self._estimator)

    def begin_epoch(self) -> None:
        """Tell that an epoch begins."""
        self._epoch = self._fit.subcontext(task_name="epoch")
        self._epoch.call_on_fit_task_begin(**self._told)

    def end_epoch(self, inference: Callable[[], Any]) -> bool:
        """Tell that an epoch is done, and return whether a callback asks to stop.

        Parameters
        ----------
        inference : callable
            Returns what computes logits with the weights of now; only called if a callback asks
            for the fitted estimator.
        """
        return bool(
            self._epoch.call_on_fit_task_end(
                **self._told, reconstruction_attributes=lambda: {"_inference": inference()}
            )
        )
