"""The rope in PyBullet, the paper's engine: capsules joined end to end in maximal coordinates."""

from __future__ import annotations

import uuid
import weakref
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np

from systems.extras import needing
from systems.rope.obstacles.obstacle import Obstacle
from systems.rope.obstacles.polyhedron import ConvexPolyhedron
from systems.rope.obstacles.shapes import Array, Box, Cylinder, Sphere
from systems.rope.scene import ROPE_RADIUS
from systems.rope.simulation.state import RopeState

SCALE = 10.0  # engine lengths per metre, since its contact margins suit bodies of that size
TIME_STEP = 0.01
GRAVITY = 9.8  # engine lengths, hence 0.98 m/s²
SOLVER_ITERATIONS = 20
LINK_MASS = 0.1
LINEAR_DAMPING = 0.75
ANGULAR_DAMPING = 0.9
FRICTION = 1.0
ROPE_GROUP, OBSTACLE_GROUP = 64, 2  # PyBullet puts static bodies into group 2

# ``RopeState.simulation`` has a row for each node: its orientation, as a quaternion x, y, z, w; its
# velocity, in engine lengths; and its angular velocity.
ORIENTATION, VELOCITY, ANGULAR_VELOCITY = slice(0, 4), slice(4, 7), slice(7, 10)
SIMULATION_WIDTH = 10

_MARK = "transition-reliability"

UPRIGHT = [0.0, 0.0, 0.0, 1.0]
ORIGIN = [0.0, 0.0, 0.0]


