"""The planners as OMPL's: the same plans through either door, and what OMPL asks of a planner."""

import re
import signal
import sqlite3
import threading
from pathlib import Path
from subprocess import CalledProcessError
from types import SimpleNamespace

import numpy as np
import pytest
from ompl import base as ob
from ompl import geometric as og
from ompl import tools
from ompl import util as ou
from test_planners import GOAL, START, HalfPlane, Nowhere, assert_same_plan
from test_processes import run
from toy_systems import Disc, Odometer

from planners import BiasedRRT, BiasedRRTConnect, PlanStatus
from systems import Car, CarScene, Rope

PLANNERS = [BiasedRRTConnect, BiasedRRT]
EXACT, TIMEOUT = ob.PlannerStatus.EXACT_SOLUTION, ob.PlannerStatus.TIMEOUT


@pytest.fixture(autouse=True)
def quiet():
    level = ou.getLogLevel()
    ou.setLogLevel(ou.LOG_NONE)
    yield
    ou.setLogLevel(level)


def box(bounds):
    space = ob.RealVectorStateSpace(bounds.shape[1])
    limits = ob.RealVectorBounds(bounds.shape[1])
    for i, (low, high) in enumerate(bounds.T):
        limits.setLow(i, low)
        limits.setHigh(i, high)
    space.setBounds(limits)
    return space


def poses(bounds):
    space, limits = ob.SE2StateSpace(), ob.RealVectorBounds(2)
    for i, (low, high) in enumerate(bounds.T[:2]):
        limits.setLow(i, low)
        limits.setHigh(i, high)
    space.setBounds(limits)
    return space


def setup_of(system, starts, goals, space=box):
    """Set up a problem as an OMPL user does."""
    setup = og.SimpleSetup(space(system.bounds))
    information = setup.getSpaceInformation()
    setup.setStateValidityChecker(ob.AllValidStateValidityChecker(information))
    information.setup()
    for start in np.atleast_2d(starts):
        setup.addStartState(state(information, start))
    region = ob.GoalStates(information)
    for goal in np.atleast_2d(goals):
        region.addState(state(information, goal))
    setup.setGoal(region)
    return setup


def state(information, configuration):
    allocated = information.allocState()
    information.getStateSpace().copyFromReals(allocated, [float(x) for x in configuration])
    return allocated


def solution(setup):
    """Return the configurations along a setup's solution, shape (n, d)."""
    space = setup.getStateSpace()
    dims = range(space.getDimension())
    states = setup.getSolutionPath().getStates()
    return np.array([[space.getValueAddressAtIndex(s, i) for i in dims] for s in states])


def solve(setup, planner, start_reduced=None, termination=20.0):
    ompl_planner = planner.ompl_planner(setup.getSpaceInformation(), start_reduced)
    setup.setPlanner(ompl_planner)
    return setup.solve(termination).getStatus(), ompl_planner


def assert_same_through_either_door(planner, start, goal, space=box):
    system, dim = planner.system, planner.system.configuration_dim
    direct = planner.plan(start, goal)
    assert direct.success
    setup = setup_of(system, start[:dim], goal, space)
    status, ompl_planner = solve(setup, planner, start if dim < len(start) else None)
    assert status == EXACT
    assert isinstance(ompl_planner, ob.Planner)
    assert_same_plan(ompl_planner.result, direct)
    np.testing.assert_array_equal(solution(setup), direct.reduced[:, :dim])
    return direct


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_arm_gets_one_plan_through_either_door(planner, arm, arm_classifier):
    start, goals = np.array([-1.5, 0.3, 0.2]), np.array([[1.5, 0.1, 0.0], [1.4, 0.5, 0.5]])
    for estimator in (None, arm_classifier):
        for seed in range(3):
            assert_same_through_either_door(
                planner(arm, estimator, random_state=seed), start, goals
            )


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_car_gets_one_plan_in_ompls_space_of_poses(planner):
    car = Car(CarScene((), (0.0, 0.0, 6.0, 4.0)))
    start, goal = np.array([2.0, 2.0, 3.0]), np.array([[3.0, 2.0, -3.0]])
    plan = assert_same_through_either_door(planner(car, random_state=0), start, goal, poses)
    assert np.abs(plan.commands[:, 2]).sum() < 2.0, "the short way round"


