"""Systems, scenes and feature blocks with odd arguments."""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fuzzing import (
    Door,
    arrays,
    cases,
    choices,
    counts,
    numbers,
    rows,
    st,
    try_numpy_numbers,
    try_odd_values,
)

from systems import (
    Box,
    BoxShape,
    Capsule,
    Car,
    CarScene,
    Circle,
    ConvexPolygon,
    ConvexPolyhedron,
    Cylinder,
    CylinderShape,
    GripperGoal,
    MeshShape,
    MujocoObstacles,
    PlanarArm,
    Rope,
    RopeState,
    Scene,
    Sphere,
    SphereShape,
    TubeShape,
    check_system,
    directions,
    from_body_frame,
    has_slot_and_slit,
    holding_load,
    load_scene,
    motion_in_body_frame,
    random_car_scene,
    random_rope_scene,
    ray_distances,
    shortest_way,
    to_body_frame,
    wrap_columns,
)

ARM, CAR, ROPE = PlanarArm(), Car("slalom"), Rope("simple_hook_short", features="vector")
FREE = np.array([0.6, 3.0, 0.0])
SCENE = ROPE.scene
HANGING = RopeState(SCENE.start, SCENE.start_rope())
BAND = ROPE.reduce(HANGING)
seeds = numbers
MODEL_FILE = str(Path(tempfile.gettempdir()) / f"fuzzed-{os.getpid()}.xml")


@pytest.fixture(scope="module", autouse=True)
def _model_file():
    Path(MODEL_FILE).write_text(
        """<mujoco><worldbody>
          <geom name="wall" type="box" pos="2 0 0" size="0.5 3 1"/>
          <body><joint name="a" axis="0 1 0"/><geom size="0.1" pos="1 0 0"/>
          <body><joint name="b" axis="0 1 0"/><geom size="0.1" pos="2 0 0"/></body></body>
        </worldbody><actuator>
          <motor joint="a" forcelimited="true" forcerange="-9 9"/>
          <motor joint="b" forcelimited="true" forcerange="-9 9"/>
        </actuator></mujoco>"""
    )
    yield
    Path(MODEL_FILE).unlink()


def obstacles_at(points, **given):
    return MujocoObstacles(**given)(points)


def of_rows(system, name, first, second, right):
    """A method that takes two arrays of rows."""
    return Door(
        lambda **given: getattr(system, name)(*given.values()),
        lambda: {first: right[0].copy(), second: right[1].copy()},
        {first: rows(*right[0].shape), second: rows(*right[1].shape)},
        names={first: f"({first}|{second})"},  # by which the second one has too few rows
    )


def methods(label, system, row, command):
    """The methods that all systems have, but for the slow ones."""
    b, u, q = np.tile(row, (2, 1)), np.tile(command, (2, 1)), np.tile(row[: len(command)], (2, 1))
    pairs = {
        "propagate": ("reduced", "command", (b, u)),
        "steer": ("reduced", "configuration", (b, q + 0.1)),
        "close": ("predicted", "executed", (b, b)),
        "features": ("reduced", "next_reduced", (b, b)),
        "goal_reached": ("reduced", "goal", (b, q)),
    }
    doors = {f"{label}.{name}": of_rows(system, name, *pair) for name, pair in pairs.items()}
    doors[f"{label}.sample_problem"] = Door(
        system.sample_problem, lambda: {"random_state": 1}, {"random_state": seeds}, share=0.2
    )
    return doors


def of_state(label, system, state, command):
    """The methods that take a true state that is an array."""
    d, moves = len(state), np.tile(command, (2, 1))
    return {
        f"{label}.reduce": Door(system.reduce, lambda: {"state": state.copy()}, {"state": rows(d)}),
        f"{label}.rollout": Door(
            lambda **given: system.rollout(**given).states,
            lambda: {"state": state.copy(), "commands": moves.copy()},
            {"state": rows(d), "commands": rows(2, 3)},
            share=0.4,
        ),
        f"{label}.succeeded": Door(
            system.succeeded,
            lambda: {"state": state.copy(), "goal": moves.copy(), "tolerance": 0.5},
            {"state": rows(d), "goal": rows(2, 3), "tolerance": numbers},
        ),
    }


