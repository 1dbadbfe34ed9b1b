"""Predictions of partial maps: squares, windows, the network, and what predictors may return."""

import os
import platform
import subprocess
import sys

import numpy as np
import pytest
from safetensors.numpy import save_file

from lidarium.mapping.prediction.levels import FREE, OCCUPIED, UNKNOWN, free_squares, levels_of, shares_unknown
from lidarium.mapping.prediction.network import FILES, WINDOW, MapNetwork, shapes
from lidarium.mapping.prediction.network_predictor import NetworkPredictor, _resampled
from lidarium.mapping.prediction.predictors import PREDICTORS, PartialMap, make_predictor, predicted
from lidarium.mapping.prediction.windows import STRIDE, WindowedPrediction


@pytest.fixture(scope="module")
def weights():
    generator = np.random.default_rng(0)
    return {
        name: (generator.normal(size=shape) / np.sqrt(np.prod(shape[1:]) or 1)).astype(np.float32)
        for name, shape in shapes().items()
    }


def test_squares_are_occupied_if_any_cell_is_and_free_if_half_are():
    log_odds = np.zeros((4, 10), np.int8)
    log_odds[:, :2] = -3
    log_odds[0, 4:8] = -3
    log_odds[3, 7] = 2
    np.testing.assert_array_equal(levels_of(log_odds, 4), [[FREE, OCCUPIED, UNKNOWN]])
    np.testing.assert_allclose(shares_unknown(log_odds, 4), [[0.5, 11 / 16, 0.5]])


def test_true_squares_are_free_unless_something_solid_is_in_them():
    free, solid = np.zeros((2, 8), np.bool_), np.zeros((2, 8), np.bool_)
    free[:, :5] = True
    solid[1, 3] = True
    np.testing.assert_array_equal(free_squares(free, solid, 2), [[True, False, True, False]])


def test_the_network_is_that_of_pytorch(weights):
    torch = pytest.importorskip("torch")
    from lidarium.training.prediction.torch_map_network import TorchMapNetwork

    trained = TorchMapNetwork()
    trained.set_weights(weights)
    levels = np.random.default_rng(1).integers(-1, 2, (WINDOW, WINDOW)).astype(np.int8)
    with torch.no_grad():
        wanted = trained(torch.from_numpy(levels)[None])[0].sigmoid().numpy()
    np.testing.assert_allclose(MapNetwork(weights)(levels), wanted, atol=1e-4)
    assert wanted.std() > 0.05


def test_another_processor_predicts_the_same_to_the_bit(weights, tmp_path):
    """Kernels for one without the newest instructions sum in the same order, and round as often."""
    if platform.machine() not in ("x86_64", "AMD64"):
        pytest.skip("its names of processors are others")
    path = tmp_path / "weights.safetensors"
    save_file(weights, path)
    script = (
        "import sys; import numpy as np; from safetensors.numpy import load_file; "
        "from lidarium.mapping.prediction.network import WINDOW, MapNetwork; "
        "levels = np.random.default_rng(1).integers(-1, 2, (WINDOW, WINDOW)).astype(np.int8); "
        "np.save(sys.argv[2], MapNetwork(load_file(sys.argv[1]))(levels))"
    )
    older = {
        "NUMBA_CPU_NAME": "nehalem",
        "NUMBA_CPU_FEATURES": "+sse4.2",
        "NUMBA_CACHE_DIR": str(tmp_path / "older"),
    }
    found = []
    for name, environment in (("own", {}), ("older", older)):
        arguments = [sys.executable, "-c", script, str(path), str(tmp_path / f"{name}.npy")]
        subprocess.run(arguments, env={**os.environ, **environment}, check=True)
        found.append(np.load(tmp_path / f"{name}.npy"))
    np.testing.assert_array_equal(*found)


def test_it_has_at_most_a_million_parameters():
    assert sum(int(np.prod(shape)) for shape in shapes().values()) <= 1_000_000


def test_windows_agree_and_only_changed_ones_are_predicted_again():
    """A model whose answer depends on the place in a window alone differs from window to window; means do not jump."""
    levels = np.zeros((200, 420), np.int8)
    levels[20:180, 20:400] = FREE

    def uneven(window):
        return np.broadcast_to(np.linspace(0.0, 1.0, window.shape[1], dtype=np.float32), window.shape)

    whole = WindowedPrediction(uneven, WINDOW)
    found = whole(levels)
    assert found.shape == levels.shape
    assert np.abs(np.diff(found[:, 20:400], axis=1)).max() < 0.1  # a seam without overlap would be a step of 1
    first = whole.predicted
    np.testing.assert_array_equal(whole(levels), found)
    assert whole.predicted == first
    levels[30, 30] = OCCUPIED
    whole(levels)
    assert 0 < whole.predicted - first < first