def test_states_that_are_more_than_a_configuration_get_one_plan_through_either_door():
    for seed in range(3):
        planner = BiasedRRT(Odometer(), HalfPlane(), random_state=seed)
        plan = assert_same_through_either_door(planner, np.array([*START, 2.0]), GOAL[None])
        assert plan.reduced[0, 2] == 2.0


def test_the_rope_gets_one_plan_through_either_door():
    rope = Rope("engine_assembly")
    problem = rope.scene_problem()
    planner = BiasedRRT(rope, simplify=False, random_state=0)
    assert_same_through_either_door(planner, rope.reduce(problem.start), problem.goal)


@pytest.mark.parametrize("planner", PLANNERS)
def test_any_start_will_do(planner):
    walled_in = np.array([-0.9, -0.9])
    for seed in range(3):
        setup = setup_of(Disc(), [walled_in, START], GOAL)
        status, solved = solve(setup, planner(Disc(), HalfPlane(), k=0.3, random_state=seed))
        assert status == EXACT
        first = solved.result.reduced[0]
        assert (first == walled_in).all() or (first == START).all()
        np.testing.assert_array_equal(solution(setup)[0], first)


class Row(ob.GoalSampleableRegion):
    """Goals along a line, as many as one likes."""

    def __init__(self, information):
        super().__init__(information)
        self.n_sampled = 0

    def sampleGoal(self, state):  # noqa: N802
        self.n_sampled += 1
        state[0], state[1] = 0.9, 0.5 - self.n_sampled / 1000

    def maxSampleCount(self):  # noqa: N802
        return 10**6

    def distanceGoal(self, state):  # noqa: N802
        return abs(state[0] - 0.9)


@pytest.mark.parametrize("planner", PLANNERS)
def test_goal_regions_are_sampled(planner):
    setup = setup_of(Disc(), START, GOAL)
    region = Row(setup.getSpaceInformation())
    setup.setGoal(region)
    status, solved = solve(setup, planner(Disc(), random_state=0))
    assert status == EXACT
    assert solved.result.reduced[-1, 0] == 0.9
    assert 1 < region.n_sampled <= 1000


class Somewhere(ob.GoalRegion):
    """A goal that can only be recognised."""

    def distanceGoal(self, state):  # noqa: N802
        return abs(state[0] - 0.9)


def test_what_is_missing_is_told_in_ompls_words():
    setup = setup_of(Disc(), START, GOAL)
    setup.setGoal(Somewhere(setup.getSpaceInformation()))
    assert solve(setup, BiasedRRT(Disc()))[0] == ob.PlannerStatus.UNRECOGNIZED_GOAL_TYPE
    outside = [[5.0, 5.0]]
    assert solve(setup_of(Disc(), outside, GOAL), BiasedRRT(Disc()))[0] == (
        ob.PlannerStatus.INVALID_START
    )
    assert solve(setup_of(Disc(), START, outside), BiasedRRT(Disc()))[0] == (
        ob.PlannerStatus.INVALID_GOAL
    )


def test_goals_that_ompl_finds_invalid_are_left_out():
    setup = setup_of(Disc(), START, [[5.0, 5.0], GOAL, [0.9, 0.2]])
    setup.setStateValidityChecker(lambda s: s[1] < 0.15)
    for seed in range(4):
        status, solved = solve(setup, BiasedRRT(Disc(), random_state=seed))
        assert status == EXACT
        np.testing.assert_allclose(solved.result.reduced[-1], GOAL)
        setup.clear()


def stop_after(n):
    asked = []
    return ob.PlannerTerminationCondition(lambda: asked.append(0) or len(asked) > n), asked


class FastNowhere(Nowhere):
    def fast_decision_function(self, X):
        self.asked.append(X.copy())
        return -np.ones(len(X))


