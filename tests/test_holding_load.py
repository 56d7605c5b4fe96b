"""What it takes actuators to hold a robot still, against statics done by hand."""

from pathlib import Path

import numpy as np
import pytest

import systems
from systems import PlanarArm, holding_load

ARM = Path(systems.__file__).parent / "planar_arm" / "planar_arm.xml"
GRAVITY = 9.81


def by_hand(configurations):
    """Torques that hold the arm: each link's weight times how far its middle is from a joint."""
    directions = np.cumsum(configurations, axis=1)
    reach = 0.5 * np.cos(directions)
    joints = np.hstack([np.zeros((len(reach), 1)), np.cumsum(reach, axis=1)[:, :2]])
    middles = joints + reach / 2
    torques = [(middles[:, i:] - joints[:, i : i + 1]).sum(axis=1) for i in range(3)]
    return GRAVITY * np.column_stack(torques)


def test_the_arms_load_is_that_of_its_weights_over_its_servos_limits(rng):
    configurations = rng.uniform(-np.pi, np.pi, size=(50, 3))
    load = holding_load(ARM, configurations)
    np.testing.assert_allclose(load * [9, 40, 40], by_hand(configurations), atol=1e-9)
    alone = np.vstack([holding_load(ARM, row[None]) for row in configurations])
    np.testing.assert_array_equal(load, alone)
    assert holding_load(ARM, configurations[:0]).shape == (0, 3)


def test_what_is_too_heavy_to_hold_is_not_held(rng):
    configurations = rng.uniform(-np.pi, np.pi, size=(60, 3))
    load = np.abs(holding_load(ARM, configurations)).max(axis=1)
    held = PlanarArm().can_hold(configurations)
    # Near the limit, the arm may settle close by.
    assert not held[load > 1.2].any()
    assert held[load < 0.8].all()


SLIDES = """
<mujoco>
  <worldbody>
    <body>
      <joint name="limited twice" type="slide" axis="0 0 1" actuatorfrcrange="-5 20"/>
      <geom size="0.1" mass="1"/>
      <body>
        <joint name="two motors" type="slide" axis="0 0 1" stiffness="3"/>
        <geom size="0.1" mass="1"/>
        <body><joint name="free" type="slide"/><geom size="0.1" mass="1"/></body>
      </body>
    </body>
    <body pos="0 0 5"><freejoint/><geom size="0.1"/></body>
  </worldbody>
  <actuator>
    <motor joint="limited twice" forcerange="-10 10" gear="4"/>
    <motor joint="two motors" forcerange="-10 5" gear="-2"/>
    <motor joint="two motors" forcerange="-1 30"/>
    <motor joint="free"/>
  </actuator>
</mujoco>
"""


def test_limits_are_those_of_joints_and_actuators_and_springs_help(tmp_path):
    file = tmp_path / "slides.xml"
    file.write_text(SLIDES)
    positions = np.zeros((2, 10))
    positions[:, 6] = 1  # the free body's quaternion
    positions[1, 1] = -2.0
    load = holding_load(file, positions)
    weight = 3 * GRAVITY
    spring = 2 * 3.0
    expected = [
        [weight / 20, 2 * GRAVITY / 50],
        [weight / 20, (2 * GRAVITY - spring) / 50],
    ]
    np.testing.assert_allclose(load, expected)


def test_a_load_that_pulls_the_other_way_is_set_against_the_other_limit(tmp_path):
    file = tmp_path / "lift.xml"
    file.write_text(
        '<mujoco><worldbody><body><joint name="a" type="slide" axis="0 0 -1" '
        'actuatorfrcrange="-5 20"/><geom size="0.1" mass="1"/></body></worldbody></mujoco>'
    )
    np.testing.assert_allclose(holding_load(file, [[0.0]]), [[-GRAVITY / 5]])


def test_unfit_questions_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"positions must have the shape \(any, 3\)"):
        holding_load(ARM, np.zeros((2, 4)))
    file = tmp_path / "unlimited.xml"
    file.write_text("<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>")
    with pytest.raises(ValueError, match="must limit the force of a joint"):
        holding_load(file, [[0.0]])