class PybulletRope:
    """A rope of ``n_nodes`` capsules, whose centres are ``spacing`` metres apart at rest.

    Neighbours are joined, and the grippers hold the centres of both end capsules, by
    point-to-point constraints, which give way when the rope is stretched. Every state is loaded
    into a new simulator, so that the same states and moves always give the same result. PyBullet
    does not expose its contact cache, so an execution that goes on from a saved state differs from
    one without the stop, by less than a millimetre.

    Parameters
    ----------
    obstacles : sequence of obstacles
    n_nodes : int
    spacing : float
        Metres.
    """

    def __init__(self, obstacles: Sequence[Obstacle], n_nodes: int, spacing: float) -> None:
        self._bullet = _import_pybullet()
        self._obstacles = tuple(obstacles)
        self._n_nodes = n_nodes
        self._spacing = spacing * SCALE
        self._ends = [0.0, 0.0, -self._spacing / 2], [0.0, 0.0, self._spacing / 2]
        self._disconnect: Any = lambda: None

    def load(self, state: RopeState) -> None:
        """Take over a state; one without ``simulation`` starts at rest."""
        if state.simulation is not None and state.simulation.shape != (
            self._n_nodes,
            SIMULATION_WIDTH,
        ):
            raise ValueError(
                "state must come from a rope of this length with the engine 'pybullet', got a "
                f"simulation of shape {state.simulation.shape}; pass simulation=None to start "
                "from its nodes at rest."
            )
        self._start_simulator()
        for obstacle in self._obstacles:
            self._add_obstacle(obstacle)
        self._add_rope(state)
        self._add_grippers(state.grippers)

    def save(self) -> RopeState:
        """Return the present state."""
        bullet, client = self._bullet, self._client
        poses = [bullet.getBasePositionAndOrientation(link, client) for link in self._links]
        speeds = [bullet.getBaseVelocity(link, client) for link in self._links]
        nodes = np.array([position for position, _ in poses]) / SCALE
        simulation = np.array(
            [
                (*turn, *linear, *angular)
                for (_, turn), (linear, angular) in zip(poses, speeds, strict=True)
            ]
        )
        return RopeState(self._held.copy(), nodes, simulation)

    def centre_line(self) -> Array:
        """Return both ends of the axis of each capsule in turn, of shape (2 * n_nodes, 3)."""
        bullet, client = self._bullet, self._client
        poses = [bullet.getBasePositionAndOrientation(link, client) for link in self._links]
        ends = [
            bullet.multiplyTransforms(*pose, end, UPRIGHT)[0]
            for pose in poses
            for end in self._ends
        ]
        return np.array(ends) / SCALE

    def move_grippers(self, grippers: Array) -> None:
        """Put the grippers, of shape (2, 3), where they are to be."""
        for body, position in zip(self._grippers, (grippers * SCALE).tolist(), strict=True):
            self._bullet.resetBasePositionAndOrientation(body, position, UPRIGHT, self._client)
        self._held[:] = grippers

    def step(self, n_steps: int) -> None:
        """Advance by some time steps."""
        for _ in range(n_steps):
            self._bullet.stepSimulation(self._client)

    def _start_simulator(self) -> None:
        bullet = self._bullet
        self._disconnect()
        self._client = bullet.connect(bullet.DIRECT)
        if self._client < 0:
            raise RuntimeError(
                "PyBullet has no free physics client: it can hold 64 at a time. Disconnect some, "
                "or simulate in fewer threads."
            )
        self._disconnect = weakref.finalize(self, _disconnect, bullet, self._client, self._mark())
        bullet.setGravity(0.0, 0.0, -GRAVITY, self._client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP,
            numSolverIterations=SOLVER_ITERATIONS,
            deterministicOverlappingPairs=1,
            physicsClientId=self._client,
        )
        # Nothing is drawn, but without a simple shape to draw PyBullet makes a mesh of every body,
        # which is four times slower.
        self._drawn = bullet.createVisualShape(
            bullet.GEOM_BOX, halfExtents=[ROPE_RADIUS] * 3, physicsClientId=self._client
        )

    def _mark(self) -> tuple[int, str]:
        """Add an empty body with a name to the client, and return its number and the name.

        PyBullet numbers its clients, and uses a number again as soon as it is free. If the user
        disconnected ours, the same number may be the user's own client by now.
        """
        bullet, name = self._bullet, uuid.uuid4().hex
        body = bullet.createMultiBody(0.0, -1, -1, physicsClientId=self._client)
        bullet.addUserData(body, _MARK, name, physicsClientId=self._client)
        return body, name

    def _add_obstacle(self, obstacle: Obstacle) -> None:
        bullet, client = self._bullet, self._client
        center, turn, size = _collision_shape(bullet, obstacle)
        shape = bullet.createCollisionShape(**size, physicsClientId=client)
        body = bullet.createMultiBody(
            0.0, shape, self._drawn, (SCALE * center).tolist(), turn, physicsClientId=client
        )
        bullet.changeDynamics(body, -1, lateralFriction=FRICTION, physicsClientId=client)

    def _add_rope(self, state: RopeState) -> None:
        bullet, client = self._bullet, self._client
        shape = bullet.createCollisionShape(
            bullet.GEOM_CAPSULE,
            radius=SCALE * ROPE_RADIUS,
            height=self._spacing,
            physicsClientId=client,
        )
        rows = _at_rest(state.nodes) if state.simulation is None else state.simulation
        places = (SCALE * state.nodes).tolist()
        self._links = [
            self._add_link(shape, place, row.tolist())
            for place, row in zip(places, rows, strict=True)
        ]
        tail, tip = self._ends
        for link, following in zip(self._links[:-1], self._links[1:], strict=True):
            self._join(link, following, tip, tail)

    def _add_link(self, shape: int, place: list[float], row: list[float]) -> int:
        bullet, client = self._bullet, self._client
        link: int = bullet.createMultiBody(
            LINK_MASS,
            shape,
            self._drawn,
            place,
            row[ORIENTATION],
            useMaximalCoordinates=1,
            physicsClientId=client,
        )
        bullet.changeDynamics(
            link,
            -1,
            lateralFriction=FRICTION,
            linearDamping=LINEAR_DAMPING,
            angularDamping=ANGULAR_DAMPING,
            physicsClientId=client,
        )
        bullet.setCollisionFilterGroupMask(link, -1, ROPE_GROUP, OBSTACLE_GROUP, client)
        bullet.resetBaseVelocity(link, row[VELOCITY], row[ANGULAR_VELOCITY], client)
        return link

    def _add_grippers(self, grippers: Array) -> None:
        self._held = grippers.copy()
        self._grippers = []
        for place, link in zip(grippers, (self._links[0], self._links[-1]), strict=True):
            gripper = self._bullet.createMultiBody(
                0.0,
                -1,
                self._drawn,
                (SCALE * place).tolist(),
                useMaximalCoordinates=1,
                physicsClientId=self._client,
            )
            self._join(gripper, link, ORIGIN, ORIGIN)
            self._grippers.append(gripper)

    def _join(self, one: int, other: int, on_one: list[float], on_other: list[float]) -> None:
        bullet = self._bullet
        bullet.createConstraint(
            one,
            -1,
            other,
            -1,
            bullet.JOINT_POINT2POINT,
            ORIGIN,
            on_one,
            on_other,
            physicsClientId=self._client,
        )


