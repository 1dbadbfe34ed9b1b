"""Settings of quantisation."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from scattered_points import room, searched

from lidarium.mapping.sparse.quantisation import quantiser
from lidarium.mapping.sparse.quantisation.lloyd import improved, nearest_codes, summary_of
from lidarium.mapping.sparse.quantisation.quantiser import (
    METHODS,
    QuantisationSettings,
    _exchanged,
    _has_gpu,
    _improved_on_gpu,
    _merging_costs,
    _quantisation_of,
    _split_codes,
    quantise,
)
from lidarium.mapping.sparse.quantisation.tiles import tiles_of


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"method": "median"}, r"method of quantisation is 'median'; want one of kmeans\+\+, kmeans, lbg"),
        ({"mode": "printed"}, "want one of default, thesis"),
        ({"device": "tpu"}, "want one of cpu"),
        ({"budget_s": 0.0}, "budget_s of quantisation"),
        ({"steps": -1}, "steps of quantisation"),
    ],
)
def test_settings_that_make_no_sense_are_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        QuantisationSettings(**wrong)


def test_codes_without_points_stay_in_the_thesis_mode_alone():
    assert QuantisationSettings(mode="thesis").keeps_empty
    assert not QuantisationSettings().keeps_empty


def test_splitting_is_deterministic_and_doubles():
    tiles = tiles_of(room())
    codes = _split_codes(tiles, 64, 7)
    assert codes.shape == (64, 3)
    assert (codes == _split_codes(tiles, 64, 7)).all()
    assert len(_split_codes(tiles, 1, 7)) == 1
    for count in (0, 3, 48):
        with pytest.raises(ValueError, match="want a power of two"):
            _split_codes(tiles, count, 7)


def test_exchanges_take_from_where_codes_are_crowded():
    crowd = np.random.default_rng(0).normal(0.0, 0.01, (400, 3))
    spread = np.random.default_rng(1).uniform((5, 0, 0), (9, 4, 0), (400, 3))
    tiles = tiles_of(np.concatenate([crowd, spread]).astype(np.float32))
    codes = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [7, 2, 0]], np.float32)
    summary = summary_of(tiles, codes, nearest_codes(tiles, codes))
    costs, partners = _merging_costs(codes, summary.masses)
    assert (partners[:3] < 3).all()
    assert costs[3] > costs[:3].max()
    moved = _exchanged(codes, summary, 1)
    assert (moved[:, 0] > 5).sum() == 2
    assert nearest_codes(tiles, moved).group_errors.sum() < 0.8 * summary.errors[:, 1].sum()


POINTS = room()


def test_torch_gives_the_codes_of_the_processor_on_any_of_its_devices():
    pytest.importorskip("torch")
    tiles = tiles_of(POINTS)
    devices = ("cpu", "cuda") if _has_gpu() else ("cpu",)
    for device in devices:
        found = _improved_on_gpu(tiles, POINTS[:40], 5, device=device)
        assert found == pytest.approx(improved(tiles, POINTS[:40], 5), abs=1e-5)


@pytest.mark.skipif(not _has_gpu(), reason="torch finds no GPU")
def test_a_gpu_gives_the_same_quantisation():
    found, wanted = (quantise(POINTS, 40, QuantisationSettings(device=name)) for name in ("cuda", "cpu"))
    assert found.codes == pytest.approx(wanted.codes, abs=1e-5)


@pytest.mark.skipif(_has_gpu(), reason="torch finds a GPU")
def test_a_gpu_that_is_not_there_is_told():
    with pytest.raises(RuntimeError, match="torch finds no GPU"):
        quantise(POINTS, 4, QuantisationSettings(device="cuda"))
    assert quantise(POINTS, 4, QuantisationSettings(device="auto")).counts.all()


def quantised(points, codes, weights=None):
    tiles, codes = tiles_of(points, weights), np.asarray(codes, np.float32)
    return _quantisation_of(tiles, codes, nearest_codes(tiles, codes))


def test_labels_are_in_the_callers_order():
    points = room(900)
    codes = points[[1, 50, 300, 899]]
    np.testing.assert_array_equal(quantised(points, codes).labels, searched(points, codes)[0])


def test_errors_are_weighted_means_over_all_points():
    points = np.array([[1.0, 0, 0], [0.0, 2, 0], [10.0, 0, 0]], np.float32)
    found = quantised(points, [[0.0, 0, 0], [10.0, 0, 0]], np.array([1.0, 1.0, 2.0]))
    assert (found.phi1, found.phi2) == pytest.approx((3.0 / 4.0, 5.0 / 4.0))
    assert found.counts.tolist() == [2, 1]
    assert found.rho.tolist() == [2.0, 0.0]


def test_a_code_without_points_is_its_own_box_without_a_normal():
    found = quantised(room(100), [[0.0, 0, 0], [90.0, 80.0, 70.0]])
    assert found.boxes[1].tolist() == [[90.0, 80.0, 70.0]] * 2
    assert np.isnan(found.normals[1]).all()
    assert found.counts.tolist() == [100, 0]


def test_normals_point_upwards_and_two_points_have_none():
    generator = np.random.default_rng(0)
    floor = generator.uniform(-1.0, 1.0, (80, 3)) * [1.0, 1.0, 0.0]
    wall = generator.uniform(-1.0, 1.0, (80, 3)) * [0.0, 1.0, 1.0] + [50.0, 0, 0]
    two = np.array([[0.0, 90.0, 0.0], [1.0, 90.0, 0.0]])
    points = np.concatenate([floor, wall, two]).astype(np.float32)
    found = quantised(points, [[0.0, 0, 0], [50.0, 0, 0], [0.5, 90.0, 0.0]])
    np.testing.assert_allclose(found.normals[:2], [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)], atol=1e-6)
    assert np.isnan(found.normals[2]).all()


NAN = np.where(np.arange(len(POINTS))[:, None] == 7, np.nan, POINTS)


BAD = {
    "no points": (lambda: quantise(np.empty((0, 3)), 1), "at least one point"),
    "shape": (lambda: quantise(POINTS[:, :2], 1), r"want \(N, 3\)"),
    "all equal": (lambda: quantise(np.ones((90, 3)), 2), "all 90 points are at"),
    "fewer than k": (lambda: quantise(POINTS[:5], 6), "6 codes are asked for of 5 points"),
    "fewer places": (lambda: quantise(np.repeat(POINTS[:5], 9, axis=0), 6), "5 different places"),
    "no codes": (lambda: quantise(POINTS, 0), "0 codes are asked for"),
    "power": (lambda: quantise(POINTS, 12, QuantisationSettings("lbg")), "want a power of two"),
    "nan": (lambda: quantise(NAN, 4), "want finite coordinates"),
    "weights": (lambda: quantise(POINTS, 4, weights=np.ones(3)), "weights have shape"),
    "weight": (lambda: quantise(POINTS[:2], 1, weights=[1.0, 0.0]), "above 0"),
    "start": (lambda: quantise(POINTS, 4, start=POINTS[:3]), r"want \(4, 3\)"),
}


@pytest.mark.parametrize("method", METHODS)
def test_what_is_said_of_every_code_holds_for_its_points(method):
    found = quantise(POINTS, 32, QuantisationSettings(method))
    labels, squares = searched(POINTS, found.codes)
    assert found.codes.dtype == np.float64
    assert found.labels.dtype == np.int32
    assert (found.labels == labels).all()
    assert (found.counts == np.bincount(labels, minlength=32)).all()
    assert found.phi1 == pytest.approx(np.sqrt(squares).mean(), rel=1e-6)
    assert found.phi2 == pytest.approx(squares.mean(), rel=1e-6)
    for code in range(32):
        own = POINTS[labels == code]
        assert (found.boxes[code] == [own.min(axis=0), own.max(axis=0)]).all()
        assert found.rho[code] == pytest.approx(np.sqrt(squares[labels == code].max()), rel=1e-6)
        variances, axes = np.linalg.eigh(np.cov(own.astype(float).T))
        if variances[0] < 0.1 * variances[1]:
            assert abs(found.normals[code] @ axes[:, 0]) == pytest.approx(1.0, abs=1e-4)
    assert (found.normals[:, 2] >= 0.0).all()


@pytest.mark.parametrize("method", METHODS)
def test_the_same_seed_gives_the_same_bits(method):
    first, again = (quantise(POINTS, 16, QuantisationSettings(method, seed=3)) for _ in range(2))
    assert (first.codes == again.codes).all()
    assert (first.labels == again.labels).all()
    other = quantise(POINTS, 16, QuantisationSettings(method, seed=4))
    assert (other.codes == first.codes).all() == (method == "lbg")


@pytest.mark.parametrize("method", METHODS)
def test_weights_count_as_repeated_points(method):
    points, times = POINTS[:600], np.random.default_rng(0).integers(1, 5, 600)
    repeated = np.repeat(points, times, axis=0)
    start = None if method == "lbg" else points[:16]
    settings = QuantisationSettings(method)
    weighted = quantise(points, 16, settings, times, start)
    alone = quantise(repeated, 16, settings, start=start)
    assert weighted.codes == pytest.approx(alone.codes, abs=1e-5)
    assert weighted.phi1 == pytest.approx(alone.phi1, rel=1e-5)
    assert weighted.phi2 == pytest.approx(alone.phi2, rel=1e-5)


def test_a_start_takes_the_place_of_draws():
    start = POINTS[:8]
    found = quantise(POINTS, 8, QuantisationSettings(steps=0), start=start)
    assert (found.codes == start).all()


def test_codes_without_points_stay_in_the_thesis_mode_only():
    start = np.concatenate([POINTS[:7], [[500.0, 0.0, 0.0]]])
    kept = quantise(POINTS, 8, QuantisationSettings(mode="thesis"), start=start)
    assert kept.counts[-1] == 0
    assert kept.codes[-1].tolist() == [500.0, 0.0, 0.0]
    assert (kept.boxes[-1] == kept.codes[-1]).all()
    assert kept.rho[-1] == 0.0
    assert np.isnan(kept.normals[-1]).all()
    assert quantise(POINTS, 8, start=start).counts.all()
    assert quantise(POINTS, 8, QuantisationSettings(steps=0), start=start).counts.all()


def test_every_point_may_have_a_code_of_its_own():
    found = quantise(POINTS[:50], 50)
    assert found.phi2 == 0.0
    assert (found.counts == 1).all()
    assert quantise(POINTS[:1], 1).phi1 == 0.0


def test_a_budget_lowers_the_error_and_is_kept(monkeypatch):
    plain = quantise(POINTS, 64)
    clock = itertools.count()  # a second passes from each look at it to the next
    monkeypatch.setattr(quantiser, "time", SimpleNamespace(perf_counter=lambda: float(next(clock))))
    better = quantise(POINTS, 64, QuantisationSettings(budget_s=20.0))
    assert 10 < next(clock) <= 20
    assert better.phi2 < plain.phi2
    assert (better.labels == searched(POINTS, better.codes)[0]).all()
    assert quantise(POINTS, 64, QuantisationSettings(budget_s=1e-9)).phi2 == plain.phi2


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_a_budget_is_no_harm_to_few_points(count):
    points = np.repeat(POINTS[:50], 2, axis=0)
    plain = quantise(points, count)
    better = quantise(points, count, QuantisationSettings(budget_s=0.05))
    assert better.phi2 <= plain.phi2
    assert better.counts.all()


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_with_its_cause(name):
    quantising, words = BAD[name]
    with pytest.raises(ValueError, match=words):
        quantising()


def test_real_frames_are_quantised(shared_data):
    path = shared_data / "clouds/redkitchen/redkitchen_fused_2cm.npz"
    if not path.is_file():
        pytest.skip(f"no real cloud at {path}")
    with np.load(path) as archive:
        points = archive["xyz"][::10]
    found = quantise(points, 64)
    assert (found.labels == searched(points, found.codes)[0]).all()
    assert 0.1 < found.phi1 < 0.4