@pytest.mark.parametrize("estimator", [Nowhere, FastNowhere])
@pytest.mark.parametrize("planner", PLANNERS)
def test_ompls_termination_condition_is_asked_before_each_round(planner, estimator):
    setup = setup_of(Disc(), START, GOAL)
    termination, asked = stop_after(5)
    hopeless = planner(Disc(), estimator(), k=np.inf, max_iterations=10**9, random_state=0)
    status, stopped = solve(setup, hopeless, termination=termination)
    assert status == TIMEOUT
    assert not setup.haveSolutionPath()
    assert stopped.result.status is PlanStatus.TERMINATED
    assert "lower k" in stopped.result.status.value
    assert 5 < len(asked) < 10


@pytest.mark.parametrize("planner", PLANNERS)
def test_its_own_limits_hold_too(planner):
    hopeless = planner(Disc(), Nowhere(), k=np.inf, max_iterations=80, random_state=0)
    status, stopped = solve(setup_of(Disc(), START, GOAL), hopeless)
    assert (status, stopped.result.status) == (TIMEOUT, PlanStatus.ITERATION_LIMIT)


class Hesitant(HalfPlane):
    """Calls every transition Reliable, with the probability 0.7."""

    def predict(self, X):
        return np.ones(len(X), dtype=int)

    def predict_proba(self, X):
        return np.tile([0.3, 0.7], (len(X), 1))


@pytest.mark.parametrize("planner", PLANNERS)
def test_a_distrusted_plan_is_no_solution_and_is_attached(planner):
    careful = planner(Disc(), Hesitant(), min_success=0.9, restarts=2, random_state=0)
    direct = careful.plan(START, GOAL)
    assert direct.status is PlanStatus.DISTRUSTED
    setup = setup_of(Disc(), START, GOAL)
    status, distrusting = solve(setup, careful)
    assert status == ob.PlannerStatus.ABORT
    assert not setup.haveSolutionPath()
    assert_same_plan(distrusting.result, direct)
    once = planner(Disc(), Hesitant(), random_state=0).plan(START, GOAL)
    assert direct.n_checked > 2 * once.n_checked


@pytest.mark.parametrize("planner", PLANNERS)
def test_ompls_termination_condition_ends_restarts(planner):
    setup = setup_of(Disc(), START, GOAL)
    termination, asked = stop_after(5)
    hopeless = planner(
        Disc(), Nowhere(), k=np.inf, max_iterations=10**9, restarts=10**9, random_state=0
    )
    status, stopped = solve(setup, hopeless, termination=termination)
    assert status == TIMEOUT
    assert stopped.result.status is PlanStatus.TERMINATED
    assert len(asked) < 10


@pytest.mark.parametrize("planner", PLANNERS)
def test_it_solves_again_with_and_without_clearing(planner):
    setup = setup_of(Disc(), START, GOAL)
    _, solved = solve(setup, planner(Disc(), HalfPlane(), random_state=3))
    first = solved.result
    assert setup.solve(20.0).getStatus() == EXACT
    assert_same_plan(solved.result, first)
    setup.clear()
    assert solved.result is None
    assert setup.solve(20.0).getStatus() == EXACT
    assert_same_plan(solved.result, first)
    assert setup.getSolutionPath().getStateCount() == len(first.reduced)


def test_parameters_are_set_on_either_object():
    setup = setup_of(Disc(), START, GOAL)
    planner = BiasedRRT(Disc(), random_state=0)
    _, solved = solve(setup, planner)
    assert solved.getName() == "BiasedRRT"
    assert solved.get_params()["max_iterations"] == 20_000
    solved.set_params(max_iterations=1)
    assert planner.max_iterations == 1
    setup.clear()
    assert setup.solve(20.0).getStatus() == TIMEOUT
    planner.max_iterations = 0
    with pytest.raises(ValueError, match="max_iterations must be a positive integer, got 0"):
        setup.solve(20.0)


