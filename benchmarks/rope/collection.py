"""Data of the rope's models: the paper's Simple Hook, and scenes drawn at random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planners import BiasedRRT
from reliability import UNRELIABLE, Transitions, collect_transitions
from systems import Problem, Rope, Scene, has_slot_and_slit, load_scene, random_rope_scene

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
    """Transitions of one or more scenes, whose reduced states carry PBD ropes.

    Attributes
    ----------
    scenes : sequence of Scene
        ``transitions.scene`` says which of them a transition is of.
    transitions : Transitions
    """

    scenes: Sequence[Scene]
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
        path=folder / "simple_hook",
        verbose=1,
    )
    return SceneData([rope.scene], transitions)


class RopeWithoutSlackLimit(Rope):
    """A rope whose plans go on where a PBD rope is overstretched: mistakes make good data."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, features="clearance")
        self.max_pbd_rope_length = np.inf


class RopeFromSceneStart(RopeWithoutSlackLimit):
    """A rope whose problems are all the scene's own, as those that a plan is wanted for are."""

    def sample_problem(self, random_state: Any = None) -> Problem:
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
        Plans that an earlier, interrupted run left there are read.
    plan : Round
    estimator : classifier of "clearance" features, or None
        What has been learned so far.
    n_jobs : int

    Returns
    -------
    parts : list of SceneData
        The first plans in hard scenes, and the others; empty if no scene is hard.
    """
    scenes = [random_scene(i) for i in plan.scenes]
    if plan.slotted:
        scenes = [scene for scene in scenes if has_slot_and_slit(scene)]
    if not scenes:
        return []
    seed = plan.scenes.start
    first = _plans_from_start(scenes, None, 1, seed, folder / "first", n_jobs)
    last_step = np.append(np.diff(first.plan) != 0, True)
    hard = first.scene[last_step & (first.y == UNRELIABLE)]
    if not len(hard):
        return []
    hard_scenes = [scenes[i] for i in hard]
    used = estimator if plan.biased else None
    others = _plans_from_start(hard_scenes, used, N_MORE, seed, folder / "others", n_jobs)
    of_hard = np.isin(first.scene, hard)
    return [SceneData(scenes, first[of_hard]), SceneData(hard_scenes, others)]


def random_scene(i: int) -> Scene:
    """Return one of the random scenes that data come from."""
    return random_rope_scene(np.random.SeedSequence([RANDOM_SCENE_SEED, i]))


def _plans_from_start(
    scenes: Sequence[Scene],
    estimator: Any,
    n_each: int,
    seed: int,
    folder: Path,
    n_jobs: int,
) -> Transitions:
    """Collect plans from each scene's own start; a scene that has no room for a rope gives none."""
    return collect_transitions(
        [RopeFromSceneStart(scene) for scene in scenes],
        BiasedRRT(None, estimator, k=K, max_iterations=RANDOM_ITERATIONS),
        n_each * len(scenes),
        on_error="skip",
        n_jobs=n_jobs,
        random_state=np.random.SeedSequence([RANDOM_SCENE_SEED, n_each, seed]),
        path=folder,
        verbose=1,
    )


def as_far_as_allowed(part: SceneData) -> SceneData:
    """Leave out the rest of each plan from its first transition that g does not allow.

    Plans were made with :class:`RopeWithoutSlackLimit`, whose g allows more.
    """
    data = part.transitions
    allowed = np.ones(len(data), dtype=bool)
    for i in np.unique(data.scene):
        rope = Rope(part.scenes[i], features="clearance")
        rows = data.scene == i
        allowed[rows] = rope.propagate(data[rows].reduced, data.command[rows])[1]
    _, plan = np.unique(data.plan, return_inverse=True)
    end = np.full(plan.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(end, plan[~allowed], data.step[~allowed])
    return SceneData(part.scenes, data[data.step < end[plan]])


def described(
    parts: Sequence[SceneData], kind: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Describe the transitions of all parts.

    Returns
    -------
    X, y : ndarray
        Features of the given kind, and labels.
    plan, scene : ndarray of int
        Ids that differ between all plans and between all scenes.
    """
    if kind != "clearance":
        parts = [_of_bands(part) for part in parts]
    rows, scenes, numbers = [], [], {}
    for part in parts:
        ropes = [Rope(scene, features=kind) for scene in part.scenes]
        rows.append(part.transitions.features(ropes))
        of_part = [numbers.setdefault(id(scene), len(numbers)) for scene in part.scenes]
        scenes.append(np.array(of_part)[part.transitions.scene])
    whole = Transitions.concatenate([part.transitions for part in parts])
    return np.concatenate(rows), whole.y, whole.plan, np.concatenate(scenes)


def _of_bands(part: SceneData) -> SceneData:
    """Leave out the PBD ropes of the reduced states, which other features don't know."""
    of_bands = []
    for i in np.unique(part.transitions.scene):
        rope = Rope(part.scenes[i], features="clearance")
        data = part.transitions[part.transitions.scene == i]
        before, after = rope.bands(data.reduced), rope.bands(data.next_reduced)
        of_bands.append(
            Transitions(before, data.command, after, data.y, data.plan, data.step, data.scene)
        )
    return SceneData(part.scenes, Transitions.concatenate(of_bands))
