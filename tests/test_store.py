"""The store of resumable work: what it keeps, what it notices, and what it says."""

import hashlib
import json
import os
import shutil
import threading
from functools import partial

import joblib
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from joblib.parallel import register_parallel_backend

from reliability import Item, Job, ResumableStore, StoreError, run_jobs

KIND = "squares of numbers"


def open_store(folder, **description):
    return ResumableStore(folder, KIND, {"power": 2, "seed": 3} | description)


def square(number, fail_at=None):
    if number == fail_at:
        raise KeyboardInterrupt
    return Item({"number": number}, {"rows": np.arange(number) ** 2})


def jobs_of(store, n, **parameters):
    return [Job(f"item-{i}", partial(square, i, **parameters), store) for i in range(n)]


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture
def filled(tmp_path):
    store = open_store(tmp_path / "store")
    run_jobs(jobs_of(store, 5))
    return store


def refused(store, name):
    """Return what reading an item says is wrong with it."""
    with pytest.raises(StoreError) as caught:
        store.read(name)
    return str(caught.value)


def test_items_come_back_as_they_were_made(filled):
    assert filled.names() == [f"item-{i}" for i in range(5)]
    item = filled.read("item-4")
    assert item.facts == {"number": 4}
    np.testing.assert_array_equal(item.arrays["rows"], [0, 1, 4, 9])
    item.arrays["rows"][0] = 7  # a copy of one's own
    assert filled.read("item-5") is None


@given(
    arrays=st.dictionaries(
        st.text(st.characters(codec="ascii", categories=("L",)), min_size=1, max_size=5),
        npst.arrays(
            st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_]),
            npst.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
        ),
        max_size=3,
    ),
    facts=st.dictionaries(st.text(max_size=5), st.integers() | st.text() | st.none(), max_size=3),
)
@settings(derandomize=True, deadline=None, max_examples=60)
def test_any_arrays_and_facts_come_back_bit_by_bit(tmp_path_factory, arrays, facts):
    store = open_store(tmp_path_factory.getbasetemp() / "any")
    store.files.write("some", Item(facts, arrays))
    found = store.read("some")
    assert found.facts == facts
    assert found.arrays.keys() == arrays.keys()
    for name, array in arrays.items():
        assert found.arrays[name].dtype == array.dtype
        assert found.arrays[name].shape == array.shape
        assert found.arrays[name].tobytes() == array.tobytes()


def test_the_manifest_says_in_words_what_is_stored(filled):
    manifest = json.loads((filled.folder / "manifest.json").read_text())
    assert manifest["kind"] == KIND
    assert manifest["description"] == {"power": 2, "seed": 3}


@pytest.mark.parametrize("n_jobs", [1, 2])
@pytest.mark.parametrize("stopped_at", [0, 1, 4, 6])
def test_an_interrupted_run_keeps_what_is_finished_and_ends_with_the_same_bytes(
    tmp_path, n_jobs, stopped_at
):
    whole = open_store(tmp_path / "whole")
    expected = run_jobs(jobs_of(whole, 7))
    store = open_store(tmp_path / "store")
    with pytest.raises(KeyboardInterrupt):
        run_jobs(jobs_of(store, 7, fail_at=stopped_at))
    assert store.names() == [f"item-{i}" for i in range(stopped_at)]
    kept = {name: os.stat(store.files.path_of(name)).st_mtime_ns for name in store.names()}
    found = run_jobs(jobs_of(open_store(tmp_path / "store"), 7), n_jobs=n_jobs)
    assert [item.facts for item in found] == [item.facts for item in expected]
    assert contents(tmp_path / "store") == contents(tmp_path / "whole")
    for name, made in kept.items():
        assert os.stat(store.files.path_of(name)).st_mtime_ns == made, "not made again"


def test_what_is_missing_is_made_again_and_only_that(filled):
    before = contents(filled.folder)
    filled.discard("item-2")
    filled.discard("item-2")
    assert "item-2" not in filled.names()
    assert len(run_jobs(jobs_of(filled, 5))) == 5
    assert contents(filled.folder) == before


@pytest.mark.parametrize("position", [0, 20, 33, 60, 120, -1])
def test_a_flipped_bit_is_noticed(filled, position):
    file = filled.files.path_of("item-3")
    content = bytearray(file.read_bytes())
    content[position] ^= 4
    file.write_bytes(content)
    message = refused(filled, "item-3")
    assert f"{file} is damaged" in message
    assert "Remove this file, and it is made again" in message
    file.unlink()
    assert run_jobs(jobs_of(filled, 5))[3].facts == {"number": 3}


