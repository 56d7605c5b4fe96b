"""The classifier on voxel grids: learning, checkpoints, bad rows, scikit-learn's conventions."""

import joblib
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra [torch]")

from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import parametrize_with_checks

from planners.check_transition import CheckTransition
from reliability import TransitionReliabilityClassifier, VoxNet
from reliability.networks.voxel_format import grid_shape
from reliability.networks.voxel_grids import transformed, unpacked, unpacked_on_device
from reliability.networks.voxnet_module import Dropout
from systems import Rope

QUICK = {"max_epochs": 6, "batch_size": 16, "learning_rate": 3e-3, "random_state": 0}


def voxnet(pooling=1, mixed_precision=True, augment=False, **parameters):
    backend = VoxNet(pooling=pooling, mixed_precision=mixed_precision, augment=augment)
    return TransitionReliabilityClassifier(backend, **QUICK | parameters)


def packed(cells):
    return np.packbits(cells.reshape(len(cells), -1), axis=1)


def hits(n, side=16):
    """Packed grids in which a block and a line are near one another or not, and which."""
    rng = np.random.default_rng(0)
    cells = np.zeros((n, 3, side, side, side), dtype=np.uint8)
    y = rng.integers(0, 2, n)
    for grid, hit in zip(cells, y, strict=True):
        x = rng.integers(3, side - 3)
        grid[0, x - 2 : x + 2, 4:12] = 1
        line = x if hit else (x + side // 2) % side
        grid[1:, line, :, side // 2] = 1
    return packed(cells), y


@pytest.fixture(scope="module")
def data():
    return hits(240)


@pytest.fixture(scope="module")
def fitted(data):
    X, y = data
    return voxnet(max_epochs=12).fit(X, y)


def expected_failures(estimator):
    return {
        "check_sample_weight_equivalence_on_dense_data": (
            "sample_weight is not equivalent to removing/repeating samples."
        )
    }


@parametrize_with_checks(
    [voxnet(max_epochs=15, validation_fraction=0.2)], expected_failed_checks=expected_failures
)
@pytest.mark.filterwarnings("ignore:The training rows are all of one class")
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.SkipTestWarning")
def test_scikit_learns_own_checks(estimator, check):
    check(estimator)


def test_it_learns_whether_a_band_is_near_an_obstacle(data, fitted):
    X, y = data
    assert fitted.score(X, y) > 0.95
    assert fitted.validation_accuracy_ > 0.8
    assert fitted.n_features_in_ == 1536
    assert len(fitted.history_) == 12


def test_a_longer_training_goes_on_from_its_checkpoint(data, tmp_path):
    X, y = data
    parameters = {"augment": True, "rows_per_epoch": 64}
    voxnet(**parameters, max_epochs=1, checkpoint=tmp_path / "training").fit(X, y)
    longer = voxnet(**parameters, max_epochs=2, checkpoint=tmp_path / "training").fit(X, y)
    whole = voxnet(**parameters, max_epochs=2).fit(X, y)
    assert longer.history_ == whole.history_
    np.testing.assert_array_equal(longer.decision_function(X), whole.decision_function(X))


@pytest.mark.parametrize("pooling", [1, 2, 4])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_grids_are_unpacked_and_pooled_alike_everywhere(pooling, channels, rng):
    cells = (rng.random((3, channels, 32, 32, 32)) < 0.1).astype(np.uint8)
    rows = torch.from_numpy(packed(cells))
    seen = 32 // pooling
    cubes = cells.reshape(3, channels, seen, pooling, seen, pooling, seen, pooling)
    expected = cubes.max(axis=(3, 5, 7)).astype(np.float32)
    expected[:, 0] = cubes[:, 0].mean(axis=(2, 4, 6))
    for unpack in (unpacked, unpacked_on_device):
        np.testing.assert_array_equal(unpack(rows, channels, 32, pooling).numpy(), expected)


@pytest.mark.parametrize("side", [16, 32, 64])
def test_symmetries_turn_and_mirror_about_the_vertical(side, rng):
    cells = (rng.random((8, 2, side, side, side)) < 0.2).astype(np.uint8)
    cells[1:] = cells[0]
    moved = transformed(torch.from_numpy(packed(cells)), 2, side, torch.arange(8)).numpy()
    grids = np.unpackbits(moved, axis=1).reshape(cells.shape)
    for k in range(4):
        turned = np.rot90(cells[0], k, axes=(1, 2))
        np.testing.assert_array_equal(grids[k], turned)
        np.testing.assert_array_equal(grids[4 + k], turned.swapaxes(1, 2))
    assert len({grid.tobytes() for grid in grids}) == 8


@pytest.mark.parametrize("augment", [False, True])
@pytest.mark.parametrize("pooling", [1, 2])
def test_a_rows_logit_is_the_same_in_every_batch_but_for_rounding(pooling, augment):
    X, y = hits(40, side=32)
    network = voxnet(max_epochs=1, rows_per_epoch=32, pooling=pooling, augment=augment).fit(X, y)
    together = network.decision_function(X)
    for n_rows in (1, 5, 8):
        parts = [network.fast_decision_function(X[i : i + n_rows]) for i in range(0, 40, n_rows)]
        np.testing.assert_allclose(np.concatenate(parts), together, rtol=1e-5, atol=1e-6)
    assert network.history_[0]["train_loss"] > 0


def test_precision_is_mixed_only_where_the_cpu_computes_with_bfloat16(monkeypatch):
    X, y = hits(40, side=32)
    network = voxnet(max_epochs=1, rows_per_epoch=32, pooling=2, mixed_precision=False).fit(X, y)
    full = network.decision_function(X)
    answers, losses = {}, {}
    for instructions in ({}, {"avx512_bf16": False}, {"avx512_bf16": True}, {"bf16": True}):
        monkeypatch.setattr(torch.cpu, "get_capabilities", lambda found=instructions: found)
        mixed = voxnet(max_epochs=1, rows_per_epoch=32, pooling=2).fit(X, y)
        answers[any(instructions.values())] = mixed.decision_function(X)
        losses[any(instructions.values())] = mixed.history_[0]["train_loss"]
        np.testing.assert_allclose(mixed.decision_function(X), full, atol=0.05)
    np.testing.assert_array_equal(answers[False], full)
    assert not np.array_equal(answers[True], full)
    assert losses[False] == network.history_[0]["train_loss"] != losses[True]


def test_a_model_on_disk_is_small_and_the_same(data, fitted, tmp_path):
    X, _ = data
    joblib.dump(fitted, tmp_path / "model.joblib")
    loaded = joblib.load(tmp_path / "model.joblib")
    np.testing.assert_array_equal(loaded.predict_proba(X), fitted.predict_proba(X))
    n_weights = 32 * (3 * 5**3 + 1) + 32 * (32 * 3**3 + 1) + 128 * (32 * 2**3 + 1) + 129
    assert (tmp_path / "model.joblib").stat().st_size < 4 * n_weights + 10_000
    loaded.set_params(device="cuda")
    joblib.dump(loaded, tmp_path / "elsewhere.joblib")
    elsewhere = joblib.load(tmp_path / "elsewhere.joblib")
    if not torch.cuda.is_available():
        np.testing.assert_array_equal(elsewhere.predict(X), fitted.predict(X))


def test_clones_pipelines_and_files_as_data(data, tmp_path):
    X, y = data
    np.save(tmp_path / "X.npy", X)
    mapped = np.load(tmp_path / "X.npy", mmap_mode="r")
    network = voxnet(max_epochs=2)
    plain = clone(network).fit(mapped, y)
    pipeline = make_pipeline(FunctionTransformer(), network).fit(X, y)
    np.testing.assert_array_equal(pipeline.predict_proba(X), plain.predict_proba(mapped))
    by_plan = clone(network).fit(X, y, groups=np.arange(len(X)) // 8)
    assert 0 <= by_plan.validation_accuracy_ <= 1


def test_packed_rows_of_another_kind_are_refused(data, fitted):
    X, y = data
    for call, message in (
        (lambda: fitted.predict(X[:, :-1]), "has 1535 features, but .* is expecting 1536"),
        (lambda: fitted.predict(X.astype(float)), "uint8 rows of 1536 bytes .3 channels of 16 x"),
        (lambda: fitted.predict(X.tolist()), "that this model was trained on, .* got list"),
        (lambda: voxnet().fit(X[:, :13], y), "X of uint8 must hold bit-packed grids, .* got 13"),
        (lambda: voxnet(pooling=2).fit(X, y), "pooling must leave at least 12 cells a side, got 2"),
        (lambda: voxnet(pooling=3).fit(X, y), "pooling must be 1, 2 or 4, got 3"),
        (lambda: voxnet(rows_per_epoch=0).fit(X, y), "rows_per_epoch must be a positive integer"),
    ):
        with pytest.raises(ValueError, match=message):
            call()


def test_planners_refuse_a_model_of_another_grid(fitted):
    arguments = {"k": 1.0, "accuracy": None, "rng": np.random.default_rng(0)}
    with pytest.raises(ValueError, match="fitted on 1536 features, and Rope gives 12288"):
        CheckTransition(Rope(), fitted, **arguments)


def test_planners_ask_in_batches_and_get_the_models_answers(rng):
    rope = Rope()
    rows = np.tile(rope.scene.start.ravel(), (20, rope.reduced_dim // 6))
    after = rows + np.tile(rng.normal(size=(20, 6)) * 0.01, rope.reduced_dim // 6)
    X = rope.features(rows, after)
    network = voxnet(max_epochs=1, pooling=2).fit(X, np.arange(20) % 2)
    check = CheckTransition(rope, network, k=1.0, accuracy=0.9, rng=rng)
    assert not check.answers_fast
    np.testing.assert_array_equal(check.classify(rows, after), network.predict(X) == 1)
    probability = check.probability(rows, after)
    np.testing.assert_allclose(probability, network.predict_proba(X)[:, 1])


def test_diverging_training_stops_and_says_so(data):
    X, y = data
    with pytest.raises(FloatingPointError, match="Training diverged in epoch 1"):
        voxnet(learning_rate=1e38, mixed_precision=False).fit(X, y)


@pytest.mark.parametrize("side", [16, 32, 64])
def test_the_number_of_bytes_tells_channels_and_side(side):
    for channels in range(1, 8):
        assert grid_shape(channels * side**3 // 8) == (channels, side)
    for n_bytes in (0, side**3 // 8 - 1, 11 * side**3 // 8):
        with pytest.raises(ValueError, match=f"bit-packed grids, .* got {n_bytes} bytes a row"):
            grid_shape(n_bytes)


def test_floats_are_repeated_until_they_fill_a_grid(rng):
    X = rng.normal(size=(40, 6)).astype(np.float32)
    y = X[:, 0] > 0
    short = voxnet(max_epochs=1).fit(X, y)
    full = voxnet(max_epochs=1).fit(np.tile(X, (1, 12**3 // 6)), y)
    expected = full.decision_function(np.tile(X, (1, 12**3 // 6)))
    np.testing.assert_array_equal(short.decision_function(X), expected)
    pooled = voxnet(max_epochs=1, pooling=4, augment=True).fit(X, y)
    np.testing.assert_array_equal(pooled.decision_function(X), expected, "only grids are pooled")
    larger = voxnet(max_epochs=1).fit(np.tile(X, (1, 300)), y)
    assert np.isfinite(larger.decision_function(np.tile(X, (1, 300)))).all(), "a side of 14"


def test_augmentation_changes_the_training_and_not_the_answers(data):
    X, y = data
    parameters = {"max_epochs": 1, "rows_per_epoch": 32}
    augmented = voxnet(augment=True, **parameters).fit(X, y)
    plain = voxnet(**parameters).fit(X, y)
    once, twice = (augmented.decision_function(X[:20]) for _ in range(2))
    np.testing.assert_array_equal(once, twice)
    assert (once != plain.decision_function(X[:20])).any()


def test_training_drops_out_and_keeps_the_mean(rng):
    torch.manual_seed(0)
    dropout = Dropout(0.3)
    inputs = torch.ones(200, 8, 5).transpose(1, 2)
    outputs = dropout(inputs)
    n_dropped = round(0.3 * 256)
    assert outputs.unique().tolist() == pytest.approx([0.0, 256 / (256 - n_dropped)])
    assert outputs.mean() == pytest.approx(1, abs=0.05)
    assert (outputs == 0).float().mean() == pytest.approx(0.3, abs=0.03)
    assert outputs.stride() == inputs.stride()
    assert dropout.eval()(inputs) is inputs


def test_the_network_has_the_papers_layers():
    module = VoxNet().module(3 * 32**3 // 8, packed=True)
    shapes = [tuple(parameter.shape) for parameter in module.parameters()]
    assert shapes == [
        (32, 3, 5, 5, 5),
        (32,),
        (32, 32, 3, 3, 3),
        (32,),
        (128, 32 * 6**3),
        (128,),
        (1, 128),
        (1,),
    ]


@pytest.mark.parametrize(("pooling", "n_inputs"), [(1, 32 * 6**3), (2, 32 * 2**3)])
def test_pooling_makes_the_network_smaller(pooling, n_inputs):
    module = VoxNet(pooling=pooling).module(3 * 32**3 // 8, packed=True)
    assert (128, n_inputs) in [tuple(parameter.shape) for parameter in module.parameters()]