def children_of(data):
    children = {i: list(data.getEdges(i)) for i in range(data.numVertices())}
    return children if any(children.values()) else {}


def reachable(children, roots):
    found, waiting = set(roots), list(roots)
    while waiting:
        for child in children[waiting.pop()]:
            if child not in found:
                found.add(child)
                waiting.append(child)
    return found


@pytest.mark.parametrize("estimator", [None, HalfPlane()], ids=str)
@pytest.mark.parametrize("planner", PLANNERS)
def test_the_tree_is_in_planner_data(planner, estimator):
    setup = setup_of(Disc(), START, GOAL)
    _, solved = solve(setup, planner(Disc(), estimator, simplify=False, random_state=0))
    data = ob.PlannerData(setup.getSpaceInformation())
    setup.getPlanner().getPlannerData(data)
    vertices = np.array([data.getVertex(i).getState()[0:2] for i in range(data.numVertices())])
    edges = {
        (tuple(vertices[i]), tuple(vertices[j]))
        for i in range(len(vertices))
        for j in data.getEdges(i)
    }
    assert edges == {(tuple(a), tuple(b)) for a, b in solved.result.tree}
    assert data.numEdges() == len(edges)
    starts = [data.getStartIndex(i) for i in range(data.numStartVertices())]
    goals = [data.getGoalIndex(i) for i in range(data.numGoalVertices())]
    np.testing.assert_array_equal(vertices[starts], [START])
    np.testing.assert_allclose(vertices[goals], [GOAL])
    assert set(goals) <= reachable(children_of(data), starts), "the plan is in the tree"


def test_planner_data_of_no_solve_is_empty_and_outlives_the_planner():
    setup = setup_of(Disc(), START, GOAL)
    planner = BiasedRRT(Disc(), random_state=0).ompl_planner(setup.getSpaceInformation())
    data = ob.PlannerData(setup.getSpaceInformation())
    planner.getPlannerData(data)
    assert data.numVertices() == 0
    setup.setPlanner(planner)
    setup.solve(20.0)
    planner.getPlannerData(data)
    n_edges = len(np.unique(planner.result.tree, axis=0))
    del planner, setup
    assert data.numEdges() == n_edges
    assert np.isfinite(data.getVertex(data.numVertices() - 1).getState()[0])


def test_ompl_itself_gets_no_planner_data_and_does_not_abort():
    setup = setup_of(Disc(), START, GOAL)
    solve(setup, BiasedRRT(Disc(), random_state=0))
    data = ob.PlannerData(setup.getSpaceInformation())
    setup.getPlannerData(data)
    assert data.numVertices() == 0


def test_a_benchmark_log_is_read_by_planner_arenas_tools(tmp_path, monkeypatch):
    # OMPL writes the planners' messages into the current folder.
    monkeypatch.chdir(tmp_path)
    setup = setup_of(Disc(), START, GOAL)
    benchmark = tools.Benchmark(setup, "disc")
    for planner in PLANNERS:
        # An integer would make the same plan in each run.
        biased = planner(Disc(), HalfPlane(), random_state=np.random.default_rng(0))
        benchmark.addPlanner(biased.ompl_planner(setup.getSpaceInformation()))
    request = tools.Request()
    request.maxTime, request.runCount, request.displayProgress = 20.0, 4, False
    benchmark.benchmark(request)
    log, database = str(tmp_path / "disc.log"), str(tmp_path / "disc.db")
    benchmark.saveResultsToFile(log)
    tools.readBenchmarkLog(database, [log], False)
    with sqlite3.connect(database) as connection:
        runs = connection.execute(
            "SELECT name, COUNT(*), SUM(solved), COUNT(DISTINCT solution_length) FROM runs "
            "JOIN plannerConfigs ON plannerid = plannerConfigs.id GROUP BY name ORDER BY name"
        ).fetchall()
    assert runs == [("geometric_BiasedRRT", 4, 4, 4), ("geometric_BiasedRRTConnect", 4, 4, 4)]


