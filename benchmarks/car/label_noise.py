"""What can be learned about the car: one b and one u, many speeds, different labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.calibration import CalibratedClassifierCV
from sklearn.frozen import FrozenEstimator

from benchmarks.calibration_error import N_BINS, bin_of, calibration_error
from benchmarks.car.compared_planners import careful_planner
from systems import Car, CarScene, random_car_scene

MOTION_SEED, GRID_SEED, CALIBRATION_SEED = 21, 22, 23
MOST_MOTION_SCENES, PLANS_PER_SCENE = 20, 10
POSES_PER_SCENE, N_SPEEDS = 10, 64
MOST_CALIBRATION_SCENES = 60
LENGTH = 0.75


@dataclass(frozen=True)
class Noise:
    """Shares and probabilities of the transitions of a grid.

    Attributes
    ----------
    share : ndarray of shape (n,)
        Of the speeds with which the transition is Reliable.
    raw, calibrated : ndarray of shape (n,)
        The classifier's probability that it is.
    """

    share: np.ndarray
    raw: np.ndarray
    calibrated: np.ndarray


def fan(n_turns: int, slips: tuple[float, ...] = (-0.25, 0.0, 0.25)) -> np.ndarray:
    """Return displacements in the car's frame, forwards and backwards, as far as is like driving.

    Parameters
    ----------
    n_turns : int
        Circles from one lock to about the other.
    slips : tuple of float
        Angles by which displacements are off the circle's chord, in radians.

    Returns
    -------
    commands : ndarray of shape (2 * n_turns * n_slips, 3)
    """
    turn, slip, back = np.meshgrid(np.linspace(-0.66, 0.66, n_turns), slips, (0.0, np.pi))
    way = turn / 2 + slip + back
    rows = [LENGTH * np.cos(way), LENGTH * np.sin(way), turn]
    return np.stack(rows, axis=-1).reshape(-1, 3)


def to_scene_frame(pose: np.ndarray, commands: np.ndarray) -> np.ndarray:
    """Turn displacements from a car's frame to that of its scene."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    turned = commands.copy()
    turned[:, :2] = commands[:, :2] @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def measure_noise(classifier: Any, unseen: list[CarScene], n_scenes: int) -> Noise:
    """Compare the classifier's probabilities with the shares of speeds, in scenes new to both.

    Speeds and steering angles are those that a car has before a command of a plan made with the
    classifier. The calibration sees one execution of each transition of such a grid in scenes of
    its own, ``n_scenes`` at most.
    """
    motions = _motions(classifier, min(n_scenes, MOST_MOTION_SCENES))
    rng = np.random.default_rng(CALIBRATION_SEED)
    calibration = [
        _grid(_calibration_car(i), motions, 1, rng)
        for i in range(min(n_scenes, MOST_CALIBRATION_SCENES))
    ]
    X, share = (np.concatenate(arrays) for arrays in zip(*calibration, strict=True))
    calibrated = CalibratedClassifierCV(FrozenEstimator(classifier), method="isotonic")
    calibrated.fit(X, share.astype(int))
    rng = np.random.default_rng(GRID_SEED)
    grids = [_grid(Car(scene), motions, N_SPEEDS, rng) for scene in unseen]
    X, share = (np.concatenate(arrays) for arrays in zip(*grids, strict=True))
    return Noise(share, classifier.predict_proba(X)[:, 1], calibrated.predict_proba(X)[:, 1])


def _calibration_car(i: int) -> Car:
    return Car(random_car_scene(np.random.SeedSequence([CALIBRATION_SEED, i])))


def _motions(classifier: Any, n_scenes: int) -> np.ndarray:
    """Return speeds and steering angles before commands, (n, 2)."""
    found = []
    for i in range(n_scenes):
        car = _calibration_car(i)
        for j in range(PLANS_PER_SCENE):
            seed = np.random.SeedSequence([MOTION_SEED, i, j])
            problem = car.sample_problem(seed)
            plan = careful_planner(car, classifier, j).plan(problem.start[:3], problem.goal)
            states = car.rollout(problem.start, plan.commands).states
            found.append(states[: max(1, len(plan.commands)), 3:])
    return np.concatenate(found)


def _grid(
    car: Car, motions: np.ndarray, n_speeds: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return features of a grid's transitions that g allows, and their shares of Reliable."""
    low, high = car.bounds
    poses = rng.uniform(low, high, size=(50 * POSES_PER_SCENE, 3))
    poses = poses[car.clearance(poses) > 0.01][:POSES_PER_SCENE]
    moves = fan(7)
    reduced = np.repeat(poses, len(moves), axis=0)
    commands = np.concatenate([to_scene_frame(pose, moves) for pose in poses])
    following, valid = car.propagate(reduced, commands)
    reduced, commands, following = reduced[valid], commands[valid], following[valid]
    drawn = motions[rng.integers(len(motions), size=n_speeds * len(reduced))]
    ends, completed = car.execute(
        np.hstack([np.repeat(reduced, n_speeds, axis=0), drawn]),
        np.repeat(commands, n_speeds, axis=0),
    )
    reliable = completed & car.close(np.repeat(following, n_speeds, axis=0), ends[:, :3])
    return car.features(reduced, following), reliable.reshape(-1, n_speeds).mean(axis=1)


def bins(probability: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return mean probability, mean share and count of transitions by probability, (10, 3)."""
    number = bin_of(probability)
    count = np.bincount(number, minlength=N_BINS)
    sums = [np.bincount(number, values, N_BINS) for values in (probability, share)]
    safe = np.maximum(count, 1)
    return np.column_stack([sums[0] / safe, sums[1] / safe, count])


def print_noise(noise: Noise, p_acc: float) -> None:
    """Print how noisy the labels are and what that means for p_acc."""
    share = noise.share
    noisy = (share > 0.05) & (share < 0.95)
    best = np.maximum(share, 1 - share).mean()
    print(
        f"\nLabels of {len(share):,} transitions, each with {N_SPEEDS} speeds: {noisy.mean():.1%} "
        f"are Reliable with some speeds and not with others (5 % to 95 %)."
    )
    print(f"Best accuracy that any classifier of b, u and E can have here: {best:.1%}")
    for name, probability in (("raw", noise.raw), ("calibrated", noise.calibrated)):
        accuracy = np.where(probability > 0.5, share, 1 - share).mean()
        print(
            f"  {name:11s} accuracy {accuracy:.1%}, calibration error "
            f"{calibration_error(probability, share):.3f}"
        )
        print("    probability " + " ".join(f"{p:5.2f}" for p, _, _ in bins(probability, share)))
        print("    share       " + " ".join(f"{s:5.2f}" for _, s, _ in bins(probability, share)))
        print("    transitions " + " ".join(f"{n:5.0f}" for _, _, n in bins(probability, share)))
    print(
        f"p_acc on held-out plans is {p_acc:.1%}. Of what it lacks, speeds that the reduced state "
        f"does not hold make up {1 - best:.1%} here, which no more data will mend."
    )
