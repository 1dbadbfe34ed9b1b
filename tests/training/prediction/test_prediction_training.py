"""The training of a network that predicts maps: floors, windows, resuming, and its card."""

import json
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.mapping.prediction.levels import FREE, OCCUPIED, UNKNOWN
from lidarium.mapping.prediction.network import WINDOW, load_weights
from lidarium.training.prediction.fitting import Windows
from lidarium.training.prediction.maps import FloorMaps, read_maps, source_of, write_maps
from lidarium.training.prediction.plans import draw_plan, plan_number
from lidarium.training.prediction.quality import QualityTally
from lidarium.training.prediction.settings import PredictionSettings
from lidarium.training.prediction.training import PredictionTraining, held_out
from lidarium.training.settings import read_any_training

SETTINGS = PredictionSettings(floors=2, maps=1, kinds={"apartment": 1.0}, batch=2, steps=2, checkpoint=1)


def read(tmp_path, text):
    path = tmp_path / "training.toml"
    path.write_text(text)
    return read_any_training(path)


def test_a_table_of_predictions_asks_for_this_training(tmp_path):
    assert read(tmp_path, "seed = 3\n[prediction]\nfloors = 7\n") == PredictionSettings(seed=3, floors=7)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[prediction]\nflors = 7\n", "prediction has no 'flors'"),
        ("[prediction]\n[fit]\nepochs = 3\n", "has no 'fit'"),
        ("prediction = 3\n", "want a table"),
        ("[prediction]\nkinds = { castle = 1.0 }\n", "kinds has 'castle'"),
        ("[prediction]\nbatch = 0\n", "batch"),
        ('[prediction]\nplans = "home:17"\n', "plans of prediction is 'home:17'; want a list"),
        ('[prediction]\nkinds = { plan = 1.0 }\nplans = ["home:01", "home:01"]\n', "want two floors at least"),
        ('[prediction]\nbegin = "nowhere.safetensors"\n', "begin is 'nowhere.safetensors'"),
    ],
)
def test_bad_tables_are_refused(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, text)


def test_an_interrupted_training_gives_the_same_weights(tmp_path):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    list(PredictionTraining(SETTINGS, whole).run())
    for part in ("fit", "fit", "weights"):
        steps = PredictionTraining(SETTINGS, parts).run()
        for step in steps:
            if step.part == part:
                break
        steps.close()
    found = load_weights(parts / "weights.safetensors")
    for name, array in load_weights(whole / "weights.safetensors").items():
        np.testing.assert_array_equal(found[name], array)
    card = json.loads((whole / "card.json").read_text())
    assert card["steps"] == 2
    assert card["floors"] + card["held_out_floors"] == 2
    with pytest.raises(ValueError, match="holds a training with steps = 2"):
        list(PredictionTraining(replace(SETTINGS, steps=5), whole).run())


def test_the_time_of_exploring_counts_over_interrupted_calls(tmp_path):
    training = PredictionTraining(replace(SETTINGS, floors=3, floors_minutes=1e-4), tmp_path / "run")
    steps = training.run()
    assert next(step.done for step in steps if step.done) == 1
    steps.close()
    with pytest.raises(ValueError, match="maps of 1 floors"):
        list(training.run())


def test_maps_are_read_as_they_were_written(tmp_path):
    maps = FloorMaps(np.array([[[FREE, UNKNOWN]]], np.int8), np.array([[True, False]]))
    write_maps(tmp_path / "a.npz", maps)
    np.testing.assert_array_equal(read_maps(tmp_path / "a.npz").levels, maps.levels)
    (tmp_path / "a.npz").write_bytes((tmp_path / "a.npz").read_bytes()[:60])
    with pytest.raises(ValueError, match="remove it"):
        read_maps(tmp_path / "a.npz")


