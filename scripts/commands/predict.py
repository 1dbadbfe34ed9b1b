"""`lidarium predict`: predict what is behind the border of a map."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tyro.conf import Positional

from lidarium.scripts.common import Answer, Command, Outputs, file_name

DEFAULT_FOLDER = Path("predicted")

MOST_MARGIN = 100.0
"""Maximum margin around a map [m]."""


@dataclass(frozen=True, kw_only=True)
class _Predict(Command):
    """Predict which unknown cells of a map are free.

    Writes the map with probable cells filled in as a ROS map, the probabilities as probability.npz, and a picture.
    """

    compiles: ClassVar[bool] = True

    map: Positional[Path]
    """a ROS map (yaml with its image), or an image with --resolution"""
    resolution: float | None = None
    """metres per pixel of a map that is a plain image: dark is occupied, light is free, between is unknown"""
    predictor: str = "network"
    """name of the predictor"""
    weights: Path | None = None
    """weights of the network, instead of those of the package"""
    margin: float = 6.0
    """predicted space around the map [m]"""

    def __post_init__(self) -> None:
        Command.__post_init__(self)
        if not 0.0 <= self.margin <= MOST_MARGIN:
            raise ValueError(f"--margin is {self.margin} m; want 0 to {MOST_MARGIN:g}")


def execute(command: _Predict) -> Answer:
    """Predict a map and write the results."""
    import numpy as np

    from lidarium.evaluation.drawing.prediction_picture import save_prediction_picture
    from lidarium.mapping.files.map_files import read_grey_map, read_ros_map, write_ros_map
    from lidarium.mapping.files.output import write_arrays, write_json
    from lidarium.mapping.prediction.levels import UNKNOWN
    from lidarium.mapping.prediction.predictors import make_predictor
    from lidarium.mapping.prediction.whole_maps import predict_map

    is_ros = command.map.suffix.lower() in (".yaml", ".yml")
    if is_ros == (command.resolution is not None):
        want = "leave --resolution out" if is_ros else "want --resolution, its metres per pixel"
        raise ValueError(f"{command.map} is {'a ROS map that states its scale' if is_ros else 'no ROS map'}; {want}")
    out = command.out or DEFAULT_FOLDER
    name = file_name(command.map.stem)
    files = (f"{name}.yaml", f"{name}.pgm", "probability.npz", "prediction.png", "prediction.json")
    Outputs(files, "prediction.json", "expected_free_m2").check(out, (command.map,))
    if command.resolution is None:
        image = read_ros_map(command.map)
    else:
        image = read_grey_map(command.map, command.resolution)
    options = {} if command.weights is None else {"weights": command.weights}
    found = predict_map(image, make_predictor(command.predictor, **options), command.margin)
    arrays = {
        "probability": found.probability,
        "levels": found.levels,
        "origin": np.array(found.image.origin),
        "resolution": np.array(found.image.resolution),
    }
    is_unknown = found.levels == UNKNOWN
    area = found.image.resolution**2
    known = float((found.levels < 0).sum()) * area
    expected = float(found.probability[is_unknown].sum()) * area
    result = {
        "map": str(out / f"{name}.yaml"),
        "resolution": found.image.resolution,
        "known_free_m2": round(known, 2),
        "expected_free_m2": round(expected, 2),
        "predictor": command.predictor,
    }
    write_json(out / "prediction.json", result)
    write_arrays(out / "probability.npz", arrays)
    save_prediction_picture(out / "prediction.png", found, f"{command.map.stem}, predicted")
    written = write_ros_map(out, name, found.image.levels, found.image.origin, found.image.resolution)
    text = (
        f"{known:.1f} m2 are known to be free, and {expected:.1f} m2 more are expected behind the border; "
        f"{written}, probability.npz, prediction.png and prediction.json are in {out}"
    )
    return Answer(result, text)
