"""How deep the rope's surface enters obstacles, in the states that Γ returns and on the way.

Run as ``python -m benchmarks.rope.penetration --jobs 2``; ropes are moved in the paper's scenes and
in random ones, in both engines, in three ways:

- ``plans``: plans without a classifier from drawn starts are executed to where they end or stop;
- ``ours``: so are plans with the trained model from the scene's own start;
- ``walks``: the grippers go in straight lines to random places, without a plan, and where something
  stops them they go on to the next place. That drags the rope over every edge, and pulls it taut
  around obstacles, far more often than plans do.

A row tells of the states that were returned, starts and boundary states included: how many there
were, in how many rollouts the engine left the rope deeper than is allowed, which is an error, and
the depth of the rope's surface, in millimetres. "lines" is the depth around straight lines between
the state's nodes instead: the same in MuJoCo, but PyBullet's nodes are the centres of its capsules,
and a line from centre to centre cuts the corner that the capsules bend around. "bands" is the depth
around the states' bands, which are lines that may cut a corner as long as they stay out of it: less
than 10 mm. "on the way" is the depth after any few time steps, of which most are never returned.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import joblib
import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.rope.table1 import COLUMNS
from benchmarks.rope.table1_trials import model_at
from planners import BiasedRRT
from systems import (
    SCENE_NAMES,
    Rope,
    RopeState,
    Scene,
    SimulationDivergedError,
    load_scene,
    random_rope_scene,
)
from systems.rope.obstacles.signed_distance import signed_distance
from systems.rope.scene import ROPE_RADIUS
from systems.rope.simulation.engines import ENGINES
from systems.rope.simulation.pybullet_engine import ORIENTATION

SEED = 2027
POINTS_PER_LINE = 20
N_LEGS = 8
# Without a classifier a plan is found in a few seconds, if there is a way.
SECONDS, SECONDS_WITH_MODEL = 10.0, 60.0
ALLOWED = 0.001


@dataclass
class Depths:
    """Depths in metres, negative where the rope is clear of obstacles."""

    surface: list[float] = field(default_factory=list)
    lines: list[float] = field(default_factory=list)
    bands: list[float] = field(default_factory=list)
    on_the_way: list[float] = field(default_factory=list)
    n_refused: int = 0

    def add(self, other: Depths) -> None:
        """Count another's depths in."""
        self.surface += other.surface
        self.lines += other.lines
        self.bands += other.bands
        self.on_the_way += other.on_the_way
        self.n_refused += other.n_refused


def main(arguments: list[str] | None = None) -> None:
    """Move ropes and print how deep they were."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--engines", nargs="+", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--moves", nargs="+", choices=MOVES, default=list(MOVES))
    parser.add_argument("--scenes", nargs="*", choices=SCENE_NAMES, default=SCENE_NAMES)
    parser.add_argument("--random-scenes", type=int, default=10, help="besides")
    parser.add_argument("--seeds", type=int, default=5, help="of each move in each scene")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    options = parser.parse_args(arguments)
    scenes = [load_scene(name) for name in options.scenes]
    scenes += [_random_scene(number) for number in range(options.random_scenes)]
    cases = list(itertools.product(options.engines, options.moves, scenes))
    found = joblib.Parallel(n_jobs=options.jobs, return_as="generator")(
        joblib.delayed(depths_of)(*case, options.seeds) for case in cases
    )
    print(_HEADER)
    sums: dict[tuple[str, str], Depths] = {}
    for (engine, move, scene), depths in zip(cases, found, strict=True):
        print(_row(engine, move, scene.name, depths), flush=True)
        sums.setdefault((engine, move), Depths()).add(depths)
    for (engine, move), depths in sums.items():
        print(_row(engine, move, "all of these", depths))


def depths_of(engine: str, move: str, scene: Scene, n_seeds: int) -> Depths:
    """Move ropes with several seeds in one scene and engine."""
    depths, rope = Depths(), Rope(scene, engine)
    with _watched(engine, scene, depths.on_the_way):
        for seed in range(n_seeds):
            try:
                for state in MOVES[move](rope, seed):
                    depths.surface.append(line_depth(centre_line(state, scene, engine), scene))
                    depths.lines.append(line_depth(state.nodes, scene))
                    band = rope.reduce(state)[rope.configuration_dim :].reshape(-1, 3)
                    depths.bands.append(line_depth(band, scene))
            except SimulationDivergedError:
                depths.n_refused += 1
            except ValueError:  # there is no room for the rope to start in
                continue
    return depths


def line_depth(line: np.ndarray, scene: Scene) -> float:
    """Return how deep the surface around a line is in an obstacle, metres; negative outside."""
    shares = np.linspace(0.0, 1.0, POINTS_PER_LINE + 1)[:, None, None]
    points = line[:-1] + shares * (line[1:] - line[:-1])
    return ROPE_RADIUS - float(signed_distance(points, scene.packed).min())


def centre_line(state: RopeState, scene: Scene, engine: str) -> np.ndarray:
    """Return points on the rope's own centre line; PyBullet's consists of its capsules' axes."""
    if engine == "mujoco" or state.simulation is None:
        return state.nodes
    turns = Rotation.from_quat(state.simulation[:, ORIENTATION])
    halves = turns.apply([0.0, 0.0, scene.link_length / 2])
    return np.stack([state.nodes - halves, state.nodes + halves], axis=1).reshape(-1, 3)