def test_windows_are_pieces_of_maps_with_their_truth():
    levels = np.zeros((1, 60, 90), np.int8)
    levels[0, 20:40, 20:70] = FREE
    levels[0, 30, 30:40] = OCCUPIED
    windows = Windows([FloorMaps(levels, levels[0] == FREE)])
    seen, truth = windows.drawn(20, np.random.default_rng(0))
    assert seen.shape == truth.shape == (20, WINDOW, WINDOW)
    assert (seen == FREE).any(axis=(1, 2)).all()
    assert (truth[seen == FREE]).all()
    again, _ = windows.drawn(20, np.random.default_rng(0))
    np.testing.assert_array_equal(seen, again)


def test_floors_that_are_held_out_stay_so():
    few, many = held_out([(k,) for k in range(40)], 0.2), held_out([(k,) for k in range(80)], 0.2)
    assert many[:40] == few
    assert 0 < sum(few) < 40
    assert sum(held_out([(0,), (1,)], 0.0)) == 1


def test_variants_of_a_plan_are_held_out_together():
    settings = PredictionSettings(kinds={"plan": 0.8, "office": 0.2}, plans=("home:01", "home:02", "home:04"))
    sources = [source_of(settings, number) for number in range(60)]
    is_out = {}
    for source, out in zip(sources, held_out(sources, 0.3), strict=True):
        is_out.setdefault(source, set()).add(out)
    assert all(len(outs) == 1 for outs in is_out.values())
    assert sum(len(source) == 2 for source in is_out) == 3
    assert {frozenset(outs) for outs in is_out.values()} == {frozenset({True}), frozenset({False})}


def test_variants_of_plans_are_as_large_and_in_one_piece():
    plans = ("home:01", "home:02")
    for number in range(8):
        seed = (0, 12, number)
        plan, floor = load_floor(plans[plan_number(plans, seed)]), draw_plan(plans, seed, 0.5)
        free_m2 = (floor.raster(0.05, 0.3, 0.3).solid == 0).sum() * 0.05**2
        plan_m2 = (plan.raster(0.05, 0.3, 0.3).solid == 0).sum() * 0.05**2
        assert 0.5 * 0.85**2 < free_m2 / plan_m2 < 1.05 * 1.2**2
        assert floor.sha256 == draw_plan(plans, seed, 0.5).sha256
    bare, full = (draw_plan(plans, (0, 12, 0), share).raster(0.05, 0.3, 0.3) for share in (1.0, 0.0))
    assert bare.solid.shape == full.solid.shape
    assert (full.solid >= bare.solid).all()
    assert (full.solid != bare.solid).any()


def test_a_training_on_plans_begins_with_other_weights(tmp_path):
    settings = replace(
        SETTINGS, kinds={"plan": 1.0}, plans=("home:01", "home:02"), floors=4, begin="shipped", learning_rate=1e-9
    )
    list(PredictionTraining(settings, tmp_path / "training").run())
    shipped = load_weights()
    for name, array in load_weights(tmp_path / "training" / "weights.safetensors").items():
        np.testing.assert_allclose(array, shipped[name], atol=1e-3)
    with pytest.raises(ValueError, match="home:999"):
        list(PredictionTraining(replace(settings, plans=("home:01", "home:999")), tmp_path / "other").run())
    assert not (tmp_path / "other").exists()


def test_quality_counts_near_unknown_squares():
    levels = np.full((1, 40), UNKNOWN, np.int8)
    levels[0, :5], levels[0, 30] = FREE, OCCUPIED
    is_free = np.zeros((1, 40), np.bool_)
    is_free[0, :12] = True
    tally = QualityTally()
    tally.add(np.where(is_free, 0.9, 0.1).astype(np.float32), levels, is_free)
    found = tally.quality()
    assert found.wrong == 0.0
    assert found.squares == 15 + 9 + 10  # 3 m of 0.2 m behind the free ones, and on both sides of the wall
    assert found.wrong_all_free == pytest.approx((found.squares - 7) / found.squares)
    assert found.wrong_nearest == pytest.approx(6 / found.squares)
    assert found.calibration == pytest.approx(0.1, abs=1e-6)
