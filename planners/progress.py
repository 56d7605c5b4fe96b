"""What a planner with ``verbose`` shows of a search that may take minutes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tqdm.auto import tqdm

from planners.check_transition import CheckTransition
from planners.path import Path
from planners.result import PlanResult
from systems.messages import tell


class Progress:
    """A bar that counts the samples of a search, and a line about what came of it.

    Parameters
    ----------
    planner : str
        The planner's name.
    shown : bool
        Whether to show anything.
    """

    def __init__(self, planner: str, shown: bool) -> None:
        self._planner = planner
        self._shown = shown
        self._n_samples = 0
        self._bar: Any = None
        self._check: CheckTransition | None = None

    def advance(self, n_samples: int) -> None:
        """Count samples that the search has begun to grow towards."""
        self._n_samples += n_samples
        if self._bar is not None:
            self._bar.set_postfix_str(_counted(self._check), refresh=False)
            self._bar.update(n_samples)

    @contextmanager
    def searching(self, check: CheckTransition, max_iterations: int) -> Iterator[None]:
        """Show the bar."""
        if not self._shown:
            yield
            return
        self._check = check
        with tqdm(total=max_iterations, desc=self._planner, unit="sample", leave=False) as bar:
            self._bar = bar
            yield
        self._bar = None

    def searched(self, path: Path | None, check: CheckTransition, seconds: float) -> None:
        """Tell what the search found, before shortcuts are tried."""
        if self._shown:
            found = "no path" if path is None else f"a path of {len(path.commands)} transitions"
            tell(
                f"{self._planner}: {found} after {self._n_samples:,} samples and {seconds:.1f} s; "
                f"{_counted(check)}."
            )

    def planned(self, plan: PlanResult) -> None:
        """Tell what has become of the path."""
        if self._shown and plan.solved:
            trust = (
                ""
                if plan.reliability is None
                else f", success_probability {plan.success_probability:.2f}"
            )
            tell(
                f"{self._planner}: a plan of {len(plan.commands)} transitions after "
                f"{plan.simplification_time:.1f} s more{trust}."
            )


def _counted(check: CheckTransition | None) -> str:
    if check is None:
        return ""
    return f"{check.n_checked:,} transitions checked, {check.n_rejected:,} rejected"
