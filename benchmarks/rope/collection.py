"""Data of the rope's models: the paper's Simple Hook, and scenes drawn at random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from planners import BiasedRRT
from reliability import RELIABLE, Transitions, collect_transitions
from systems import Problem, Rope, Scene, random_rope_scene
from systems.rope.paper_scenes import load_scene
from systems.rope.random_scenes import has_slot_and_slit
from systems.validation import RandomState

PAPER_SEED = 2020
RANDOM_SCENE_SEED = 2021
N_PLANS = 1500
PAPER_ITERATIONS = 10**5
# A random scene may have no way through: giving up costs as much as a few plans.
RANDOM_ITERATIONS = 4000
# Plans in a random scene besides the first.
N_MORE = 2
K = 10.0


@dataclass(frozen=True)
class SceneData:
    """Transitions of one scene, whose reduced states carry PBD ropes."""

    scene: Scene
    transitions: Transitions


def collect_simple_hook(folder: Path, n_plans: int, n_jobs: int) -> SceneData:
    """Collect as the paper does: one scene, many starts, no classifier."""
    rope = RopeWithoutSlackLimit(load_scene("simple_hook"))
    transitions = collect_transitions(
        rope,
        BiasedRRT(rope, max_iterations=PAPER_ITERATIONS),
        n_plans,
        n_jobs=n_jobs,
        random_state=PAPER_SEED,
        path=folder / f"simple_hook-{n_plans}",
        verbose=1,
    )
    return SceneData(rope.scene, transitions)


class RopeWithoutSlackLimit(Rope):
    """A rope whose plans go on where a PBD rope is overstretched: mistakes make good data."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, features="clearance")
        self.max_pbd_rope_length = np.inf


class RopeFromSceneStart(RopeWithoutSlackLimit):
    """A rope whose problems are all the scene's own, as those that a plan is wanted for are."""

    def sample_problem(self, random_state: RandomState = None) -> Problem:
        """Return the scene's start and goal, whatever the random state."""
        return self.scene_problem()


@dataclass(frozen=True)
class Round:
    """Which random scenes to plan in, whether with a classifier, and whether only in slotted ones.

    Few random scenes pull the rope through a slot and a slit at once. There it rests on an edge and
    drags behind, which needs examples of its own.
    """

    scenes: range
    biased: bool
    slotted: bool = False


def collect_random_scenes(
    folder: Path, plan: Round, estimator: Any, n_jobs: int
) -> list[SceneData]:
    """Collect a few plans in each of the random scenes that are hard.

    A scene is hard if its first plan, without a classifier, goes wrong. Scenes in which no plan is
    found are left out.

    Parameters
    ----------
    folder : Path
        Holds a file per scene; those that are there are read.
    plan : Round
    estimator : classifier of curtains, or None
        What has been learned so far.
    n_jobs : int
    """
    folder.mkdir(parents=True, exist_ok=True)
    tasks = (joblib.delayed(_collect_scene)(folder, i, plan, estimator) for i in plan.scenes)
    found = joblib.Parallel(n_jobs=n_jobs, verbose=5)(tasks)
    return [data for data in found if data is not None]


def random_scene(i: int) -> Scene:
    """Return one of the random scenes that data come from."""
    return random_rope_scene(np.random.SeedSequence([RANDOM_SCENE_SEED, i]))


def _collect_scene(folder: Path, i: int, plan: Round, estimator: Any) -> SceneData | None:
    rope = RopeFromSceneStart(random_scene(i))
    file, empty = folder / f"scene-{i:05d}.npz", folder / f"scene-{i:05d}.empty"
    if empty.exists() or (plan.slotted and not has_slot_and_slit(rope.scene)):
        return None
    if not file.exists():
        first = _plans_from_start(rope, None, 1, i)
        if first is None or first.y[-1] == RELIABLE:
            empty.touch()
            return None
        others = _plans_from_start(rope, estimator if plan.biased else None, N_MORE, i)
        if others is not None:
            others.plan += 1
        Transitions.concatenate([first] if others is None else [first, others]).save(file)
    return SceneData(rope.scene, Transitions.load(file))


def _plans_from_start(
    rope: RopeFromSceneStart, estimator: Any, n_plans: int, i: int
) -> Transitions | None:
    """Collect, or return None if there is no room for a rope or no way through."""
    planner = BiasedRRT(rope, estimator, k=K, max_iterations=RANDOM_ITERATIONS)
    seed = np.random.SeedSequence([RANDOM_SCENE_SEED, n_plans, i])
    try:
        return collect_transitions(rope, planner, n_plans, random_state=seed)
    except ValueError:
        return None


def as_far_as_allowed(part: SceneData) -> SceneData:
    """Leave out what each plan did from where g allows it only to ropes that go on."""
    rope, transitions = Rope(part.scene, features="clearance"), part.transitions
    kept = [np.arange(0)]
    for plan in np.unique(transitions.plan):
        rows = np.flatnonzero(transitions.plan == plan)
        _, valid = rope.propagate(transitions[rows].reduced, transitions.command[rows])
        kept.append(rows if valid.all() else rows[: np.argmin(valid)])
    return SceneData(part.scene, transitions[np.concatenate(kept)])


def described(parts: Sequence[SceneData], kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the features, labels and plans of all parts; plan ids differ between scenes."""
    rows, labels, plans, first = [], [], [], 0
    for part in parts:
        transitions = part.transitions if kind == "clearance" else _of_bands(part)
        rows.append(transitions.features(Rope(part.scene, features=kind)))
        labels.append(part.transitions.y)
        plans.append(part.transitions.plan + first)
        first = int(plans[-1].max(initial=first - 1)) + 1
    return np.concatenate(rows), np.concatenate(labels), np.concatenate(plans)


def _of_bands(part: SceneData) -> Transitions:
    rope, data = Rope(part.scene, features="clearance"), part.transitions
    before, after = rope.bands(data.reduced), rope.bands(data.next_reduced)
    return Transitions(before, data.command, after, data.y, data.plan, data.step)
