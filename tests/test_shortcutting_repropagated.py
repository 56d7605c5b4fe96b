"""Shortcuts where a state is more than a configuration: shorter, consistent, all checked."""

import numpy as np
import pytest
from toy_systems import Odometer

from planners import BiasedRRT
from planners.check_transition import CheckTransition
from planners.path import Path
from planners.planning_problem import PlanningProblem
from planners.shortcutting_repropagated import RepropagatedShortcuts
from systems import Rope

START, GOAL = np.array([-0.9, 0.0, 0.0]), np.array([0.9, 0.0])


class Recorder:
    """Classifies by a rule, and remembers the rows that it called Reliable."""

    classes_ = np.array([0, 1])
    validation_accuracy_ = 1.0

    def __init__(self, rule):
        self.rule = rule
        self.reliable = set()
        self.n_rows = 0

    def predict(self, rows):
        answers = self.rule(rows).astype(int)
        self.reliable |= {row.tobytes() for row, yes in zip(rows, answers, strict=True) if yes}
        self.n_rows += len(rows)
        return answers

    def predict_proba(self, rows):
        """For the plan's report only, and not recorded."""
        reliable = self.rule(rows).astype(float)
        return np.column_stack([1 - reliable, reliable])


def assert_follows_g(system, reduced, commands):
    following, valid = system.propagate(reduced[:-1], commands)
    assert valid.all()
    np.testing.assert_array_equal(following, reduced[1:])


def assert_all_were_called_reliable(system, recorder, result):
    rows = system.features(result.reduced[:-1], result.reduced[1:])
    assert all(row.tobytes() in recorder.reliable for row in rows)


@pytest.mark.parametrize("seed", range(5))
def test_shortcuts_make_plans_shorter_and_propagate_the_rest(seed):
    system = Odometer()
    long, short = (
        BiasedRRT(system, simplify=simplify, random_state=seed).plan(START, GOAL)
        for simplify in (False, True)
    )
    assert_follows_g(system, short.reduced, short.commands)
    np.testing.assert_array_equal(short.reduced[0], START)
    assert system.goal_reached(short.reduced[-1:], GOAL[None])[0]
    assert len(short.commands) <= len(long.commands)
    assert short.reduced[-1, 2] < long.reduced[-1, 2], "the odometer counts the shorter way"
    assert short.reduced[-1, 2] < 2.4


@pytest.mark.parametrize("seed", range(5))
def test_no_transition_of_a_plan_is_unchecked(seed):
    # The odometer's count is a feature, and so every transition after a shortcut differs.
    system = Odometer()
    recorder = Recorder(lambda rows: (rows[:, 1] > -0.6) & (np.floor(1e6 * rows[:, 2]) % 20 != 3))
    planner = BiasedRRT(system, recorder, k=np.inf, random_state=seed)
    result = planner.plan(START, GOAL)
    assert result.success
    assert_all_were_called_reliable(system, recorder, result)
    assert result.n_checked == recorder.n_rows
    assert (result.reduced[:, 1] > -0.7).all()


def test_unreliable_transitions_accepted_by_a_draw_are_not_made_anew():
    system = Odometer()
    recorder = Recorder(lambda rows: rows[:, 0] < 0.0)
    result = BiasedRRT(system, recorder, k=0.5, random_state=0).plan(START, GOAL)
    plain = BiasedRRT(system, recorder, k=0.5, simplify=False, random_state=0).plan(START, GOAL)
    assert result.success
    rows = system.features(result.reduced[:-1], result.reduced[1:])
    searched = system.features(plain.reduced[:-1], plain.reduced[1:])
    known = recorder.reliable | {row.tobytes() for row in searched}
    assert all(row.tobytes() in known for row in rows)


def test_a_way_back_to_the_old_states_keeps_the_rest():
    class Lengthless(Odometer):
        def propagate(self, reduced, command):
            following, valid = super().propagate(reduced, command)
            following[:, 2] = 0.0
            return following, valid

    system = Lengthless()
    corners = np.array([[0.5, -0.9], [0.5, -0.5], [0.9, -0.5], [0.9, 0.75]])
    # The last part of the plan is Unreliable, and stays as it was.
    recorder = Recorder(lambda rows: rows[:, 1] < -0.3)
    check = CheckTransition(system, recorder, k=np.inf, accuracy=None, rng=np.random.default_rng(0))
    state, states, commands = np.array([*corners[0], 0.0]), [], []
    for corner in corners[1:]:
        while np.abs(state[:2] - corner).max() > 1e-9:
            states.append(state)
            commands.append(system.steer(state[None], corner[None])[0])
            state = system.propagate(state[None], commands[-1][None])[0][0]
    path = Path(np.array([*states, state]), np.array(commands))
    goals = corners[-1:]
    problem = PlanningProblem(system, path.reduced[:1], path.reduced[-1:, :2])
    shortcuts = RepropagatedShortcuts(problem, check, np.random.default_rng(1))
    shortened = shortcuts.shorten(path)
    assert_follows_g(system, shortened.reduced, shortened.commands)
    assert len(shortened.commands) < len(commands)
    np.testing.assert_allclose(shortened.reduced[-1, :2], goals[0], atol=1e-9)


def test_rope_plans_hold_no_unchecked_transition():
    rope = Rope("engine_assembly")
    recorder = Recorder(lambda rows: np.floor(1e6 * rows[:, 1]) % 20 != 3)
    start = rope.reduce(rope.scene_problem().start)
    planner = BiasedRRT(rope, recorder, k=np.inf, random_state=0)
    result = planner.plan(start, rope.scene.goal.ravel())
    assert result.success
    assert_follows_g(rope, result.reduced, result.commands)
    assert_all_were_called_reliable(rope, recorder, result)
    assert result.reliability.all()
