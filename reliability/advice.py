"""What is wrong with labels, features and predictions, in sentences that each have a remedy."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from reliability.base_rate import WEAK_BALANCED_ACCURACY
from reliability.listing import listed

# Figures of so few plans change with every plan.
FEW_PLANS = 20
POOR_RECALL = 0.5
# With a lower recall of Reliable, planners that reject nearly all Unreliable transitions lose many
# good ones.
COSTLY_RECALL = 0.7
POOR_CALIBRATION = 0.1
# More labels of no content than this, and the others are too few to learn from.
_MOSTLY_DIVERGED = 2 / 3
_MOST_WARNINGS = 5


def mostly_diverged(labels: Any) -> bool:
    """Say whether most of the labels of a :class:`Summary` only say that a plan had diverged."""
    return bool(labels.unreliable_share * labels.already_diverged_share > _MOSTLY_DIVERGED)


def label_warnings(labels: Any) -> list[str]:
    """Say what the labels alone show to be wrong, most important first."""
    if labels.base_rate == 1:
        return [_one_label(labels)]
    warnings = []
    if labels.n_plans_of_rarer_label < FEW_PLANS:
        warnings.append(_few_plans(labels))
    if mostly_diverged(labels):
        warnings.append(f"{_already_diverged(labels)}.")
    return warnings


def diagnosis_warnings(diagnosis: Any) -> list[str]:
    """Say what is wrong, most important first: labels, predictions, k, then features."""
    labels = diagnosis.labels
    warnings = []
    if len(diagnosis.constant_features) == len(diagnosis.feature_ranges):
        warnings.append(
            "All features are constant, so that nothing can be told from them: let "
            "system.features describe the state and the motion."
        )
    if labels.base_rate == 1:
        warnings.append(_one_label(labels))
    elif labels.n_plans_of_rarer_label < FEW_PLANS:
        warnings.append(_few_plans(labels))
    if diagnosis.n_folds is not None and labels.base_rate < 1:
        warnings += _about_predictions(diagnosis)
    return [*warnings, *_about_features(diagnosis)][:_MOST_WARNINGS]


def _about_predictions(diagnosis: Any) -> Iterable[str]:
    weak = diagnosis.balanced_accuracy < WEAK_BALANCED_ACCURACY
    if weak and not diagnosis.beats_base_rate:
        yield _at_base_rate(diagnosis)
    else:
        if diagnosis.onset_recall < POOR_RECALL:
            yield _onsets_missed(diagnosis)
        elif weak and diagnosis.reliable_recall >= POOR_RECALL:
            yield _weak(diagnosis)
        yield _which_k(diagnosis)
    if diagnosis.expected_calibration_error > POOR_CALIBRATION:
        yield (
            f"Probabilities are off by {diagnosis.expected_calibration_error:.2f} on average, so "
            "that a plan's probability of success will be, too: wrap the estimator in "
            "scikit-learn's CalibratedClassifierCV, or stop its training earlier."
        )


def _about_features(diagnosis: Any) -> Iterable[str]:
    constant = diagnosis.constant_features
    if 0 < len(constant) < len(diagnosis.feature_ranges):
        yield (
            f"{_columns(diagnosis, constant)} the same value in all transitions: leave out of "
            "system.features what tells nothing, or mend it if it should vary."
        )
    if diagnosis.duplicate_features:
        called = diagnosis.feature_names or range(len(diagnosis.feature_ranges))
        pairs = [
            f"{called[later]} equals {called[first]}"
            for first, later in diagnosis.duplicate_features
        ]
        yield (
            f"Some features are equal in all transitions ({listed(pairs)}): leave one out, or "
            "mend it if they should differ."
        )
    if diagnosis.unscaled_features:
        yield (
            f"{_columns(diagnosis, diagnosis.unscaled_features)} values far from order one, which "
            "a network learns badly from: divide by a typical size in system.features, or put "
            "scikit-learn's StandardScaler before the classifier in a Pipeline."
        )


def _one_label(labels: Any) -> str:
    if labels.unreliable_share == 0:
        return (
            f"All {labels.n_transitions:,} labels are Reliable, so that there is nothing to learn: "
            "collect more plans, or harder problems; if executed plans do go wrong, let "
            "system.close be stricter."
        )
    remedy = "see whether system.close is too strict, or propagate wrong everywhere"
    if labels.executed_share == 0:
        remedy = f"collect with labels='executed', and {remedy}"
    return (
        f"All {labels.n_transitions:,} labels are Unreliable, so that there is nothing to learn: "
        f"{remedy}."
    )


def _few_plans(labels: Any) -> str:
    rarer = "Unreliable" if labels.unreliable_share <= 0.5 else "Reliable"
    n = labels.n_plans_of_rarer_label
    return (
        f"Only {n} of {labels.n_plans} {'plan' if labels.n_plans == 1 else 'plans'} "
        f"{'has' if n == 1 else 'have'} {rarer} transitions, so that all figures are uncertain: "
        "collect more plans."
    )


def _already_diverged(labels: Any) -> str:
    """Return a clause about labels of Eq. 3 that say nothing of their own transition."""
    remedy = (
        "keep transitions[transitions.executed]"
        if labels.executed_share
        else "collect with labels='executed'"
    )
    return (
        f"{labels.already_diverged_share:.0%} of the Unreliable labels follow a divergence, and "
        f"only say that the execution had left the plan before: {remedy}"
    )


def _at_base_rate(diagnosis: Any) -> str:
    labels = diagnosis.labels
    cause = (
        _already_diverged(labels)
        if labels.already_diverged_share >= 0.5
        else f"the features do not tell Reliable from Unreliable transitions: {_better_features()}"
    )
    return (
        f"Accuracy {diagnosis.accuracy:.3f} is no better than the base rate "
        f"{labels.base_rate:.3f}, which one label for every transition reaches; {cause}."
    )


def _weak(diagnosis: Any) -> str:
    told = f"The balanced accuracy is {diagnosis.balanced_accuracy:.2f}, and 0.5 is chance"
    # Where onsets are recognized better than what follows them, that looks Reliable: its labels
    # don't tell what it is like.
    labels_mislead = diagnosis.unreliable_recall < diagnosis.onset_recall
    if labels_mislead and diagnosis.labels.already_diverged_share >= 0.5:
        return f"{told}; {_already_diverged(diagnosis.labels)}."
    return f"{told}: {_better_features()}."


def _onsets_missed(diagnosis: Any) -> str:
    recall = f"Only {diagnosis.onset_recall:.0%} of the transitions at which executions diverge"
    if diagnosis.labels.already_diverged_share >= 0.5:
        return f"{recall} are recognized; {_already_diverged(diagnosis.labels)}."
    return f"{recall} are recognized, and plans go through the others: {_better_features()}."


def _which_k(diagnosis: Any) -> str:
    """Weigh what k lets through against what it costs."""
    kept = diagnosis.reliable_recall
    through = (
        f"k=1 lets {diagnosis.accepted_unreliable(1):.0%} of Unreliable transitions through and "
        f"k=10 {diagnosis.accepted_unreliable(10):.0%}: use k=10"
    )
    if kept >= COSTLY_RECALL:
        return f"{through}, which costs {1 - kept:.0%} of the Reliable ones."
    remedy = (
        "weigh both labels alike (class_weight='balanced', where the estimator has it), or collect "
        "more plans"
        if diagnosis.labels.executed_share
        else "collect with labels='executed'"
    )
    return (
        f"{through}; with a recall of Reliable of {kept:.2f} many transitions are lost, so that "
        f"planners may find no way: {remedy} first."
    )


def _better_features() -> str:
    return (
        "let system.features describe what the reduced model ignores (distances to obstacles, "
        "forces, the motion in the robot's frame: docs/features.md) and system.reduce keep what it "
        "depends on (such as speeds), collect more plans, or try another estimator (boosted trees "
        "or a network)"
    )


def _columns(diagnosis: Any, columns: tuple[int, ...]) -> str:
    called = diagnosis.feature_names or range(len(diagnosis.feature_ranges))
    one, names = len(columns) == 1, [called[column] for column in columns]
    return f"{'Feature' if one else 'Features'} {listed(names)} {'has' if one else 'have'}"