@pytest.mark.parametrize("kept", [0, 5, 40, -1])
def test_a_truncated_file_is_noticed(filled, kept):
    file = filled.files.path_of("item-3")
    file.write_bytes(file.read_bytes()[:kept])
    assert f"{file} is damaged" in refused(filled, "item-3")


def test_a_file_over_another_and_two_that_are_swapped_are_noticed(filled):
    one, other = (filled.files.path_of(name) for name in ("item-1", "item-2"))
    shutil.copy(one, other)
    assert f"{other} holds item-1, not item-2" in refused(filled, "item-2")
    with pytest.raises(StoreError, match="holds item-1"):
        run_jobs(jobs_of(filled, 5))


def test_a_file_of_another_store_is_noticed(filled, tmp_path):
    other = open_store(tmp_path / "other", power=3)
    other.files.write("item-1", square(1))
    file = filled.files.path_of("item-1")
    shutil.copy(other.files.path_of("item-1"), file)
    assert f"{file} belongs to another store" in refused(filled, "item-1")


def test_without_its_manifest_a_folder_goes_on_for_the_same_arguments_only(filled):
    before = contents(filled.folder)
    (filled.folder / "manifest.json").unlink()
    again = open_store(filled.folder)
    assert again.read("item-1").facts == {"number": 1}
    assert contents(filled.folder) == before
    (filled.folder / "manifest.json").unlink()
    assert "belongs to another store" in refused(open_store(filled.folder, seed=4), "item-1")


@pytest.mark.parametrize(
    "header",
    [
        {},
        {"store": "a", "item": "item-1", "facts": {}},
        {"store": "a", "item": "item-1", "facts": 3, "arrays": []},
        {"store": "a", "item": "item-1", "facts": {}, "arrays": [["rows", "O", [1]]]},
        {"store": "a", "item": "item-1", "facts": {}, "arrays": [["rows", "<f8", [10**12]]]},
        {"store": "a", "item": "item-1", "facts": {}, "arrays": [["rows", "<f8", [-1]]]},
    ],
)
def test_a_file_that_no_store_writes_is_noticed(filled, header):
    """Its digest is right."""
    rest = json.dumps(header).encode() + b"\n" + bytes(8)
    digest = hashlib.blake2b(rest, digest_size=16).hexdigest().encode()
    (filled.folder / "item-1.item").write_bytes(digest + b"\n" + rest)
    assert "item-1.item is not an item's file" in refused(filled, "item-1")


@pytest.mark.parametrize(
    "content",
    [b"", b"{", b"[]", b"3", b"null", b'"text"', b"{}", b"\xff\xfe", b'{"a": 1}', b"[" * 10**5],
)
def test_a_bad_manifest_is_named(filled, content):
    file = filled.folder / "manifest.json"
    file.write_bytes(content)
    with pytest.raises(StoreError, match="is not a manifest") as caught:
        open_store(filled.folder)
    assert str(file) in str(caught.value)
    assert "Remove this file" in str(caught.value)


def test_an_edited_or_older_manifest_is_refused(filled):
    file = filled.folder / "manifest.json"
    text = file.read_text()
    file.write_text(text.replace('"power": 2', '"power": 5'))
    with pytest.raises(StoreError, match="was changed after it had been written"):
        open_store(filled.folder, power=5)
    file.write_text(text.replace('"format_version": 2', '"format_version": 1'))
    with pytest.raises(StoreError, match="format version 1 and this library reads 2"):
        open_store(filled.folder)


def test_a_folder_can_be_read_without_knowing_what_it_was_made_with(filled, tmp_path):
    found = ResumableStore.at(filled.folder)
    assert found.description == {"power": 2, "seed": 3}
    assert [found.read(name).facts["number"] for name in found.names()] == list(range(5))
    with pytest.raises(FileNotFoundError):
        ResumableStore.at(tmp_path / "absent")
    assert not (tmp_path / "absent").exists()


def test_other_arguments_are_refused_and_named(filled):
    with pytest.raises(StoreError) as caught:
        open_store(filled.folder, power={"of": [1, 2]}, more=None)
    message = str(caught.value)
    assert str(filled.folder) in message
    assert 'power: 2 then, {"of": [1, 2]} now; more: "nothing" then, null now' in message
    assert "seed" not in message
    with pytest.raises(StoreError, match='kind: "squares of numbers" then, "cubes" now'):
        ResumableStore(filled.folder, "cubes", {"power": 2, "seed": 3})