def test_a_problem_that_does_not_fit_is_refused():
    plane = setup_of(Disc(), START, GOAL).getSpaceInformation()
    line = ob.SpaceInformation(box(np.array([[-1.0], [1.0]])))
    with pytest.raises(ValueError, match="a state space of 2 numbers, the configuration of Disc"):
        BiasedRRT(Disc()).ompl_planner(line)
    volume = ob.SpaceInformation(box(np.array([[-1.0] * 3, [1.0] * 3])))
    with pytest.raises(ValueError, match=r"space_information must be .* of dimension 3"):
        BiasedRRT(Disc()).ompl_planner(volume)
    with pytest.raises(ValueError, match="start_reduced must be given, since a reduced state of O"):
        BiasedRRT(Odometer()).ompl_planner(plane)
    with pytest.raises(ValueError, match=r"start_reduced must have the shape \(3\)"):
        BiasedRRT(Odometer()).ompl_planner(plane, START)
    with pytest.raises(ValueError, match="holds 1 more numbers; use BiasedRRT"):
        BiasedRRTConnect(Odometer()).ompl_planner(plane)
    with pytest.raises(ValueError, match="start_reduced must be the reduced state at OMPL's start"):
        solve(setup_of(Disc(), START, GOAL), BiasedRRT(Odometer()), np.array([0.9, 0.9, 0.0]))
    with pytest.raises(ValueError, match="start_reduced must be a state from which propagate is"):
        solve(setup_of(Disc(), [0.0, 0.1], GOAL), BiasedRRT(Disc()))


def own_ompl_draws(between, seed=11):
    """Seeds and a plan of an OMPL user's own, with something else in between."""
    ou.RNG.setSeed(seed)
    seeds = []
    for _ in range(3):
        seeds.append(ou.RNG().getLocalSeed())
        between()
    setup = setup_of(Disc(), START, GOAL)
    planner = og.RRT(setup.getSpaceInformation())
    between()
    planner.setRange(0.1)
    setup.setPlanner(planner)
    setup.solve(20.0)
    return seeds, solution(setup).tolist()


@pytest.mark.parametrize("planner", ["BiasedRRTConnect", "BiasedRRT"])
def test_a_users_own_draws_from_ompl_are_left_alone(planner):
    code = """
        import sys
        sys.path.insert(0, "tests")
        from test_ompl_planners import *
        ou.setLogLevel(ou.LOG_NONE)
        print(own_ompl_draws(lambda: {between}))
        """
    alone = run(code.format(between="None"))
    beside = run(code.format(between=f"{planner}(Disc(), random_state=0).plan(START, GOAL)"))
    assert alone.stdout == beside.stdout


def test_after_seeding_again_a_users_own_draws_are_reproducible():
    def plan_of_ours():
        BiasedRRTConnect(Disc(), random_state=0).plan(START, GOAL)

    def many_seeds_and_a_plan():
        for _ in range(1500):
            ou.RNG()
        plan_of_ours()

    for between in (plan_of_ours, many_seeds_and_a_plan):
        assert own_ompl_draws(between) == own_ompl_draws(between)
        assert own_ompl_draws(between) != own_ompl_draws(between, seed=12)


def test_ompls_log_level_comes_back():
    ou.setLogLevel(ou.LOG_ERROR)
    BiasedRRTConnect(Disc(), random_state=0).plan(START, GOAL)
    assert ou.getLogLevel() == ou.LOG_ERROR


NESTED = """
import os, sys, threading
sys.path.insert(0, "tests")
import numpy as np
from planners import BiasedRRTConnect
from toy_systems import Disc

class Asks:
    classes_ = np.array([0, 1])
    validation_accuracy_ = 0.9
    n_asked = 0
    def predict(self, X):
        self.n_asked += 1
        if self.n_asked == 3:
            {while_asked}
        return np.ones(len(X), dtype=int)
    def fast_decision_function(self, X):
        return 2.0 * self.predict(X) - 1

def plan(estimator=None):
    return BiasedRRTConnect(Disc(), estimator, random_state=0).plan([-0.9, -0.1], [0.9, 0.1])

print(plan(Asks()).success, flush=True)
"""


