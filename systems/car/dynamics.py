"""Compiled dynamics of the car and the controller that carries out its commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.car.geometry import CONTACT, WHEELBASE, clearance
from systems.compilation import compiled

Array = NDArray[np.float64]

TIME_STEP = 0.01
LONGEST_COMMAND = 4.0
MAX_SPEED = 2.0
CRUISE_SPEED = 1.2
ARRIVAL_SPEED = 0.3
MAX_ACCELERATION = 2.0
MAX_LATERAL_ACCELERATION = 2.0
MAX_STEERING = 0.55
MAX_STEERING_RATE = 6.0
STANDSTILL = 1e-3
HEADING_GAIN = 2.5
NEAREST_AIM = 0.25
LARGEST_APPROACH = 1.2
BISECTIONS = 30


@compiled
def _clip(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))


@compiled
def curvature_limit(speed: float) -> float:
    """Return the tightest curvature at a speed, limited by steering and by grip."""
    tightest = np.tan(MAX_STEERING) / WHEELBASE
    return min(tightest, MAX_LATERAL_ACCELERATION / max(speed * speed, 1e-6))


@compiled
def drive_step(
    state: Array, wanted_speed: float, wanted_curvature: float, duration: float, result: Array
) -> None:
    """Advance the car by one short time.

    Parameters
    ----------
    state, result : ndarray of shape (5,)
        x, y, θ, v, φ.
    wanted_speed : float
        Signed; negative is reverse.
    wanted_curvature : float
        dθ per metre of driving forwards.
    duration : float
    """
    limit = curvature_limit(state[3])
    wanted_steering = np.arctan(WHEELBASE * _clip(wanted_curvature, limit))
    turned = _clip(wanted_steering - state[4], MAX_STEERING_RATE * duration)
    accelerated = _clip(wanted_speed - state[3], MAX_ACCELERATION * duration)
    # Beyond its grip the car slides wide, wherever its wheels point.
    curvature = _clip(np.tan(state[4] + turned) / WHEELBASE, limit)
    way = (state[3] + 0.5 * accelerated) * duration
    middle = state[2] + 0.5 * way * curvature
    result[0] = state[0] + way * np.cos(middle)
    result[1] = state[1] + way * np.sin(middle)
    result[2] = wrap_angle(state[2] + way * curvature)
    result[3] = state[3] + accelerated
    result[4] = state[4] + turned


@compiled
def _direction(start: Array, command: Array) -> float:
    """Return 1 where the car drives forwards to its target, -1 for backwards, 0 to stand still."""
    if command[0] ** 2 + command[1] ** 2 < STANDSTILL**2:
        return 0.0
    middle = start[2] + 0.5 * command[2]
    return 1.0 if command[0] * np.cos(middle) + command[1] * np.sin(middle) >= 0 else -1.0


@compiled
def _controls(state: Array, target: Array, direction: float) -> tuple[float, float]:
    """Return the wanted speed and curvature.

    The curvature is that of the circle through here that arrives at the target in the right
    direction of travel, and a pull towards that circle's own direction. Speed is lowered to
    what that curvature allows, and to 0.3 m/s at the target.
    """
    if direction == 0:
        return 0.0, 0.0
    if state[3] * direction < 0:
        return direction * CRUISE_SPEED, 0.0
    behind = 0.0 if direction > 0 else np.pi
    dx, dy = target[0] - state[0], target[1] - state[1]
    bearing = np.arctan2(dy, dx)
    bend = _clip(wrap_angle(target[2] + behind - bearing), LARGEST_APPROACH)
    error = wrap_angle(bearing - bend - state[2] - behind)
    distance = np.hypot(dx, dy)
    curvature = (2 * np.sin(bend) + HEADING_GAIN * error) / max(NEAREST_AIM, distance)
    tight = max(min(abs(curvature), curvature_limit(0.0)), 1e-6)
    slowing = np.sqrt(ARRIVAL_SPEED**2 + 2 * MAX_ACCELERATION * distance)
    speed = min(CRUISE_SPEED, slowing, np.sqrt(MAX_LATERAL_ACCELERATION / tight))
    return direction * speed, direction * curvature


@compiled
def _stop_at_contact(
    state: Array,
    speed: float,
    curvature: float,
    duration: float,
    hulls: Array,
    corners: Array,
    walls: Array,
    result: Array,
) -> None:
    """Bisect the step from a free state to a touching one; the result is free."""
    low, high = 0.0, duration
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        drive_step(state, speed, curvature, half, result)
        if clearance(result[0], result[1], result[2], hulls, corners, walls) < CONTACT:
            high = half
        else:
            low = half
    drive_step(state, speed, curvature, low, result)


@compiled
def execute_command(
    start: Array,
    command: Array,
    hulls: Array,
    corners: Array,
    walls: Array,
    result: Array,
    trace: Array,
) -> tuple[bool, int]:
    """Drive from a state towards its pose plus a displacement: Γ, once.

    Ends where the car passes its target, after 4 s, or at the boundary of an obstacle.

    Parameters
    ----------
    start : ndarray of shape (5,)
        Touches nothing.
    command : ndarray of shape (3,)
    hulls, corners, walls : ndarray
        The scene, packed.
    result : ndarray of shape (5,)
        Receives the last state, which touches nothing either.
    trace : ndarray of shape (m, 5)
        Receives the first m states on the way, every 0.01 s.

    Returns
    -------
    completed : bool
        False if the car came to a boundary.
    n_traced : int
    """
    target = start[:3] + command
    direction = _direction(start, command)
    state, moved = start.copy(), start.copy()
    # How far the car may move before its clearance must be looked at again.
    room = 0.0
    to_go = command[0] ** 2 + command[1] ** 2
    n_traced = 0
    for _ in range(int(LONGEST_COMMAND / TIME_STEP)):
        if direction == 0 and state[3] == 0:
            break
        speed, curvature = _controls(state, target, direction)
        duration = TIME_STEP
        drive_step(state, speed, curvature, duration, moved)
        left = command[0] * (target[0] - moved[0]) + command[1] * (target[1] - moved[1])
        arrives = direction != 0 and left <= 0
        if arrives:
            duration *= min(1.0, max(0.0, to_go / max(to_go - left, 1e-300)))
            drive_step(state, speed, curvature, duration, moved)
        room -= np.hypot(moved[0] - state[0], moved[1] - state[1])
        room -= WHEELBASE * abs(wrap_angle(moved[2] - state[2]))
        if room < 0:
            room = clearance(moved[0], moved[1], moved[2], hulls, corners, walls) - CONTACT
        if room < 0:
            _stop_at_contact(state, speed, curvature, duration, hulls, corners, walls, result)
            return False, n_traced
        state[:] = moved
        if n_traced < trace.shape[0]:
            trace[n_traced] = state
            n_traced += 1
        to_go = left
        if arrives:
            break
    result[:] = state
    return True, n_traced


@compiled
def execute_commands(
    start: Array, commands: Array, hulls: Array, corners: Array, walls: Array, states: Array
) -> int:
    """Execute commands in turn until one comes to a boundary.

    Parameters
    ----------
    start : ndarray of shape (5,)
    commands : ndarray of shape (T, 3)
    hulls, corners, walls : ndarray
        The scene, packed.
    states : ndarray of shape (T + 1, 5)
        Receives the start and the state after each command, the last of them at the boundary.

    Returns
    -------
    n_completed : int
    """
    states[0] = start
    no_trace = np.empty((0, 5))
    for i in range(commands.shape[0]):
        if not execute_command(
            states[i], commands[i], hulls, corners, walls, states[i + 1], no_trace
        )[0]:
            return i
    return commands.shape[0]


@compiled
def execute_rows(
    starts: Array, commands: Array, hulls: Array, corners: Array, walls: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Execute one command from each state; return the last states and which were completed."""
    ends = np.empty_like(starts)
    completed = np.empty(starts.shape[0], np.bool_)
    no_trace = np.empty((0, 5))
    for row in range(starts.shape[0]):
        completed[row], _ = execute_command(
            starts[row], commands[row], hulls, corners, walls, ends[row], no_trace
        )
    return ends, completed


@compiled
def trace_commands(
    start: Array, commands: Array, hulls: Array, corners: Array, walls: Array, trace: Array
) -> int:
    """Execute commands in turn as :func:`execute_commands`, and record the states on the way.

    Parameters
    ----------
    trace : ndarray of shape (1 + T * (1 + LONGEST_COMMAND / TIME_STEP), 5)

    Returns
    -------
    n_traced : int
    """
    trace[0] = start
    n = 1
    result = start.copy()
    for i in range(commands.shape[0]):
        completed, n_new = execute_command(
            trace[n - 1], commands[i], hulls, corners, walls, result, trace[n:]
        )
        n += n_new
        if not completed:
            trace[n] = result
            return n + 1
    return n
