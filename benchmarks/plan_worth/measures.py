"""How well probabilities of success tell what becomes of plans."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.metrics import roc_auc_score

from benchmarks.calibration_error import calibration_error
from benchmarks.plan_worth.executed_plans import Outcome
from planners import Share, SuccessCalibration

N_SIMULATIONS = 1000
# Shares of accepted plans that are to succeed.
PROMISES = (0.8, 0.9)


def error_of_the_truth(probability: np.ndarray) -> np.ndarray:
    """Return the errors that chance alone would give if the probabilities were the true ones."""
    rng = np.random.default_rng(0)
    draws = rng.random((N_SIMULATIONS, len(probability))) < probability
    return np.array([calibration_error(probability, draw) for draw in draws])


@dataclass(frozen=True, eq=False)
class Worth:
    """What probabilities were worth on unseen plans.

    Attributes
    ----------
    probability, product : ndarray of shape (n_plans,)
        Calibrated probability of success of each plan, and without a calibration.
    succeeded : ndarray of bool of shape (n_plans,)
    n_unsolved : int
        Problems without a plan.
    min_success : dict of float to float
        For each promised share that could be guaranteed.
    """

    probability: np.ndarray
    product: np.ndarray
    succeeded: np.ndarray
    n_unsolved: int
    min_success: dict[float, float]

    @classmethod
    def of(
        cls,
        calibration: SuccessCalibration,
        threshold: Sequence[Outcome],
        unseen: Sequence[Outcome],
    ) -> Worth:
        """Choose a threshold with some executed plans, and measure on others."""
        solved = [outcome for outcome in unseen if outcome.plan.solved]
        plans = [outcome.plan for outcome in solved]
        min_success = {}
        for share in PROMISES:
            with contextlib.suppress(ValueError):
                min_success[share] = calibration.min_success_for(*split(threshold), share=share)
        return cls(
            calibration.predict_proba(plans)[:, 1],
            np.array([plan.reliability_product for plan in plans]),
            np.array([outcome.succeeded for outcome in solved]),
            len(unseen) - len(solved),
            min_success,
        )

    def row(self, name: str) -> str:
        """Return a row of the table whose head is :data:`HEAD`."""
        error = calibration_error(self.probability, self.succeeded)
        by_chance = error_of_the_truth(self.probability)
        cells = [
            name,
            Share.of(int(self.succeeded.sum()), len(self.succeeded)),
            self.n_unsolved,
            f"{calibration_error(self.product, self.succeeded):.3f}",
            f"{error:.3f}",
            f"{by_chance.mean():.3f}, {np.quantile(by_chance, 0.95):.3f}",
            f"{roc_auc_score(self.succeeded, self.product):.3f}",
            f"{roc_auc_score(self.succeeded, self.probability):.3f}",
            *(self._accepted(share) for share in PROMISES),
        ]
        return "| " + " | ".join(map(str, cells)) + " |"

    def _accepted(self, share: float) -> str:
        if share not in self.min_success:
            return "none"
        accepted = self.succeeded[self.probability >= self.min_success[share]]
        return f"{self.min_success[share]:.3f}: {Share.of(int(accepted.sum()), len(accepted))}"


HEAD = (
    "| system | plans that succeed | no plan | ECE of the product | ECE | ECE by chance, mean and "
    "95 % | AUC of the product | AUC | min_success for 80 %, and accepted plans that succeed "
    "| the same for 90 % |\n|---|---|---|---|---|---|---|---|---|---|"
)


def split(outcomes: Sequence[Outcome]) -> tuple[list, list[bool]]:
    """Return the plans there are, and whether they succeeded."""
    solved = [outcome for outcome in outcomes if outcome.plan.solved]
    return [outcome.plan for outcome in solved], [outcome.succeeded for outcome in solved]