def walk(rope: Rope, seed: int, n_legs: int = N_LEGS) -> Iterator[RopeState]:
    """Move a rope to random places in turn, from a drawn start, and yield its states."""
    rng = np.random.default_rng([SEED, seed])
    state = rope.sample_problem(rng).start
    yield state
    for target in rope.sample_configurations(rng, n_legs):
        way = target - state.grippers.ravel()
        n_steps = int(np.ceil(np.linalg.norm(way) / rope.step_size))
        rollout = rope.rollout(state, np.tile(way / n_steps, (n_steps, 1)))
        yield from rollout.states[1:]
        state = rollout.states[-1]


def drawn_plan(rope: Rope, seed: int) -> Iterator[RopeState]:
    """Execute a plan without a classifier from a drawn start, and yield its states."""
    problem = rope.sample_problem(np.random.SeedSequence([SEED, seed]))
    planner = BiasedRRT(rope, time_limit=SECONDS, random_state=seed)
    plan = planner.plan(rope.reduce(problem.start), problem.goal)
    yield from rope.rollout(problem.start, plan.commands).states


def model_plan(rope: Rope, seed: int) -> Iterator[RopeState]:
    """Execute a plan with the trained model from the scene's start, and yield its states."""
    model = model_at(COLUMNS["ours"])
    planned = Rope(rope.scene, features=model.provenance_["features"])
    problem = planned.scene_problem()
    planner = BiasedRRT(planned, model, k=10.0, time_limit=SECONDS_WITH_MODEL, random_state=seed)
    plan = planner.plan(planned.reduce(problem.start), problem.goal)
    yield from rope.rollout(rope.scene_problem().start, plan.commands).states


MOVES: dict[str, Callable[[Rope, int], Iterator[RopeState]]] = {
    "plans": drawn_plan,
    "ours": model_plan,
    "walks": walk,
}


@contextmanager
def _watched(engine: str, scene: Scene, depths: list[float]) -> Iterator[None]:
    """Note the depth of ropes whose engine starts meanwhile each time that it made a few steps."""
    start_engine = ENGINES[engine]

    def start(*arguments: object) -> object:
        simulated = start_engine(*arguments)
        step = simulated.step

        def watched_step(n_steps: int) -> None:
            step(n_steps)
            depths.append(line_depth(simulated.centre_line(), scene))

        simulated.step = watched_step
        return simulated

    ENGINES[engine] = start
    try:
        yield
    finally:
        ENGINES[engine] = start_engine


def _random_scene(number: int) -> Scene:
    return random_rope_scene(np.random.SeedSequence([SEED, number]))


_HEADER = (
    f"{'engine':9}{'move':7}{'scene':23}{'states':>7}{'errors':>7}{'deepest':>9}{'99.9 %':>8}"
    f"{'99 %':>7}{'> 1 mm':>8}{'lines':>8}{'bands':>8}{'on the way: deepest':>21}{'> 1 mm':>8}"
)


def _row(engine: str, move: str, scene: str, depths: Depths) -> str:
    if not depths.surface:
        return f"{engine:9}{move:7}{scene:23}{0:7}{depths.n_refused:7}"
    surface, way = np.array(depths.surface), np.array(depths.on_the_way)
    high, higher = 1e3 * np.percentile(surface, [99.0, 99.9])
    return (
        f"{engine:9}{move:7}{scene:23}{len(surface):7}{depths.n_refused:7}"
        f"{1e3 * surface.max():9.2f}{higher:8.2f}{high:7.2f}{(surface > ALLOWED).mean():8.2%}"
        f"{1e3 * max(depths.lines):8.2f}{1e3 * max(depths.bands):8.2f}"
        f"{1e3 * way.max():21.2f}{(way > ALLOWED).mean():8.2%}"
    )


if __name__ == "__main__":
    main()