def test_windows_that_say_the_same_agree_to_rounding():
    levels = np.zeros((3 * STRIDE, 5 * STRIDE), np.int8)
    levels[5:-5, 5:-5] = FREE
    found = WindowedPrediction(lambda window: np.full(window.shape, 0.3, np.float32), WINDOW)(levels)
    np.testing.assert_allclose(found, 0.3, rtol=1e-5)


def test_blank_maps_have_no_free_squares(weights):
    found = WindowedPrediction(MapNetwork(weights), WINDOW)(np.zeros((50, 70), np.int8))
    assert found.shape == (50, 70)
    assert not found.any()


class Fixed:
    def __init__(self, value):
        self.value = value

    def predict(self, partial):
        return self.value


LEVELS = np.array([[FREE, UNKNOWN], [OCCUPIED, UNKNOWN]], np.int8)


def test_known_squares_stay_as_they_are():
    found = predicted(Fixed(np.full((2, 2), 0.4, np.float32)), PartialMap(LEVELS, 0.2))
    np.testing.assert_array_equal(found, np.array([[1.0, 0.4], [0.0, 0.4]], np.float32))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.zeros((2, 3), np.float32), r"\(2, 3\); want an array \(2, 2\)"),
        (np.full((2, 2), np.nan, np.float32), "nan; want probabilities"),
        (np.full((2, 2), 1.5, np.float32), r"1\.5; want probabilities"),
        ([[0.0, 0.0], [0.0, 0.0]], "want an array"),
        (np.zeros((2, 2), np.complex64), "complex64"),
    ],
)
def test_what_is_no_prediction_is_refused(value, message):
    with pytest.raises(ValueError, match=message):
        predicted(Fixed(value), PartialMap(LEVELS, 0.2))


def test_predictors_are_made_by_name():
    assert predicted(make_predictor("nothing"), PartialMap(LEVELS, 0.2)) is None
    with pytest.raises(ValueError, match="did you mean 'nothing'"):
        make_predictor("nothin")
    with pytest.raises(ValueError, match="predictor 'nothing' cannot be made"):
        make_predictor("nothing", weights="a")
    PREDICTORS.register("no_predictor", dict, "is none")
    try:
        with pytest.raises(ValueError, match="has no method predict"):
            make_predictor("no_predictor")
    finally:
        PREDICTORS.unregister("no_predictor")


def test_squares_of_other_sizes_are_resampled(weights, tmp_path):
    path = tmp_path / "weights.safetensors"
    FILES.save(path, weights)
    predictor = NetworkPredictor(path)
    levels = np.zeros((60, 40), np.int8)
    levels[10:50, 10:30] = FREE
    levels[10, 10:30] = OCCUPIED
    fine = predicted(predictor, PartialMap(levels, 0.2, "a"))
    coarse = predicted(predictor, PartialMap(levels[::2, ::2].copy(), 0.4, "b"))
    assert coarse.shape == (30, 20)
    assert fine.shape == (60, 40)
    assert np.isfinite(coarse).all()


@pytest.mark.parametrize("length", [0, 100, 50_000])
def test_truncated_weights_are_refused(weights, tmp_path, length):
    path = tmp_path / "weights.safetensors"
    FILES.save(path, weights)
    path.write_bytes(path.read_bytes()[:length])
    with pytest.raises(ValueError, match="no file of weights, or is truncated"):
        NetworkPredictor(path)


def test_weights_of_another_version_or_with_nan_are_refused(weights):
    with pytest.raises(ValueError, match=r"lacks the array 'out\.bias'"):
        FILES.check({name: array for name, array in weights.items() if name != "out.bias"}, "a file")
    with pytest.raises(ValueError, match="not finite"):
        FILES.check({**weights, "out.bias": np.full(4, np.nan, np.float32)}, "a file")


@pytest.mark.parametrize("scale", [0.4, 0.75, 1.25, 1.5])
def test_resampled_squares_with_a_part_of_a_wall_are_occupied_in_either_direction(scale):
    levels = np.full((40, 1), FREE, np.int8)
    levels[[3, 17, 18, 31]] = OCCUPIED
    count = round(40 * scale)
    found = _resampled(levels, (count, 1))[:, 0]
    walls = [(row * count, (row + 1) * count) for row in np.flatnonzero(levels[:, 0] == OCCUPIED)]
    expected = [any(40 * k < high and low < 40 * (k + 1) for low, high in walls) for k in range(count)]
    assert (found == OCCUPIED).tolist() == expected
    np.testing.assert_array_equal(_resampled(levels[::-1], (count, 1))[::-1, 0], found)