def _disconnect(bullet: ModuleType, client: int, mark: tuple[int, str]) -> None:
    """Disconnect a client, unless its number is another client's by now."""
    body, name = mark
    if not bullet.isConnected(client):
        return
    found = bullet.getUserDataId(body, _MARK, physicsClientId=client)
    if found >= 0 and bullet.getUserData(found, physicsClientId=client) == name.encode():
        bullet.disconnect(client)


def _import_pybullet() -> ModuleType:
    with needing("pybullet", 'Rope(engine="pybullet")'):
        import pybullet
    return pybullet


def _collision_shape(
    bullet: ModuleType, obstacle: Obstacle
) -> tuple[Array, list[float], dict[str, Any]]:
    """Return an obstacle's centre, orientation and arguments of ``createCollisionShape``."""
    if isinstance(obstacle, Box):
        half_extents = [SCALE * extent for extent in obstacle.half_extents]
        turn = _turn_of(np.array(obstacle.rotation)) if obstacle.is_rotated else UPRIGHT
        size = {"shapeType": bullet.GEOM_BOX, "halfExtents": half_extents}
        return np.array(obstacle.center), turn, size
    if isinstance(obstacle, ConvexPolyhedron):
        corners = np.array(obstacle.corners)
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        vertices = (SCALE * (corners - center)).tolist()
        return center, UPRIGHT, {"shapeType": bullet.GEOM_MESH, "vertices": vertices}
    size = {"radius": SCALE * obstacle.radius}
    if isinstance(obstacle, Sphere):
        return np.array(obstacle.center), UPRIGHT, {"shapeType": bullet.GEOM_SPHERE, **size}
    if isinstance(obstacle, Cylinder):
        center, axis = np.array(obstacle.center), obstacle.direction
        length, kind = 2 * obstacle.half_length, bullet.GEOM_CYLINDER
    else:
        start, end = np.array(obstacle.start), np.array(obstacle.end)
        length, kind = float(np.linalg.norm(end - start)), bullet.GEOM_CAPSULE
        center, axis = (start + end) / 2, (end - start) / length
    turn = _turns_from_z(axis[None])[0].tolist()
    return center, turn, {"shapeType": kind, **size, "height": SCALE * length}


def _turn_of(rotation: Array) -> list[float]:
    """Return a rotation matrix as a quaternion x, y, z, w."""
    from scipy.spatial.transform import Rotation

    turn: list[float] = Rotation.from_matrix(rotation).as_quat().tolist()
    return turn


def _at_rest(nodes: Array) -> Array:
    rows = np.zeros((len(nodes), SIMULATION_WIDTH))
    along = np.gradient(nodes, axis=0)
    lengths = np.linalg.norm(along, axis=1, keepdims=True)
    rows[:, ORIENTATION] = _turns_from_z(along / np.maximum(lengths, 1e-12))
    return rows


def _turns_from_z(directions: Array) -> Array:
    # The shortest turn from z to d is the quaternion (z × d, 1 + z·d), normalised.
    x, y, z = directions.T
    turns = np.column_stack([-y, x, np.zeros_like(x), 1.0 + z])
    turns[z < -1.0 + 1e-9] = (1.0, 0.0, 0.0, 0.0)
    return turns / np.linalg.norm(turns, axis=1, keepdims=True)
