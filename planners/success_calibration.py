"""How likely a whole plan is to go well, learned from plans that were executed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import binom, binomtest
from sklearn.base import BaseEstimator
from sklearn.linear_model import LogisticRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.validation import check_is_fitted

from planners.check_transition import negative_log_likelihood
from planners.result import PlanResult
from reliability.documentation_link import DocumentationLink
from systems.system import Array
from systems.validation import as_numbers, check_number

# Thresholds that min_success_for may return lie between this many equal parts of the plans.
N_PARTS = 20
# Costs enter by their logarithms: a doubt of one in a thousand tells something that one in ten
# thousand does not, and a few transitions of probability 0 can't outweigh all else. Below this
# cost, differences tell nothing.
LEAST_COST = 1e-4
# Enough for plans of any robustness; with robust plans only, there is nothing to be repeated.
N_EXPECTATIONS = 20


class SuccessCalibration(DocumentationLink, BaseEstimator):
    """Turns the reliabilities of a plan's transitions into the probability that the plan goes well.

    The product of the reliabilities is that probability only if transitions fail independently of
    one another and the estimator's probabilities are right; it is mostly far too low. The
    calibration learns from executed plans how often plans like this one went well: logistic
    regression on the number of the plan's transitions, on the logarithms of three negative
    log-likelihoods, and on the plan's ``turning``. The likelihoods are that of the plan (the sum of
    -log(reliability) of its transitions), that of its least reliable transition, and that of its
    last. The last counts by itself because with labels after Eq. 3 it is Reliable if the execution
    is where the plan ends. Turning counts because estimators are asked about single transitions,
    and can't know of what lasts from one to the next.

    What it learns is how often a plan goes well if the true system goes the way that g predicts. A
    plan with a ``robustness`` does so only with that probability, by which the learned one is
    multiplied.

    Fit it on plans made by the planner that will use it (with the same estimator, the same k and so
    on), for problems that the estimator has not learned from. A hundred plans are few.

    Attributes
    ----------
    classes_ : ndarray of shape (2,)
        False and True: the plan failed, the plan succeeded.
    model_ : sklearn.pipeline.Pipeline
        What was fitted.
    levels_ : ndarray of shape (n_levels,)
        Thresholds that :meth:`min_success_for` tries, the strictest first; the last is 0.
    level_shares_, level_success_ : ndarray of shape (n_levels,)
        Of the plans fitted on, the share that is at least as likely as each level, and the mean
        probability of these.

    References
    ----------
    Platt 1999. Dempster, Laird and Rubin 1977, for expectation maximisation.

    Examples
    --------
    >>> import numpy as np
    >>> from planners import BiasedRRTConnect, SuccessCalibration
    >>> from sklearn.linear_model import LogisticRegression
    >>> from systems import PlanarArm
    >>> arm = PlanarArm()
    >>> X = arm.features(*np.random.default_rng(0).uniform(-0.1, 0.1, (2, 40, 3)))
    >>> planner = BiasedRRTConnect(arm, LogisticRegression().fit(X, X[:, 0] > 0), accuracy=0.9)
    >>> plans = [
    ...     planner.set_params(random_state=i).plan([-1.5, 0.0, 0.0], [1.5, 0.0, 0.0])
    ...     for i in range(4)
    ... ]
    >>> calibration = SuccessCalibration().fit(plans, [True, False, True, True])
    >>> calibration.predict_proba(plans).shape
    (4, 2)
    >>> careful = planner.set_params(calibration=calibration, min_success=0.9, restarts=5)
    """

    def fit(self, results: Sequence[PlanResult], succeeded: ArrayLike) -> Self:
        """Learn from executed plans.

        Parameters
        ----------
        results : sequence of PlanResult
            Plans, distrusted ones among them or not; results without a plan have to be left out.
        succeeded : array-like of bool of shape (n_plans,)
            Whether each plan's execution reached the goal.

        Returns
        -------
        self : SuccessCalibration

        Raises
        ------
        ValueError
            If there are no plans, a result has no plan or no reliability, the arguments don't go
            together, or all plans succeeded or all failed.
        """
        y = _checked_outcomes(results, succeeded)
        if y.all() or not y.any():
            raise ValueError(
                "succeeded must hold both plans that succeeded and plans that failed, got "
                f"{len(y)} plans of which {'all' if y.all() else 'none'} did. Execute more plans, "
                "or harder ones."
            )
        self.classes_ = np.array([False, True])
        self.model_ = make_pipeline(StandardScaler(), LogisticRegression())
        self._fit_model(_features(results), y, _robustness(results))
        self._keep_levels(self._probability(results))
        return self

    def predict_proba(self, results: Sequence[PlanResult]) -> Array:
        """Return the probabilities that plans fail and that they succeed.

        Parameters
        ----------
        results : sequence of PlanResult
            A result without a plan fails for certain.

        Returns
        -------
        probability : ndarray of shape (n_results, 2)
            The second column is that of success.

        Raises
        ------
        ValueError
            If a plan has no reliability, as without an estimator.
        sklearn.exceptions.NotFittedError
        """
        check_is_fitted(self)
        _check_results(results)
        solved = np.array([result.solved for result in results], dtype=bool)
        success = np.zeros(len(results))
        if solved.any():
            success[solved] = self._probability([plan for plan in results if plan.solved])
        return np.column_stack([1 - success, success])

    def min_success_for(
        self,
        results: Sequence[PlanResult],
        succeeded: ArrayLike,
        share: float = 0.9,
        *,
        confidence: float = 0.95,
    ) -> float:
        """Return the smallest ``min_success`` at which enough of the accepted plans succeed.

        Fixed-sequence testing: thresholds are tested one after another, each less strict than the
        one before, until it is no longer significant (exact binomial test at the level
        1 - confidence) that more than ``share`` of the plans that pass succeed. The last that was
        is returned. Which thresholds there are and where the sequence begins follows from the
        plans that were fitted on and from the number of new ones, so that testing many costs no
        confidence: at most 1 - confidence of all calls return a threshold whose plans succeed less
        often.

        The guarantee is for plans that come about as these did: same system, same kind of
        problems, same planner parameters. For a planner with ``restarts``, give plans that were
        made with them.

        Parameters
        ----------
        results : sequence of PlanResult
            Executed plans that :meth:`fit` has not seen, all of them independent.
        succeeded : array-like of bool of shape (n_plans,)
        share : float, default=0.9
            Between 0 and 1, both excluded.
        confidence : float, default=0.95
            Between 0 and 1, both excluded.

        Returns
        -------
        min_success : float
            For the planner's ``min_success``; 0 if all plans may be accepted.

        Raises
        ------
        ValueError
            If the arguments are unfit, or if no threshold can be guaranteed from these plans.
        sklearn.exceptions.NotFittedError

        References
        ----------
        Angelopoulos et al. 2021, "Learn then Test", Section 4.
        """
        check_is_fitted(self)
        _check_between_0_and_1(share, "share")
        _check_between_0_and_1(confidence, "confidence")
        share, confidence = float(share), float(confidence)
        y = _checked_outcomes(results, succeeded)
        probability = self.predict_proba(results)[:, 1]
        levels = self.levels_[self._first_level(len(y), share, confidence) :]
        passed = [
            _is_more_often(y[probability >= level], share, 1 - confidence) for level in levels
        ]
        n_passed = int(np.argmin([*passed, False]))
        if n_passed == 0:
            accepted = y[probability >= levels[0]]
            raise ValueError(
                f"No min_success can be guaranteed: of the {len(accepted)} plans that are the "
                f"likeliest to succeed (at least {levels[0]:.3f}), {accepted.sum()} did, too few "
                f"to be sure of a share of {share} at the confidence {confidence}. Execute more "
                "plans, ask for a smaller share, or improve the estimator."
            )
        return float(levels[n_passed - 1])

    def _fit_model(self, X: Array, y: NDArray[np.bool_], robustness: Array) -> None:
        """Learn what becomes of plans that go as predicted, if it is not known which ones do.

        Expectation maximisation: of a plan that failed, the part counts that went as predicted and
        failed all the same.
        """
        weight = np.ones(len(y))
        for _ in range(N_EXPECTATIONS if (robustness < 1).any() else 1):
            self.model_.fit(X, y, logisticregression__sample_weight=weight)
            success = self.model_.predict_proba(X)[:, 1]
            weight = np.where(y, 1, robustness * (1 - success) / (1 - robustness * success))

    def _probability(self, results: Sequence[PlanResult]) -> Array:
        as_predicted = self.model_.predict_proba(_features(results))[:, 1]
        return np.asarray(as_predicted * _robustness(results))

    def _keep_levels(self, probability: Array) -> None:
        quantiles = np.quantile(probability, np.arange(1, N_PARTS) / N_PARTS)
        # Rounded down, so that a plan is on the same side of a level whatever it is computed with.
        levels = np.unique(np.append(0, np.floor(quantiles * 1000) / 1000))[::-1]
        accepted = [probability[probability >= level] for level in levels]
        self.levels_ = levels
        self.level_shares_ = np.array([len(part) / len(probability) for part in accepted])
        self.level_success_ = np.array([part.mean() for part in accepted])

    def _first_level(self, n_plans: int, share: float, confidence: float) -> int:
        """Return the level whose test is the likeliest to be passed, knowing no new plan."""
        n_accepted = np.maximum(1, np.round(n_plans * self.level_shares_))
        enough = binom.isf(1 - confidence, n_accepted, share)
        return int(np.argmax(binom.sf(enough, n_accepted, self.level_success_)))


def _features(results: Sequence[PlanResult]) -> Array:
    """Describe plans by what their success depends on, shape (n, 5)."""
    rows = []
    for result in results:
        assert result.reliability is not None
        costs = negative_log_likelihood(result.reliability)
        total, worst, last = np.log(
            LEAST_COST + np.array([costs.sum(), costs.max(initial=0.0), costs[-1:].sum()])
        )
        rows.append([total, len(costs), worst, last, result.turning])
    return np.array(rows)


def _robustness(results: Sequence[PlanResult]) -> Array:
    known = (result.robustness for result in results)
    return np.array([1.0 if share is None else share for share in known])


def _checked_outcomes(results: Sequence[PlanResult], succeeded: ArrayLike) -> NDArray[np.bool_]:
    _check_results(results)
    y = as_numbers(succeeded, "succeeded")
    if len(results) == 0:
        raise ValueError("results must hold at least one plan, got none.")
    if y.shape != (len(results),) or not np.isin(y, [0, 1]).all():
        raise ValueError(
            f"succeeded must hold True or False for each of {len(results)} results, "
            f"got {succeeded!r}."
        )
    for number, result in enumerate(results):
        if not result.solved:
            raise ValueError(
                f"results must hold plans, and results[{number}] is none ({result.status.name}). "
                "Leave out what was not executed."
            )
    return y.astype(bool)


def _check_results(results: Sequence[PlanResult]) -> None:
    if not isinstance(results, Sequence) or not all(isinstance(r, PlanResult) for r in results):
        raise ValueError(f"results must be a sequence of PlanResult, got {results!r}.")
    for number, result in enumerate(results):
        if result.solved and result.reliability is None:
            raise ValueError(
                f"results must have a reliability, and results[{number}] has none, since it was "
                "planned without an estimator."
            )


def _is_more_often(outcomes: NDArray[np.bool_], share: float, level: float) -> bool:
    """Say whether successes are significantly more often than a share."""
    if len(outcomes) == 0:
        return False
    test = binomtest(int(outcomes.sum()), len(outcomes), share, alternative="greater")
    return bool(test.pvalue <= level)


def _check_between_0_and_1(value: float, name: str) -> None:
    check_number(value, name, 0, 1)
    if value in (0, 1):
        raise ValueError(f"{name} must be between 0 and 1, both excluded, got {value!r}.")