def test_an_estimator_may_plan_itself():
    process = run(NESTED.format(while_asked="assert plan().success"))
    assert process.stdout == "True\n"


def test_a_process_forked_during_a_search_may_plan():
    forking = """
            child = os.fork()
            if child == 0:
                os._exit(0 if plan().success else 1)
            assert os.waitpid(child, 0)[1] == 0"""
    assert run(NESTED.format(while_asked=forking)).stdout == "True\n"


def test_nothing_of_ompl_is_left_behind():
    process = run(
        """
        import sys
        sys.path.insert(0, "tests")
        import gc, warnings, weakref
        from planners import PermissiveAcceptanceWarning
        from test_ompl_planners import *
        warnings.simplefilter("ignore", PermissiveAcceptanceWarning)
        ou.setLogLevel(ou.LOG_NONE)

        def solved(planner, seed):
            setup = setup_of(Disc(), START, GOAL)
            status, solved = solve(setup, planner(Disc(), HalfPlane(), random_state=seed))
            data = ob.PlannerData(setup.getSpaceInformation())
            solved.getPlannerData(data)
            assert status == EXACT
            return weakref.ref(solved)

        left = [solved(planner, seed) for planner in PLANNERS for seed in range(10)]
        gc.collect()
        print(sum(reference() is not None for reference in left))
        """
    )
    assert process.stdout == "0\n"
    assert process.stderr == ""


def test_the_documentations_example_runs(capsys):
    text = (Path(__file__).parents[1] / "docs" / "ompl.md").read_text()
    exec(compile(re.search(r"```python\n(.*?)```", text, flags=re.S)[1], "ompl.md", "exec"), {})
    assert re.search(r"\d+ states\n\(\d+, 3\) 1.0\n\d+ vertices\n", capsys.readouterr().out)


def test_what_ompl_cannot_do_from_python():
    """If one of these fails, OMPL has learned something, and docs/ompl.md can be shorter."""
    abort = """
        from ompl import base as ob
        from ompl import geometric as og
        class Overriding(ob.Planner):
            def getPlannerData(self, data):
                print("called")
        setup = og.SimpleSetup(ob.RealVectorStateSpace(1))
        information = setup.getSpaceInformation()
        setup.setPlanner(Overriding(information, "overriding"))
        setup.getPlannerData(ob.PlannerData(information))
        """
    with pytest.raises(CalledProcessError) as caught:
        run(abort)
    assert caught.value.returncode == -signal.SIGABRT
    assert "called" not in caught.value.output
    planner = og.RRT(setup_of(Disc(), START, GOAL).getSpaceInformation())
    for call in (planner.params, planner.getSpecs):
        with pytest.raises(TypeError, match="Unable to convert function return value"):
            call()


@pytest.mark.parametrize("at_seeding", [1, 2, 3])
def test_a_plan_interrupted_while_seeds_are_set_or_put_back_does_not_block_the_next(
    monkeypatch, at_seeding
):
    class InterruptedRNG(ou.RNG):
        n_seedings = 0

        @staticmethod
        def setSeed(seed):  # noqa: N802
            InterruptedRNG.n_seedings += 1
            if InterruptedRNG.n_seedings == at_seeding:
                raise KeyboardInterrupt
            ou.RNG.setSeed(seed)

    def plan():
        return BiasedRRTConnect(Disc(), random_state=0).plan(START, GOAL)

    expected = plan()
    with monkeypatch.context() as patch:
        stand_in = SimpleNamespace(**{**vars(ou), "RNG": InterruptedRNG})
        patch.setattr("planners.ompl_globals.ou", stand_in)
        with pytest.raises(KeyboardInterrupt):
            plan()
    plans = []
    thread = threading.Thread(target=lambda: plans.append(plan()), daemon=True)
    thread.start()
    thread.join(60)
    assert not thread.is_alive(), "it waits for ever"
    assert_same_plan(plans[0], expected)
