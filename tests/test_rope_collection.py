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
from reliability import UNRELIABLE, Transitions
from systems import Rope

SLOTTED, ANY = 13_000, 13_001


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes")


@pytest.fixture(scope="module")
def found(folder):
    scenes = Round(range(SLOTTED, ANY + 1), biased=False, slotted=True)
    return collect_random_scenes(folder, scenes, None, n_jobs=1)


@pytest.fixture(scope="module")
def both(found):
    """The first plan and the others, in two scenes of different dimensions, one without plans."""
    scene, other = found[0].scenes[0], random_scene(ANY)
    assert scene.n_nodes != other.n_nodes
    joined = Transitions.concatenate([part.transitions for part in found])
    return SceneData([scene, other], joined)


def test_a_slotted_round_plans_only_in_scenes_with_a_slot_and_a_slit(found):
    names = [{part.name for part in random_scene(i).obstacles} for i in (SLOTTED, ANY)]
    assert [{"lower slotted wall", "lower wall"} <= of_scene for of_scene in names] == [True, False]
    first, others = found
    for part in found:
        (scene,) = part.scenes
        np.testing.assert_array_equal(scene.packed, random_scene(SLOTTED).packed)
    assert first.transitions.y[-1] == UNRELIABLE, "hard: the first plan goes wrong"
    assert len(np.unique(first.transitions.plan)) == 1
    assert 1 <= len(np.unique(others.transitions.plan)) <= 2


def test_what_is_there_is_not_collected_again(found, folder):
    made = {file: file.stat().st_mtime_ns for file in folder.rglob("*.item")}
    assert len(made) == 3
    scenes = Round(range(SLOTTED, SLOTTED + 1), biased=False, slotted=True)
    again = collect_random_scenes(folder, scenes, None, n_jobs=1)
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.item")} == made
    for one, other in zip(again, found, strict=True):
        np.testing.assert_array_equal(one.transitions.y, other.transitions.y)


def test_a_round_without_a_hard_scene_gives_nothing(tmp_path):
    assert collect_random_scenes(tmp_path, Round(range(ANY, ANY + 1), False, True), None, 1) == []


def test_plans_are_cut_where_g_does_not_allow_them(both):
    data, kept = both.transitions, as_far_as_allowed(both).transitions
    rope = Rope(both.scenes[0], features="clearance")
    _, valid = rope.propagate(data.reduced, data.command)
    assert not valid.all(), "where the plan goes wrong a PBD rope is overstretched"
    assert rope.propagate(kept.reduced, kept.command)[1].all()
    for plan in np.unique(data.plan):
        n = np.argmin(np.append(valid[data.plan == plan], False))
        np.testing.assert_array_equal(
            kept.step[kept.plan == plan], data.step[data.plan == plan][:n]
        )
    none = SceneData(both.scenes, data[:0])
    assert len(as_far_as_allowed(none).transitions) == 0


def test_plans_stay_apart_and_scenes_are_known_across_parts(found, both):
    first, others = found
    rows, labels, plans, scenes = described([first, others, both], "clearance")
    n = len(first.transitions) + len(others.transitions)
    assert len(rows) == len(labels) == len(plans) == len(scenes) == 2 * n
    assert not set(plans[:n]) & set(plans[n:])
    assert set(scenes[: len(first.transitions)]) == {0}
    np.testing.assert_array_equal(scenes[n:], 0)
    np.testing.assert_array_equal(rows[:n], rows[n:])


def test_other_features_see_the_bands_alone(found):
    rows, labels, _, _ = described(found[:1], "vector")
    data = found[0].transitions
    scene = found[0].scenes[0]
    carrying, band = Rope(scene, features="clearance"), Rope(scene, features="vector")
    expected = band.features(carrying.bands(data.reduced), carrying.bands(data.next_reduced))
    np.testing.assert_array_equal(rows, expected)
    np.testing.assert_array_equal(labels, data.y)
