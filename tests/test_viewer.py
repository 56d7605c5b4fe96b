"""What the viewer draws, as data: no viser and no browser are needed."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from drawn_toys import DrawnArrow, DrawnDisc
from toy_systems import Disc

from planners import BiasedRRT, BiasedRRTConnect, PlanStatus, execute, export_html, show
from planners.viewer.arguments import make_show
from planners.viewer.captions import caption_html
from planners.viewer.colors import EXECUTED, NOT_ESTIMATED, css, reliability_colors
from planners.viewer.layout import FIELD_OF_VIEW
from planners.viewer.meshes import tube_faces, tube_vertices
from planners.viewer.panel import MOST_TREE_LINES
from systems import Car, PlanarArm, Problem, Rollout, Rope, StopReason, SystemContractError
from systems.drawing.shapes import SphereShape

DISC = DrawnDisc()
START, GOAL = np.array([-0.9, 0.0]), np.array([[0.9, 0.2]])
PLAN = BiasedRRTConnect(DISC, random_state=0).plan(START, GOAL)
ROLLOUT = DISC.rollout(START, PLAN.commands)
N = len(PLAN.commands)
UNSOLVED = BiasedRRTConnect(DISC, max_iterations=3, random_state=0).plan(START, GOAL)


def shown(plans=PLAN, system=DISC, executed=None, goal=None, names=None):
    return make_show(system, plans, executed, goal, names)


def centres(frames):
    return np.array([shapes[0].position for shapes in frames])


def test_the_planned_robot_is_at_each_planned_state_and_moves_straight_in_between():
    everything = shown()
    (panel,) = everything.panels
    every = everything.frames_per_transition
    assert every > 1
    assert len(panel.planned) == everything.n_frames == N * every + 1
    np.testing.assert_allclose(centres(panel.planned)[::every, :2], PLAN.reduced)
    middle = centres(panel.planned[:: every // 2])[1, :2]
    np.testing.assert_allclose(middle, PLAN.reduced[:2].mean(axis=0))
    assert panel.planned[0][0].color[3] == 1
    assert panel.executed == []


def test_the_executed_robot_is_at_each_true_state_and_the_planned_one_is_translucent():
    everything = shown(executed=ROLLOUT)
    (panel,) = everything.panels
    every = everything.frames_per_transition
    found = centres(panel.executed)[::every, :2]
    np.testing.assert_allclose(found, ROLLOUT.states)
    assert panel.planned[0][0].color[3] < 1 == panel.executed[0][0].color[3]
    assert (panel.executed_path.colors == EXECUTED[:3]).all()
    np.testing.assert_allclose(panel.executed_path.points[:, 1, :2], ROLLOUT.states[1:])


def test_where_the_system_left_the_plan_is_marked_and_said():
    (panel,) = shown(executed=ROLLOUT).panels
    apart = ~DISC.close(PLAN.reduced[1:], np.array(ROLLOUT.states[1:]))
    first = int(np.flatnonzero(apart)[0])
    np.testing.assert_allclose(panel.left_plan[:, :2], [ROLLOUT.states[first + 1]])
    assert f"Left the plan in transition {first + 1}." in panel.summary
    same = Rollout(list(PLAN.reduced), N, StopReason.COMPLETED)
    assert len(shown(executed=same).panels[0].left_plan) == 0


def test_transitions_have_the_colour_of_their_reliability():
    plan = replace(PLAN, reliability=np.linspace(0, 1, N))
    path = shown(plan).panels[0].planned_path
    np.testing.assert_allclose(path.points[:, 0, :2], PLAN.reduced[:-1])
    np.testing.assert_allclose(path.colors, reliability_colors(np.linspace(0, 1, N)))
    red, _, blue = reliability_colors(np.array([0.0, 1.0])).T
    assert red[0] > 0.7 > blue[0]
    assert blue[1] > 0.7 > red[1]
    assert (shown().panels[0].planned_path.colors == NOT_ESTIMATED[:3]).all()


def test_the_tree_and_the_goals_are_drawn_by_the_traced_points():
    (panel,) = shown(goal=GOAL).panels
    np.testing.assert_allclose(panel.tree[:, :, :2], PLAN.tree)
    np.testing.assert_allclose(panel.goal_points[:, :2], GOAL)
    large = replace(PLAN, tree=np.random.default_rng(0).uniform(-1, 1, (MOST_TREE_LINES + 5, 2, 2)))
    (panel,) = shown(large).panels
    assert len(panel.tree) == MOST_TREE_LINES
    assert f"Of the search tree's {MOST_TREE_LINES + 5} lines" in panel.summary[-1]


def test_a_system_without_traced_points_is_drawn_without_paths():
    class Untraced(DrawnDisc):
        traced_points = Disc.traced_points

    (panel,) = shown(system=Untraced(), executed=ROLLOUT, goal=GOAL).panels
    for points in (panel.tree, panel.planned_path.points, panel.goal_points, panel.left_plan):
        assert len(points) == 0
    assert len(panel.planned) == len(panel.executed) > 1


def test_unsolved_plans_show_the_start_and_the_tree():
    everything = shown(UNSOLVED)
    (panel,) = everything.panels
    assert not UNSOLVED.solved
    assert (everything.n_transitions, everything.n_frames) == (0, 1)
    np.testing.assert_allclose(centres(panel.planned)[:, :2], [START])
    assert len(panel.tree) == len(UNSOLVED.tree) > 0
    assert UNSOLVED.status.value in panel.summary


def test_distrusted_plans_are_shown_whole():
    distrusted = replace(
        PLAN, status=PlanStatus.DISTRUSTED, reliability=np.full(N, 0.5), calibrated_probability=0.2
    )
    (panel,) = shown(distrusted).panels
    assert len(panel.planned_path.points) == N
    assert PlanStatus.DISTRUSTED.value in panel.summary[0]
    assert "success_probability 0.2" in " ".join(panel.summary)


def test_several_plans_stand_side_by_side_and_wait_for_the_longest():
    short = BiasedRRTConnect(DISC, random_state=0).plan(START, START[None] + 0.25)
    everything = shown([PLAN, short, UNSOLVED], executed=[ROLLOUT, None, None])
    assert len({len(panel.planned) for panel in everything.panels}) == 1
    np.testing.assert_allclose(centres(everything.panels[1].planned)[-1, :2], short.reduced[-1])
    offsets = everything.layout.offsets
    assert np.linalg.norm(np.diff(offsets, axis=0), axis=1).min() > 2
    assert [panel.name for panel in everything.panels] == ["Plan 1", "Plan 2", "Plan 3"]


def test_many_plans_stand_in_rows():
    offsets = shown([PLAN] * 7).layout.offsets
    assert len(np.unique(offsets.round(6), axis=0)) == 7
    apart = np.linalg.norm(offsets[:, None] - offsets, axis=2)
    assert np.ptp(offsets, axis=0).max() < 3.5 * apart[apart > 0].min()


@pytest.mark.parametrize("n_plans", [1, 2, 5])
def test_the_camera_sees_everything(n_plans):
    everything = shown([PLAN] * n_plans)
    layout = everything.layout
    forward = (layout.look_at - layout.camera) / np.linalg.norm(layout.look_at - layout.camera)
    right = np.cross(forward, [0, 0, 1.0])
    up = np.cross(right / np.linalg.norm(right), forward)
    for offset in layout.offsets:
        for x, y in np.ndindex(2, 2):
            corner = np.array([2 * x - 1, 2 * y - 1, -0.3])
            gap = corner + offset - layout.camera
            assert 0 < abs(gap @ up) < np.tan(FIELD_OF_VIEW / 2) * (gap @ forward)


def test_executions_show_the_plan_that_was_followed_at_each_moment():
    problem = Problem(START, GOAL)
    planner = BiasedRRT(DISC, random_state=1)
    execution = execute(DISC, planner, problem, tolerance=0.02, max_replans=4)
    assert execution.n_replans > 0
    everything = shown(execution)
    (panel,) = everything.panels
    every = everything.frames_per_transition
    np.testing.assert_allclose(centres(panel.executed)[::every, :2], execution.states)
    for start, plan in zip(execution.plan_starts, execution.plans, strict=True):
        if plan.success and len(plan.commands) and start < everything.n_transitions:
            np.testing.assert_allclose(
                panel.planned[start * every][0].position[:2], plan.reduced[0]
            )
    assert f"{execution.n_replans} replans" in " ".join(panel.summary)


def test_shapes_of_true_states_need_not_be_those_of_reduced_states():
    (panel,) = shown(system=DrawnArrow(), executed=ROLLOUT).panels
    assert type(panel.planned[0][0]) is not type(panel.executed[0][0])
    assert panel.planned[0][0].color[3] < 1


def test_the_captions_tell_colours_and_outcomes_and_escape_names():
    plans = [PLAN, replace(PLAN, reliability=np.full(N, 0.9))]
    everything = shown(plans, executed=[ROLLOUT, None], goal=GOAL, names=["<b>", "b"])
    caption = caption_html(everything.panels)
    for part in (css(EXECUTED), css(NOT_ESTIMATED), "reliability 0", "&lt;b&gt;:", "search tree"):
        assert part in caption
    assert "executed" not in caption_html(shown().panels)
    assert css(reliability_colors(np.array([1.0]))[0]) == "#1a66c2"


def test_tubes_are_as_wide_as_they_should_be_even_where_points_coincide():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0.0]])
    vertices, faces = tube_vertices(points, 0.1), tube_faces(len(points))
    assert np.isfinite(vertices).all()
    assert faces.max() == len(vertices) - 1
    from_line = np.minimum(
        np.linalg.norm(vertices - np.clip(vertices, [0, 0, 0], [1, 0, 0]), axis=1),
        np.linalg.norm(vertices - np.clip(vertices, [1, 0, 0], [1, 1, 0]), axis=1),
    )
    assert from_line.max() < 0.1 + 1e-9
    np.testing.assert_allclose(vertices[:, 0].min(), -0.1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"plans": []}, "plans must be a PlanResult or Execution"),
        ({"plans": [PLAN, 3]}, "plans must be"),
        ({"system": 3}, "system must be a System"),
        ({"system": [DISC, DISC]}, "system must be one, or as many as plans, 1, got 2"),
        ({"executed": 3}, "executed must be a Rollout"),
        ({"executed": [ROLLOUT, ROLLOUT]}, "for each of the 1 plans, got 2"),
        ({"executed": ROLLOUT, "plans": UNSOLVED}, "give the rollout of this plan's commands"),
        ({"goal": [1.0, 2.0, 3.0]}, "goal must"),
        ({"names": ["a", "b"]}, "names must be as many as plans, 1, got 2"),
        ({"names": 3}, "names must be strings"),
    ],
)
def test_unfit_arguments_are_named(given, message):
    with pytest.raises(ValueError, match=message):
        shown(**given)


def test_a_system_that_does_not_say_how_it_looks_is_told_what_to_define():
    with pytest.raises(NotImplementedError, match=r"Disc does not say .* draw\(reduced\)"):
        shown(system=Disc())


@pytest.mark.parametrize(
    ("method", "returned"),
    [
        ("draw", [3]),
        ("draw_state", None),
        ("draw_scene", SphereShape([0, 0, 0], 1.0)),
        ("draw_goal", "x"),
        ("traced_points", np.zeros((3, 2))),
    ],
)
def test_what_is_no_picture_is_named(method, returned):
    wrong = type("Wrong", (DrawnDisc,), {method: lambda self, _=None: returned})()
    with pytest.raises(SystemContractError, match=rf"Wrong\.{method} must return"):
        shown(system=wrong, executed=ROLLOUT, goal=GOAL)


def test_port_and_block_are_checked():
    for port in (0, 70000, "a"):
        with pytest.raises(ValueError, match="port"):
            show(DISC, PLAN, port=port)
    with pytest.raises(ValueError, match="block"):
        show(DISC, PLAN, block="yes")


@pytest.mark.skipif(importlib.util.find_spec("viser") is not None, reason="viser is installed")
def test_without_viser_the_error_names_the_extra(tmp_path):
    for call in (lambda: show(DISC, PLAN), lambda: export_html(tmp_path / "a.html", DISC, PLAN)):
        with pytest.raises(ImportError, match=r"transition-reliability\[viewer\]"):
            call()
    assert not list(tmp_path.iterdir())


def test_the_arms_tip_is_at_the_end_of_its_last_link():
    arm = PlanarArm()
    configuration = np.array([0.3, -0.7, 1.1])
    *_, last_link = arm.draw(configuration)[:3]
    (tip,) = arm.traced_points(configuration[None])[0]
    np.testing.assert_allclose(last_link.points[1], tip)
    np.testing.assert_allclose(tip[[0, 2]], arm.joint_positions(configuration[None])[0, -1])


def test_the_car_drives_the_way_it_really_drives_between_states():
    car = Car("slalom")
    start, plan_commands = np.array([0.6, 3.0, 0.0, 0.5, 0.0]), np.array([[1.0, 0.3, 0.4]])
    rollout = car.rollout(start, plan_commands)
    plan = replace(
        BiasedRRTConnect(car, random_state=0).plan(start[:3], start[None, :3]),
        reduced=np.stack([start[:3], start[:3] + plan_commands[0]]),
        commands=plan_commands,
        status=PlanStatus.SOLVED,
    )
    everything = make_show(car, plan, rollout, None, None)
    (panel,) = everything.panels
    traced = car.trace(start, plan_commands)
    for shapes in panel.executed:
        assert np.linalg.norm(traced[:, :2] - shapes[0].position[:2], axis=1).min() < 0.02
    assert len(panel.executed_path.points) > 5
    body = panel.executed[-1][0]
    heading = np.arctan2(body.rotation[1, 0], body.rotation[0, 0])
    np.testing.assert_allclose(heading, rollout.states[-1][2], atol=1e-9)


def test_the_rope_is_drawn_where_its_nodes_are_and_the_band_between_the_grippers():
    rope = Rope("simple_hook", features="clearance")
    nodes = rope.scene.start_rope()
    state = rope.scene_problem().start
    tube, *grippers = rope.draw_state(state)
    np.testing.assert_allclose(tube.points, state.nodes)
    np.testing.assert_allclose([gripper.position for gripper in grippers], state.grippers)
    band, *_ = rope.draw(rope.reduce(state))
    np.testing.assert_allclose(band.points[[0, -1]], nodes[[0, -1]], atol=1e-6)
    assert len(rope.draw_scene()) == len(rope.scene.obstacles)
