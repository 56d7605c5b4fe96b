"""Data of the rope's models: the paper's Simple Hook, and scenes drawn at random."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from planners import BiasedRRT
from reliability import Item, Job, ResumableStore, Transitions, collect_transitions, run_jobs
from systems import (
    Problem,
    Rollout,
    Rope,
    RopeStopReason,
    Scene,
    SimulationDivergedError,
    has_slot_and_slit,
    load_scene,
    random_rope_scene,
)

PAPER_SEED = 2020
RANDOM_SCENE_SEED = 2021
PAPER_ITERATIONS = 10**5
# A random scene may have no way through: giving up costs as much as a few plans.
RANDOM_ITERATIONS = 4000


class RopeWithoutSlackLimit(Rope):
    """A rope whose plans go on where a PBD rope is overstretched: mistakes make good data."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, features="clearance")
        self.max_pbd_rope_length = np.inf


class TrainingRope(RopeWithoutSlackLimit):
    """A rope whose plans may go on, and whose executions end where the rope's own g forbids it.

    Plans for :class:`systems.Rope` have no such transitions, and none is learned from.

    Parameters
    ----------
    scene : Scene
    from_scene_start : bool
        Whether all problems are the scene's own, as those that a plan is wanted for are.
    """

    def __init__(self, scene: Scene, from_scene_start: bool) -> None:
        super().__init__(scene)
        self.from_scene_start = from_scene_start

    def sample_problem(self, random_state: Any = None) -> Problem:
        """Return the scene's start and goal, whatever the random state, or other ones."""
        if self.from_scene_start:
            return self.scene_problem()
        return super().sample_problem(random_state)

    def rollout(self, state: Any, commands: Any) -> Rollout:
        """Carry out displacements up to the first that the rope's own g forbids."""
        n_allowed = self._n_allowed(state, commands)
        rollout = super().rollout(state, commands[:n_allowed])
        if rollout.n_completed < n_allowed or n_allowed == len(commands):
            return rollout
        return replace(rollout, stop_reason=RopeStopReason.OVERSTRETCHED)

    def _n_allowed(self, state: Any, commands: np.ndarray) -> int:
        limited, reduced = Rope(self.scene, features=self.feature_kind), self.reduce(state)[None]
        for number, command in enumerate(commands):
            reduced, allowed = limited.propagate(reduced, command[None])
            if not allowed[0]:
                return number
        return len(commands)


class TrainingScenes:
    """The family of scenes that ours learns in: call it with a random state for one of them.

    Every other random state gives Simple Hook, from starts that are drawn. The others give a
    random scene, from its own start, that is hard: its first plan, without a classifier, goes
    wrong. In half of these the rope has to pass a slot and a slit at once. There it rests on an
    edge and drags behind, which needs examples of its own; few random scenes have both.

    Parameters
    ----------
    folder : Path
        Where it is kept which scenes are hard, since telling takes a plan and its execution.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def describe(self) -> dict[str, Any]:
        """Return what the scenes depend on."""
        return {"seed": RANDOM_SCENE_SEED, "iterations": RANDOM_ITERATIONS}

    def __call__(self, random_state: int) -> TrainingRope:
        """Return the rope in a scene."""
        if random_state % 2:
            return TrainingRope(load_scene("simple_hook"), from_scene_start=False)
        store = ResumableStore(self.folder, "numbers of hard random scenes", self.describe())
        job = Job(f"hard-{random_state}", _HardScene(random_state), store)
        return random_rope(random_state, run_jobs([job], n_jobs=1)[0].facts["number"])


class _HardScene:
    """Looks for the first hard scene of a random state."""

    def __init__(self, random_state: int) -> None:
        self.random_state = random_state

    def __call__(self) -> Item:
        slotted, number = self.random_state % 4 == 0, 0
        while True:
            rope = random_rope(self.random_state, number)
            if (has_slot_and_slit(rope.scene) or not slotted) and goes_wrong(rope):
                return Item({"number": number})
            number += 1


def random_rope(random_state: int, number: int) -> TrainingRope:
    """Return a rope in one of the random scenes that data may come from."""
    seed = np.random.SeedSequence([RANDOM_SCENE_SEED, random_state, number])
    return TrainingRope(random_rope_scene(seed), from_scene_start=True)


def goes_wrong(rope: TrainingRope) -> bool:
    """Say whether there is a plan without a classifier, and its execution fails."""
    try:
        problem = rope.sample_problem()
        planner = BiasedRRT(rope, max_iterations=RANDOM_ITERATIONS, random_state=0)
        plan = planner.plan(rope.reduce(problem.start), problem.goal)
        if not plan.success:
            return False
        rollout = rope.rollout(problem.start, plan.commands)
    except (ValueError, SimulationDivergedError):
        return False  # No room for the rope.
    completed = rollout.n_completed == len(plan.commands)
    end = rope.reduce(rollout.states[-1])
    return not (completed and rope.close(plan.reduced[-1:], end[None])[0])


def collect_simple_hook(folder: Path, n_plans: int, n_jobs: int) -> Transitions:
    """Collect as the paper does: one scene, many starts, no classifier."""
    rope = RopeWithoutSlackLimit(load_scene("simple_hook"))
    return collect_transitions(
        rope,
        BiasedRRT(rope, max_iterations=PAPER_ITERATIONS),
        n_plans,
        n_jobs=n_jobs,
        random_state=PAPER_SEED,
        path=folder / "simple_hook",
        verbose=1,
    )


def of_bands(transitions: Transitions) -> Transitions:
    """Leave out the PBD ropes of Simple Hook's reduced states, which other features don't know."""
    rope = RopeWithoutSlackLimit(load_scene("simple_hook"))
    before, after = rope.bands(transitions.reduced), rope.bands(transitions.next_reduced)
    return Transitions(
        before, transitions.command, after, transitions.y, transitions.plan, transitions.step
    )
