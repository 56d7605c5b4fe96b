"""The rope's random scenes: which are planned in, and that none is planned in again."""

import numpy as np
import pytest

from benchmarks.rope.collection import (
    Round,
    SceneData,
    as_far_as_allowed,
    collect_random_scenes,
    described,
    random_scene,
)
from reliability import UNRELIABLE
from systems import Rope

SLOTTED, ANY = 13_000, 13_001


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("halls")


@pytest.fixture(scope="module")
def found(folder):
    halls = Round(range(SLOTTED, ANY + 1), biased=False, slotted=True)
    (found,) = collect_random_scenes(folder, halls, None, n_jobs=1)
    return found


def test_a_slotted_round_plans_only_in_halls_with_a_slot_and_a_slit(found, folder):
    names = [{part.name for part in random_scene(i).obstacles} for i in (SLOTTED, ANY)]
    assert [{"lower slotted wall", "lower wall"} <= of_hall for of_hall in names] == [True, False]
    assert {file.name for file in folder.iterdir()} == {f"scene-{SLOTTED}.npz"}
    np.testing.assert_array_equal(found.scene.packed, random_scene(SLOTTED).packed)
    first = found.transitions.plan == found.transitions.plan[0]
    assert found.transitions.y[first][-1] == UNRELIABLE, "hard: the first plan goes wrong"


def test_what_is_there_is_not_collected_again(found, folder):
    (file,) = folder.iterdir()
    made = file.stat().st_mtime_ns
    halls = Round(range(SLOTTED, SLOTTED + 1), biased=False, slotted=True)
    (again,) = collect_random_scenes(folder, halls, None, n_jobs=1)
    assert file.stat().st_mtime_ns == made
    np.testing.assert_array_equal(again.transitions.y, found.transitions.y)


def test_plans_are_cut_where_g_does_not_allow_them(found):
    data, kept = found.transitions, as_far_as_allowed(found).transitions
    rope = Rope(found.scene, features="clearance")
    _, valid = rope.propagate(data.reduced, data.command)
    assert not valid.all(), "where the plan goes wrong a PBD rope is overstretched"
    assert rope.propagate(kept.reduced, kept.command)[1].all()
    for plan in np.unique(data.plan):
        n = np.argmin(np.append(valid[data.plan == plan], False))
        np.testing.assert_array_equal(
            kept.step[kept.plan == plan], data.step[data.plan == plan][:n]
        )
    none = SceneData(found.scene, data[:0])
    assert len(as_far_as_allowed(none).transitions) == 0


def test_plans_of_different_scenes_stay_apart_even_if_one_has_none(found):
    none = SceneData(found.scene, found.transitions[:0])
    rows, labels, plans = described([found, none, found], "clearance")
    n = len(found.transitions)
    assert len(rows) == len(labels) == len(plans) == 2 * n
    assert not set(plans[:n]) & set(plans[n:])
