"""Predictions of a user's own map from the command line."""

import json

import numpy as np
import pytest
from drawn_maps import RESOLUTION, apartment, kept

from lidarium.mapping.files.map_files import FREE, OCCUPIED, UNKNOWN, read_ros_map, write_ros_map
from lidarium.mapping.prediction.network import FILES, shapes
from lidarium.scripts.main import main


@pytest.fixture
def part(tmp_path):
    """A part of an apartment, and weights of a network that was not trained."""
    levels = kept(apartment(), slice(0, 180), slice(0, 120))
    generator = np.random.default_rng(0)
    weights = {name: generator.normal(0.0, 0.05, shape).astype(np.float32) for name, shape in shapes().items()}
    FILES.save(tmp_path / "weights.safetensors", weights)
    return write_ros_map(tmp_path, "part", levels, (1.0, 2.0, 0.5), RESOLUTION), tmp_path / "weights.safetensors"


def test_a_map_is_predicted_and_what_is_known_stays(part, tmp_path, capsys):
    path, weights = part
    out = tmp_path / "out"
    assert main(["predict", str(path), "--weights", str(weights), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    predicted = {"probability.npz", "prediction.png", "prediction.json"}
    assert {each.name for each in out.iterdir()} == {"part.yaml", "part.pgm", *predicted}
    with np.load(out / "probability.npz") as arrays:
        levels, probability = arrays["levels"], arrays["probability"]
    assert (probability[levels < 0] == 1.0).all()
    assert (probability[levels > 0] == 0.0).all()
    drawn = read_ros_map(out / "part.yaml").levels
    assert (drawn[levels < 0] == FREE).all()
    assert (drawn[levels > 0] == OCCUPIED).all()
    assert found["expected_free_m2"] == pytest.approx(
        probability[levels == 0].sum() * found["resolution"] ** 2, abs=0.1
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--resolution", "0.05"], "leave --resolution out"),
        (["--predictor", "nothing"], "Nothing predicts nothing"),
        (["--predictor", "netwrk"], "did you mean 'network'"),
        (["--margin", "-1"], "--margin is -1"),
    ],
)
def test_what_cannot_be_predicted_is_named(part, tmp_path, capsys, options, message):
    assert main(["predict", str(part[0]), "--out", str(tmp_path / "out"), *options]) != 0
    assert message in capsys.readouterr().err


def test_a_map_without_free_space_is_refused(tmp_path, capsys):
    path = write_ros_map(tmp_path, "blank", np.full((40, 40), UNKNOWN, np.uint8), (0.0, 0.0, 0.0), 0.1)
    assert main(["predict", str(path), "--predictor", "nothing", "--out", str(tmp_path / "out")]) != 0
    assert "no free cell" in capsys.readouterr().err
