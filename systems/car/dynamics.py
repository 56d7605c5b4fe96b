"""Compiled dynamics of the car, and the controller that drives it to a target pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from systems.angles import wrap_angle
from systems.car.geometry import CONTACT, WHEELBASE, PackedScene, clearance, clipped
from systems.compilation import compiled

Array = NDArray[np.float64]

# The columns of a state: metres, radians, m/s and radians.
X, Y, HEADING, SPEED, STEERING = range(5)
TIME_STEP = 0.01
LONGEST_COMMAND = 4.0
MAX_SPEED = 2.0
CRUISE_SPEED = 1.2
ARRIVAL_SPEED = 0.3
MAX_ACCELERATION = 2.0
MAX_LATERAL_ACCELERATION = 2.0
MAX_STEERING = 0.55
MAX_STEERING_RATE = 6.0
# A displacement shorter than this, in metres, is the command to brake.
STANDSTILL = 1e-3
# How hard the controller turns towards the arc that leads to the target, per radian.
HEADING_GAIN = 2.5
# Nearer to the target than this, in metres, the controller steers as if it were this far away.
NEAREST_AIM = 0.25
# The largest angle between the direction to the target and the direction of travel there.
LARGEST_APPROACH = 1.2
BISECTIONS = 30


@compiled
def curvature_limit(speed: float) -> float:
    """Return the largest curvature (1/m) at a speed, limited by steering and by grip."""
    tightest = np.tan(MAX_STEERING) / WHEELBASE
    return min(tightest, MAX_LATERAL_ACCELERATION / max(speed * speed, 1e-6))


@compiled
def drive_step(
    state: Array, wanted_speed: float, wanted_curvature: float, duration: float, result: Array
) -> None:
    """Advance the car by one short time, towards a wanted speed and curvature.

    Parameters
    ----------
    state, result : ndarray of shape (5,)
        x, y, θ, v, φ.
    wanted_speed : float
        In m/s; negative is reverse.
    wanted_curvature : float
        Change of heading per metre driven forwards (1/m).
    duration : float
        In seconds.
    """
    limit = curvature_limit(state[SPEED])
    wanted_steering = np.arctan(WHEELBASE * clipped(wanted_curvature, limit))
    turned = clipped(wanted_steering - state[STEERING], MAX_STEERING_RATE * duration)
    accelerated = clipped(wanted_speed - state[SPEED], MAX_ACCELERATION * duration)
    # Where the wheels ask for more than the grip allows, the car follows a wider curve.
    curvature = clipped(np.tan(state[STEERING] + turned) / WHEELBASE, limit)
    way = (state[SPEED] + 0.5 * accelerated) * duration
    middle = state[HEADING] + 0.5 * way * curvature
    result[X] = state[X] + way * np.cos(middle)
    result[Y] = state[Y] + way * np.sin(middle)
    result[HEADING] = wrap_angle(state[HEADING] + way * curvature)
    result[SPEED] = state[SPEED] + accelerated
    result[STEERING] = state[STEERING] + turned


@compiled
def _direction(start: Array, command: Array) -> float:
    """Return 1 to drive forwards to the target, -1 to drive backwards, 0 to brake."""
    if command[X] ** 2 + command[Y] ** 2 < STANDSTILL**2:
        return 0.0
    middle = start[HEADING] + 0.5 * command[HEADING]
    return 1.0 if command[X] * np.cos(middle) + command[Y] * np.sin(middle) >= 0 else -1.0


@compiled
def _controls(state: Array, target: Array, direction: float) -> tuple[float, float]:
    """Return the speed and the curvature that the controller wants.

    The curvature is that of an arc that starts at the car and meets the target in the heading
    wanted there, plus a correction in proportion to the angle between the car's heading and the
    arc's. The speed is what this curvature and the distance left to the target allow.
    """
    if direction == 0:
        return 0.0, 0.0
    if state[SPEED] * direction < 0:
        return direction * CRUISE_SPEED, 0.0
    behind = 0.0 if direction > 0 else np.pi
    dx, dy = target[X] - state[X], target[Y] - state[Y]
    bearing = np.arctan2(dy, dx)
    bend = clipped(wrap_angle(target[HEADING] + behind - bearing), LARGEST_APPROACH)
    error = wrap_angle(bearing - bend - state[HEADING] - behind)
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
    scene: PackedScene,
    result: Array,
) -> None:
    """Find by bisection the last state without contact within a step that ends in contact."""
    low, high = 0.0, duration
    for _ in range(BISECTIONS):
        half = 0.5 * (low + high)
        drive_step(state, speed, curvature, half, result)
        if clearance(result[X], result[Y], result[HEADING], scene) < CONTACT:
            high = half
        else:
            low = half
    drive_step(state, speed, curvature, low, result)


@compiled
def execute_command(
    start: Array, command: Array, scene: PackedScene, result: Array, trace: Array
) -> tuple[bool, int]:
    """Drive from a state towards its pose plus a displacement: Γ, once.

    The drive ends where the car passes its target, after 4 s, or at contact.

    Parameters
    ----------
    start : ndarray of shape (5,)
        Without contact.
    command : ndarray of shape (3,)
    scene : PackedScene
    result : ndarray of shape (5,)
        Receives the last state, which is without contact too.
    trace : ndarray of shape (m, 5)
        Receives the first m states on the way, every 0.01 s.

    Returns
    -------
    completed : bool
        False if the car came to an obstacle or a wall.
    n_traced : int
        How many rows of ``trace`` were filled.
    """
    target = start[:3] + command
    direction = _direction(start, command)
    state, moved = start.copy(), start.copy()
    # How far any point of the car can move before its clearance must be computed again.
    room = 0.0
    to_go = command[X] ** 2 + command[Y] ** 2
    n_traced = 0
    for _ in range(int(LONGEST_COMMAND / TIME_STEP)):
        if direction == 0 and state[SPEED] == 0:
            break
        speed, curvature = _controls(state, target, direction)
        duration = TIME_STEP
        drive_step(state, speed, curvature, duration, moved)
        left = command[X] * (target[X] - moved[X]) + command[Y] * (target[Y] - moved[Y])
        arrives = direction != 0 and left <= 0
        if arrives:
            duration *= min(1.0, max(0.0, to_go / max(to_go - left, 1e-300)))
            drive_step(state, speed, curvature, duration, moved)
        room -= np.hypot(moved[X] - state[X], moved[Y] - state[Y])
        room -= WHEELBASE * abs(wrap_angle(moved[HEADING] - state[HEADING]))
        if room < 0:
            room = clearance(moved[X], moved[Y], moved[HEADING], scene) - CONTACT
        if room < 0:
            _stop_at_contact(state, speed, curvature, duration, scene, result)
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
def execute_commands(start: Array, commands: Array, scene: PackedScene, states: Array) -> int:
    """Execute commands one after the other, until one ends in contact.

    Parameters
    ----------
    start : ndarray of shape (5,)
    commands : ndarray of shape (T, 3)
    scene : PackedScene
    states : ndarray of shape (T + 1, 5)
        Receives the start and the state after each command; the last may be at contact.

    Returns
    -------
    n_completed : int
    """
    states[0] = start
    no_trace = np.empty((0, 5))
    for i in range(commands.shape[0]):
        if not execute_command(states[i], commands[i], scene, states[i + 1], no_trace)[0]:
            return i
    return commands.shape[0]


@compiled
def execute_rows(
    starts: Array, commands: Array, scene: PackedScene
) -> tuple[Array, NDArray[np.bool_]]:
    """Execute one command from each state.

    Parameters
    ----------
    starts : ndarray of shape (n, 5)
    commands : ndarray of shape (n, 3)
    scene : PackedScene

    Returns
    -------
    ends : ndarray of shape (n, 5)
    completed : ndarray of bool of shape (n,)
    """
    ends = np.empty_like(starts)
    completed = np.empty(starts.shape[0], np.bool_)
    no_trace = np.empty((0, 5))
    for row in range(starts.shape[0]):
        completed[row], _ = execute_command(starts[row], commands[row], scene, ends[row], no_trace)
    return ends, completed


@compiled
def trace_commands(start: Array, commands: Array, scene: PackedScene, trace: Array) -> int:
    """Execute commands as :func:`execute_commands`, and record the states on the way.

    Parameters
    ----------
    start : ndarray of shape (5,)
    commands : ndarray of shape (T, 3)
    scene : PackedScene
    trace : ndarray of shape (1 + T * (1 + LONGEST_COMMAND / TIME_STEP), 5)
        Receives the start and the states every 0.01 s.

    Returns
    -------
    n_traced : int
        How many rows of ``trace`` were filled.
    """
    trace[0] = start
    n = 1
    result = start.copy()
    for i in range(commands.shape[0]):
        completed, n_new = execute_command(trace[n - 1], commands[i], scene, result, trace[n:])
        n += n_new
        if not completed:
            trace[n] = result
            return n + 1
    return n