def test_differences_are_told_where_they_are_and_not_all_of_many(tmp_path):
    parts = {"list": [1, {"k": 1.0}], **{f"p{i}": i for i in range(9)}}
    ResumableStore(tmp_path, KIND, parts)
    with pytest.raises(StoreError, match=r"\(list.1.k: 1.0 then, 2.0 now\)"):
        ResumableStore(tmp_path, KIND, parts | {"list": [1, {"k": 2.0}]})
    with pytest.raises(StoreError, match=r"list: \[1, .* then, \[1\] now; .*; and 5 more\)"):
        ResumableStore(tmp_path, KIND, {"list": [1], **{f"p{i}": -1 for i in range(9)}})


def test_an_adopted_entry_is_the_first_ones(tmp_path):
    first = ResumableStore(tmp_path, KIND, {"seed": 1, "k": 2}, adopt=("seed",))
    second = ResumableStore(tmp_path, KIND, {"seed": 9, "k": 2}, adopt=("seed",))
    assert first.description == second.description == {"seed": 1, "k": 2}
    with pytest.raises(StoreError, match="seed: 1 then, 9 now"):
        ResumableStore(tmp_path, KIND, {"seed": 9, "k": 2})


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="must be a folder, and is a file"):
        open_store(tmp_path / "file")


def test_objects_are_refused(tmp_path):
    with pytest.raises(ValueError, match="arrays must hold numbers, got object"):
        open_store(tmp_path).files.write("a", Item({}, {"rows": np.array([None])}))
    assert open_store(tmp_path).names() == []


def test_only_partial_files_that_nobody_writes_any_more_are_removed(filled):
    old, new = (filled.folder / f".item-9.item.{i}.partial" for i in "ab")
    old.touch()
    new.touch()
    os.utime(old, (0, 0))
    open_store(filled.folder)
    assert not old.exists()
    assert new.exists(), "another process may be writing it"


def test_several_at_once_in_one_folder_all_get_the_items(tmp_path):
    barrier, found = threading.Barrier(4), []

    def one_of_several():
        barrier.wait()
        store = ResumableStore(
            tmp_path / "store", KIND, {"seed": threading.get_ident()}, adopt=("seed",)
        )
        items = run_jobs(jobs_of(store, 30))
        found.append((store.description["seed"], [item.facts["number"] for item in items]))

    threads = [threading.Thread(target=one_of_several) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4
    assert all(result == found[0] for result in found)
    assert found[0][1] == list(range(30))
    assert not list((tmp_path / "store").glob("*.partial"))


def test_work_of_another_process_is_not_done_twice(filled):
    """A job looks once more before it begins: another process may have made the item."""

    def elsewhere(number):
        filled.files.write("item-6", square(6))
        return square(number)

    def never():
        raise AssertionError

    jobs = [Job("item-5", partial(elsewhere, 5), filled), Job("item-6", never, filled)]
    assert [item.facts["number"] for item in run_jobs(jobs)] == [5, 6]


def test_an_item_that_vanishes_is_told_of(tmp_path):
    store = open_store(tmp_path / "store")

    class Forgetful(type(store.files)):
        def write(self, name, item):
            """Write nothing, as a worker that sees another folder."""

    store.files = Forgetful(store.folder, store.files.store)
    with pytest.raises(StoreError, match="item-0 was made and is not in"):
        run_jobs(jobs_of(store, 1))


def test_without_a_store_items_are_returned_in_order():
    found = run_jobs(jobs_of(None, 6), n_jobs=2)
    assert [item.facts["number"] for item in found] == list(range(6))
    assert run_jobs([]) == []


def test_the_progress_bar_counts_items(filled, capsys):
    run_jobs(jobs_of(filled, 8), verbose=1, unit="square")
    shown = capsys.readouterr().err
    assert "5/8" in shown, "those that are there"
    assert "8/8" in shown
    assert "square/s" in shown
    run_jobs(jobs_of(filled, 8))
    assert capsys.readouterr().err == ""


class ListsOnly(joblib.parallel.ThreadingBackend):
    """A backend that can't return results one by one, as Ray's."""

    supports_return_generator = False


def test_a_backend_that_returns_lists_will_do(tmp_path):
    register_parallel_backend("lists only", ListsOnly)
    store = open_store(tmp_path / "store")
    with joblib.parallel_config("lists only", n_jobs=2):
        found = run_jobs(jobs_of(store, 5))
        with pytest.raises(KeyboardInterrupt):
            run_jobs(jobs_of(store, 9, fail_at=8))
    assert [item.facts["number"] for item in found] == list(range(5))
    assert len(store.names()) >= 5
