"""The rope's random halls: which are planned in, and that none is planned in again."""

import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "examples"))
from rope_collection import Round, collect_random_scenes, random_scene

from reliability import UNRELIABLE

SLOTTED, ANY = 13_000, 13_001


def test_a_slotted_round_plans_only_in_halls_with_a_slot_and_a_slit(tmp_path):
    names = [{part.name for part in random_scene(i).obstacles} for i in (SLOTTED, ANY)]
    assert [{"lower slotted wall", "lower wall"} <= of_hall for of_hall in names] == [True, False]
    halls = Round(range(SLOTTED, ANY + 1), biased=False, slotted=True)
    (found,) = collect_random_scenes(tmp_path, halls, None, n_jobs=1)
    assert {file.name for file in tmp_path.iterdir()} == {f"scene-{SLOTTED}.npz"}
    np.testing.assert_array_equal(found.scene.packed, random_scene(SLOTTED).packed)
    first = found.transitions.plan == found.transitions.plan[0]
    assert found.transitions.y[first][-1] == UNRELIABLE, "hard: the first plan goes wrong"
    (file,) = tmp_path.iterdir()
    made = file.stat().st_mtime_ns
    (again,) = collect_random_scenes(tmp_path, halls, None, n_jobs=1)
    assert file.stat().st_mtime_ns == made
    np.testing.assert_array_equal(again.transitions.y, found.transitions.y)
