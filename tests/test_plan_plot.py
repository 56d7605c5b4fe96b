"""The picture of a plan on matplotlib."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from toy_systems import Disc

from planners import BiasedRRTConnect

matplotlib.use("Agg")
import matplotlib.pyplot as plt

DISC = Disc()
START, GOAL = np.array([-0.9, 0.0]), np.array([[0.9, 0.2]])
PLAN = BiasedRRTConnect(DISC, random_state=0).plan(START, GOAL)
RATED = replace(PLAN, reliability=np.linspace(0.2, 0.9, len(PLAN.commands)))
UNSOLVED = BiasedRRTConnect(DISC, max_iterations=3, random_state=0).plan(START, GOAL)


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def test_it_shows_the_plan_the_tree_and_each_reliability():
    tree, reliability = RATED.plot()
    lines = {line.get_label(): line.get_xydata() for line in tree.lines}
    np.testing.assert_allclose(lines["plan"], PLAN.reduced)
    edges = lines["search tree"].reshape(-1, 3, 2)
    np.testing.assert_allclose(edges[:, :2], PLAN.tree)
    assert np.isnan(edges[:, 2]).all()
    np.testing.assert_allclose(tree.collections[0].get_array(), RATED.reliability)
    np.testing.assert_allclose(reliability.collections[0].get_offsets()[:, 1], RATED.reliability)
    assert f"{RATED.success_probability:.2g}" in reliability.get_title()


@pytest.mark.parametrize(("plan", "said"), [(PLAN, "no estimator"), (UNSOLVED, "no plan")])
def test_it_says_what_there_is_not(plan, said):
    tree, reliability = plan.plot()
    assert [text.get_text() for text in reliability.texts] == [said]
    assert tree.get_title() == plan.status.name


def test_it_draws_on_given_axes_and_takes_configurations_of_one_number():
    flat = replace(
        RATED,
        reduced=RATED.reduced[:, :1],
        commands=RATED.commands[:, :1],
        tree=RATED.tree[..., :1],
    )
    _, axes = plt.subplots(1, 2)
    assert flat.plot(axes) is axes
    axes[0].figure.canvas.draw()


@pytest.mark.parametrize("axes", [3, "two", [1, 2]])
def test_what_are_not_two_axes_is_refused(axes):
    with pytest.raises(ValueError, match="axes must be 2 Axes"):
        PLAN.plot(axes)