def made(make, right, **odd):
    return Door(make, lambda: dict(right), odd)


DOORS = {
    **methods("PlanarArm", ARM, np.array([-1.5, 0.1, 0.2]), np.array([-1.5, 0.1, 0.2])),
    **of_state("PlanarArm", ARM, np.array([-1.5, 0.0, 0.0]), np.array([-1.5, 0.1, 0.0])),
    **methods("Car", CAR, FREE, np.array([0.1, 0.0, 0.0])),
    **of_state("Car", CAR, np.append(FREE, [0.0, 0.0]), np.array([0.1, 0.0, 0.0])),
    **methods("Rope", ROPE, BAND, np.full(6, 0.01)),
    "PlanarArm.can_hold": Door(
        ARM.can_hold,
        lambda: {"configurations": np.zeros((1, 3))},
        {"configurations": rows(1, 3)},
        share=0.4,
    ),
    "PlanarArm.inverse_kinematics": made(
        ARM.inverse_kinematics,
        {"target": [0.5, 0.5], "headings": [0.0, 1.0]},
        target=rows(2),
        headings=rows(2),
    ),
    "PlanarArm.joint_positions": made(
        ARM.joint_positions, {"configurations": np.zeros((2, 3))}, configurations=rows(2, 3)
    ),
    "Car.execute": Door(
        CAR.execute,
        lambda: {"states": np.append(FREE, [0.0, 0.0])[None], "commands": np.zeros((1, 3))},
        {"states": rows(1, 5), "commands": rows(1, 3)},
        names={"states": "(states|commands)"},
    ),
    "Car.trace": made(
        CAR.trace,
        {"state": np.append(FREE, [0.0, 0.0]), "commands": np.zeros((1, 3))},
        state=rows(5),
        commands=rows(1, 3),
    ),
    "Car.outline": made(CAR.outline, {"pose": FREE}, pose=rows(3)),
    "Car.distance": of_rows(CAR, "distance", "one", "other", (FREE[None], FREE[None])),
    "Car.clearance": made(CAR.clearance, {"poses": FREE[None]}, poses=rows(1, 3)),
    "Car": made(Car, {"scene": "slalom"}, scene=choices),
    "Rope.reduce": Door(
        lambda **given: ROPE.reduce(replace(HANGING, **given)),
        lambda: {"grippers": HANGING.grippers.copy(), "nodes": HANGING.nodes.copy()},
        {"grippers": rows(2, 3), "nodes": rows(*HANGING.nodes.shape)},
        names={"grippers": "state.(grippers|nodes)"},
    ),
    "Rope.reduce (type)": made(ROPE.reduce, {"state": HANGING}, state=choices | rows(2, 3)),
    "Rope.rollout": made(
        lambda **given: len(ROPE.rollout(**given).states),
        {"state": HANGING, "commands": np.zeros((0, 6))},
        state=choices,
        commands=choices | arrays(0, 6),
    ),
    "Rope.succeeded": made(
        ROPE.succeeded,
        {"state": HANGING, "goal": SCENE.goal.reshape(1, 6), "tolerance": 0.1},
        state=choices,
        goal=rows(1, 6),
        tolerance=numbers,
    ),
    "Rope.bands": made(ROPE.bands, {"reduced": BAND[None]}, reduced=rows(1, len(BAND))),
    "Rope": made(
        Rope,
        {"scene": "simple_hook_short", "engine": "mujoco", "features": "vector"},
        scene=choices,
        engine=choices,
        features=choices,
    ),
    "Scene": made(
        lambda **given: Scene(**given).max_band_length,
        {
            "obstacles": SCENE.obstacles,
            "bounds": SCENE.bounds,
            "rope_length": SCENE.rope_length,
            "start": SCENE.start,
            "goal": SCENE.goal,
            "max_stretch": 1.5,
            "name": "own",
        },
        obstacles=choices | numbers,
        bounds=rows(2, 3),
        rope_length=numbers,
        start=rows(2, 3),
        goal=rows(2, 3),
        max_stretch=numbers,
        name=choices,
    ),
    "load_scene": made(load_scene, {"name": "simple_hook"}, name=choices),
    "Box": made(
        Box, {"center": (0, 0, 0), "half_extents": (1, 1, 1)}, center=rows(3), half_extents=rows(3)
    ),
    "Cylinder": made(
        Cylinder,
        {"center": (0, 0, 0), "radius": 0.5, "half_length": 1.0, "axis": 1},
        center=rows(3),
        radius=numbers,
        half_length=numbers,
        axis=numbers,
    ),
    "Capsule": made(
        Capsule,
        {"start": (0, 0, 0), "end": (1, 0, 0), "radius": 0.5},
        start=rows(3),
        end=rows(3),
        radius=numbers,
    ),
    "SphereShape": made(
        SphereShape, {"position": np.zeros(3), "radius": 0.5}, position=rows(3), radius=numbers
    ),
    "BoxShape": made(
        BoxShape,
        {"position": np.zeros(3), "half_extents": np.ones(3), "rotation": np.eye(3)},
        position=rows(3),
        half_extents=rows(3),
        rotation=rows(3, 3),
    ),
    "CylinderShape": made(
        CylinderShape,
        {"position": np.zeros(3), "radius": 0.5, "half_length": 1.0, "rotation": np.eye(3)},
        position=rows(3),
        radius=numbers,
        half_length=numbers,
        rotation=rows(3, 3),
    ),
    "TubeShape": made(
        TubeShape, {"points": np.eye(3), "radius": 0.5}, points=rows(3, 3), radius=numbers
    ),
    "MeshShape": made(
        MeshShape,
        {"vertices": np.eye(3), "faces": np.array([[0, 1, 2]]), "position": np.zeros(3)},
        vertices=rows(3, 3),
        faces=rows(1, 3),
        position=rows(3),
    ),
    "Sphere": made(Sphere, {"center": (0, 0, 0), "radius": 0.5}, center=rows(3), radius=numbers),
    "Box (rotated)": made(
        Box,
        {"center": (0, 0, 0), "half_extents": (1, 1, 1), "rotation": np.eye(3)[[1, 2, 0]]},
        rotation=rows(3, 3),
    ),
    "Cylinder (slanted)": made(
        Cylinder,
        {"center": (0, 0, 0), "radius": 0.5, "half_length": 1.0, "axis": (1.0, 2.0, 3.0)},
        axis=rows(3),
    ),
    "ConvexPolyhedron": made(
        ConvexPolyhedron,
        {"corners": np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])},
        corners=rows(7, 3),
    ),
    "GripperGoal": made(
        GripperGoal, {"gripper": "A", "position": (0, 0, 0)}, gripper=choices, position=rows(3)
    ),
    "Scene (draped)": made(
        lambda **given: Scene(**given).start_rope(),
        {
            "obstacles": (),
            "bounds": SCENE.bounds,
            "rope_length": 3.0,
            "start": SCENE.start,
            "goal": np.tile(SCENE.goal, (2, 1, 1)),
            "start_via": np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]),
        },
        goal=rows(2, 2, 3),
        start_via=rows(2, 3),
    ),
    "Circle": made(
        lambda **given: Circle(**given).outline,
        {"x": 1.0, "y": 2.0, "radius": 0.5},
        x=numbers,
        y=numbers,
        radius=numbers,
    ),
    "ConvexPolygon": made(ConvexPolygon, {"corners": ((0, 0), (1, 0), (0, 1))}, corners=rows(3, 2)),
    "CarScene": made(
        lambda **given: Car(CarScene(**given)).clearance(FREE[None]),
        {"obstacles": (Circle(5.0, 5.0, 0.5),), "bounds": (0.0, 0.0, 8.0, 8.0)},
        obstacles=choices | numbers,
        bounds=rows(4),
    ),
    "random_car_scene": made(random_car_scene, {"random_state": 1}, random_state=seeds),
    "random_rope_scene": Door(
        random_rope_scene, lambda: {"random_state": 1}, {"random_state": seeds}, share=0.1
    ),
    "directions": made(directions, {"angles": [0.0, 1.0]}, angles=rows(2)),
    "to_body_frame": Door(
        to_body_frame,
        lambda: {"poses": np.zeros((2, 3)), "points": np.zeros((2, 2))},
        {"poses": rows(2, 3), "points": rows(2, 2)},
        names={"poses": "(poses|points)"},
    ),
    "from_body_frame": made(
        from_body_frame,
        {"poses": np.zeros((2, 3)), "places": np.zeros((2, 2))},
        poses=rows(2, 3),
        places=rows(2, 2),
    ),
    "motion_in_body_frame": Door(
        motion_in_body_frame,
        lambda: {"poses": np.zeros((2, 3)), "next_poses": np.zeros((2, 3))},
        {"poses": rows(2, 3), "next_poses": rows(2, 3)},
        names={"poses": "(poses|next_poses)"},
    ),
    "ray_distances": made(
        ray_distances,
        {
            "obstacles": lambda points: 1 - points[:, 0],
            "origins": np.zeros((2, 2)),
            "rays": np.eye(2),
            "reach": 2.0,
        },
        obstacles=choices.filter(lambda value: not callable(value)),
        origins=rows(2, 2),
        rays=rows(2, 2),
        reach=numbers,
    ),
    "wrap_columns": made(
        wrap_columns, {"rows": np.ones((2, 3)), "angular": (2,)}, rows=rows(2, 3), angular=choices
    ),
    "shortest_way": made(
        shortest_way,
        {"starts": np.ones((2, 3)), "ends": np.zeros((2, 3)), "angular": (2,)},
        starts=rows(2, 3),
        ends=rows(2, 3),
        angular=choices,
    ),
    "MujocoObstacles": Door(
        obstacles_at,
        lambda: {"model_file": MODEL_FILE, "ignore": (), "height": 0.5, "points": np.ones((2, 2))},
        {
            "model_file": choices,
            "ignore": choices | st.sampled_from([["?"], [None], "wall", ("wall", 1)]),
            "height": numbers,
            "points": rows(2, 2),
        },
        names={"height": "(height|points)"},  # without a height, points have three numbers
    ),
    "MujocoObstacles (rays)": made(
        ray_distances,
        {
            "obstacles": MujocoObstacles(MODEL_FILE),
            "origins": np.zeros((2, 3)),
            "rays": np.eye(3)[:2],
            "reach": 2.0,
        },
        origins=rows(2, 3),
        rays=rows(2, 3),
        reach=numbers,
    ),
    "holding_load": made(
        holding_load,
        {"model_file": MODEL_FILE, "positions": np.zeros((2, 2))},
        model_file=choices,
        positions=rows(2, 2),
    ),
    "has_slot_and_slit": made(has_slot_and_slit, {"scene": SCENE}, scene=choices),
    "check_system": Door(
        check_system,
        lambda: {"system": CAR, "random_state": 0},
        {"system": choices, "random_state": counts},
        share=0.2,
    ),
}


@cases(DOORS)
def test_an_odd_argument_gives_a_sane_result_or_an_error_that_names_it(name, argument):
    try_odd_values(DOORS, name, argument)


@pytest.mark.parametrize("name", DOORS)
def test_numpy_scalars_are_numbers(name):
    try_numpy_numbers(DOORS[name])
