"""What a summary says of transitions whose labels are known."""

import matplotlib as mpl
import numpy as np
import pytest

from reliability import RELIABLE, UNRELIABLE, Summary, Transitions

mpl.use("Agg")


def transitions_with(labels_per_plan):
    labels = np.concatenate(labels_per_plan)
    sizes = [len(labels) for labels in labels_per_plan]
    states = np.arange(len(labels), dtype=float)[:, None]
    return Transitions(
        reduced=states,
        command=np.ones((len(labels), 1)),
        next_reduced=states + 1,
        y=labels,
        plan=np.repeat(3 * np.arange(len(sizes)), sizes),
        step=np.concatenate([np.arange(size) for size in sizes]),
    )


def test_it_counts_what_is_there():
    good, bad = RELIABLE, UNRELIABLE
    summary = Summary.of(
        transitions_with([[good, good, bad, bad], [good] * 6, [good, bad, good, bad], [bad, bad]])
    )
    assert (summary.n_transitions, summary.n_plans) == (16, 4)
    assert summary.unreliable_share == pytest.approx(6 / 16)
    assert summary.divergence_onset_share == pytest.approx(4 / 6)
    assert summary.reliable_plan_share == pytest.approx(1 / 4)
    np.testing.assert_array_equal(summary.transitions_per_plan, [4, 6, 4, 2])
    np.testing.assert_array_equal(summary.reliable_before_divergence, [2, 1, 0])
    assert "16 transitions of 4 plans" in str(summary)
    assert "37.5% are Unreliable" in str(summary)


def test_without_mistakes_there_is_no_first_one():
    summary = Summary.of(transitions_with([[RELIABLE] * 3]))
    assert np.isnan(summary.divergence_onset_share)
    assert summary.reliable_plan_share == 1.0
    assert "nan" not in str(summary)
    assert len(summary.reliable_before_divergence) == 0


def test_it_draws_every_plan():
    summary = Summary.of(transitions_with([[RELIABLE] * 3, [RELIABLE, UNRELIABLE]]))
    lengths, mistakes = summary.plot()
    assert sum(bar.get_height() for bar in lengths.patches) == 2
    assert sum(bar.get_height() for bar in mistakes.patches) == 1
