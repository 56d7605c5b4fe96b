"""Full disks, folders that can't be written, and flipped bits are noticed, and lose nothing."""

import contextlib
import os
import resource
import stat
import tempfile
from pathlib import Path

import numpy as np
import pytest
from toy_systems import Disc

from planners import BiasedRRTConnect, PlanResult
from reliability import (
    MLP,
    ModelFileError,
    StoreError,
    TransitionReliabilityClassifier,
    Transitions,
    collect_transitions,
    load_estimator,
    save_estimator,
)

X = np.random.default_rng(0).normal(size=(60, 3))
Y = X[:, 0] > 0
COLUMNS = ("reduced", "command", "next_reduced", "y", "plan", "step", "scene", "executed")


@contextlib.contextmanager
def room_for(n_bytes):
    """Let no file grow beyond some bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextlib.contextmanager
def read_only(folder):
    """Forbid to write into a folder, to root as well, who may do everything."""
    modes = {each: each.stat().st_mode for each in (folder, *folder.rglob("*"))}
    for each in modes:
        each.chmod(stat.S_IREAD | stat.S_IEXEC | stat.S_IRGRP | stat.S_IXGRP | stat.S_IROTH | 0o1)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if is_root:
            os.seteuid(0)
        for each, mode in modes.items():
            each.chmod(mode)


@pytest.fixture
def folder():
    """A folder that everybody may look into, unlike pytest's own."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def collect(path, n_plans=4):
    return collect_transitions(
        Disc(), BiasedRRTConnect(None), n_plans, random_state=1, path=path / "data"
    )


def train(path, max_epochs=2):
    return TransitionReliabilityClassifier(
        MLP((4,)), max_epochs=max_epochs, checkpoint=path / "training", random_state=0
    ).fit(X, Y)


def a_plan():
    return BiasedRRTConnect(Disc(), random_state=0).plan([-0.9, -0.9], [-0.9, 0.9])


def contents(folder):
    return {file: file.read_bytes() for file in folder.rglob("*") if file.is_file()}


def same_rows(one, other):
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in COLUMNS)


@pytest.mark.parametrize("n_bytes", [0, 10, 900, 2000])
def test_a_full_disk_ends_a_collection_which_goes_on_when_there_is_room(folder, n_bytes):
    expected = collect(folder / "elsewhere")
    with room_for(n_bytes), pytest.raises(OSError, match="File too large"):
        collect(folder)
    assert not list(folder.rglob("*.partial"))
    assert same_rows(collect(folder), expected)


@pytest.mark.parametrize("n_bytes", [1, 100, 3000])
def test_a_full_disk_ends_a_training_and_leaves_the_last_checkpoint(folder, n_bytes):
    train(folder, 2)
    before = contents(folder)
    with room_for(n_bytes), pytest.raises(OSError, match="File too large"):
        train(folder, 4)
    assert contents(folder) == before
    resumed = train(folder, 4)
    (folder / "training").unlink()
    expected = train(folder, 4)
    assert np.array_equal(resumed.decision_function(X), expected.decision_function(X))


@pytest.mark.parametrize("n_bytes", [0, 100, 1500])
def test_a_full_disk_leaves_what_was_saved_before(folder, n_bytes):
    plan, data, model = a_plan(), collect(folder), train_nothing()
    saves = {
        "plan": plan.save,
        "data.npz": data.save,
        "model.skops": lambda path: save_estimator(model, path),
    }
    for name, save in saves.items():
        save(folder / name)
    before = contents(folder)
    for name, save in saves.items():
        with room_for(n_bytes), pytest.raises(OSError, match="File too large"):
            save(folder / name)
    assert contents(folder) == before


def train_nothing():
    return TransitionReliabilityClassifier(MLP((4,)), max_epochs=1, random_state=0).fit(X, Y)


def test_a_folder_that_cannot_be_written_is_noticed_before_any_work(folder):
    class NeverAsked(Disc):
        def rollout(self, state, commands):
            raise AssertionError("worked")

    def resume(n_plans):
        planner = BiasedRRTConnect(None)
        return collect_transitions(Disc(), planner, n_plans, random_state=1, path=folder / "data")

    whole = collect(folder)
    plan = a_plan()
    # Trained here: root gives up its rights below, and may not find packages in its home then.
    model = train_nothing()
    with read_only(folder):
        assert same_rows(resume(4), whole), "what is there can be read"
        with pytest.raises(StoreError, match="data must be a folder that can be written"):
            resume(5)
        with pytest.raises(PermissionError):
            collect_transitions(
                NeverAsked(), BiasedRRTConnect(None), 3, random_state=1, path=folder / "other"
            )
        with pytest.raises(ValueError, match="checkpoint must be a file that can be written"):
            train(folder)
        for save in (plan.save, whole.save, lambda path: save_estimator(model, path)):
            with pytest.raises(PermissionError):
                save(folder / "new.skops")
    assert not list(folder.rglob("*.partial"))


def flips(content, per_byte=8):
    """Yield content with one bit flipped, for each bit, or for some bits of each byte."""
    rng = np.random.default_rng(0)
    for position in range(len(content)):
        for bit in rng.permutation(8)[:per_byte]:
            damaged = bytearray(content)
            damaged[position] ^= 1 << int(bit)
            yield bytes(damaged)


def outcomes(file, read, same, errors, per_byte=8):
    """Read a file with each of its bits flipped; return how many were noticed and harmless."""
    sound = file.read_bytes()
    noticed = harmless = 0
    for damaged in flips(sound, per_byte):
        file.write_bytes(damaged)
        try:
            found = read()
        except errors as error:
            assert str(file) in str(error)  # noqa: PT017
            noticed += 1
        else:
            assert same(found), "believed"
            harmless += 1
    file.write_bytes(sound)
    assert same(read())
    return noticed, harmless


@pytest.mark.slow
def test_every_flipped_bit_of_a_store_is_noticed_or_harmless(folder):
    whole = collect(folder, 2)
    for file in (folder / "data").iterdir():
        found = outcomes(
            file, lambda: collect(folder, 2), lambda data: same_rows(data, whole), StoreError
        )
        print(file.name, found)
        assert sum(found) == 8 * file.stat().st_size


@pytest.mark.slow
def test_every_flipped_bit_of_a_saved_plan_is_noticed_or_harmless(folder):
    plan, file = a_plan(), folder / "plan"
    plan.save(file)

    def same(found):
        return all(
            np.array_equal(getattr(found, name), getattr(plan, name))
            for name in ("reduced", "commands", "tree", "status", "random_state")
        )

    found = outcomes(file, lambda: PlanResult.load(file), same, ValueError)
    print(found)
    assert sum(found) == 8 * file.stat().st_size
    assert found[0] > 3 * found[1], "most of the others are in what zip files say besides"


@pytest.mark.slow
def test_every_flipped_bit_of_saved_transitions_is_noticed_or_harmless(folder):
    data, file = collect(folder, 2), folder / "data.npz"
    data.save(file)
    found = outcomes(
        file, lambda: Transitions.load(file), lambda read: same_rows(read, data), ValueError
    )
    print(found)
    assert sum(found) == 8 * file.stat().st_size
    assert found[0] > 3 * found[1], "most of the others are in what zip files say besides"


@pytest.mark.slow
def test_flipped_bits_of_a_checkpoint_are_noticed(folder):
    answers = train(folder).decision_function(X)

    def same(model):
        return np.array_equal(model.decision_function(X), answers)

    found = outcomes(folder / "training", lambda: train(folder), same, ModelFileError, per_byte=1)
    print(found)
    assert found[1] == 0


@pytest.mark.slow
def test_flipped_bits_of_a_model_file_are_noticed_or_harmless(folder):
    model, file = train_nothing(), folder / "model.skops"
    save_estimator(model, file)

    def same(found):
        return np.array_equal(found.decision_function(X), model.decision_function(X))

    print(outcomes(file, lambda: load_estimator(file), same, ModelFileError, per_byte=1))
