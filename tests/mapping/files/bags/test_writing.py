"""Messages are written as another library encodes them, or not at all."""

import io
import math

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed: extra [bags]")
pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")

from mcap.reader import make_reader
from mcap_ros2._dynamic import serialize_dynamic

from lidarium.mapping.files.bags import messages
from lidarium.mapping.files.bags.writing import BagWriter, bag
from lidarium.mapping.grids.scan_geometry import ScanGeometry

GEOMETRY = ScanGeometry(beams=9, field_of_view=math.pi, range_min=0.1, range_max=5.0)


def quaternion(theta):
    return {"x": 0.0, "y": 0.0, "z": math.sin(theta / 2), "w": math.cos(theta / 2)}


def header(frame, sec, nanosec):
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def pose(x, y, theta, z=0.0):
    return {"position": {"x": x, "y": y, "z": z}, "orientation": quaternion(theta)}


def expected_messages():
    """Return messages as dicts, as `mcap_ros2` takes them."""
    nothing = dict.fromkeys("xyz", 0.0)
    return {
        messages.LASER_SCAN: {
            "header": header("odd", 2, 500_000_000),
            "angle_min": GEOMETRY.angle_first,
            "angle_max": -GEOMETRY.angle_first,
            "angle_increment": GEOMETRY.angle_increment,
            "time_increment": 0.0,
            "scan_time": 0.0,
            "range_min": 0.1,
            "range_max": 5.0,
            "ranges": [0.5 * k for k in range(9)],
            "intensities": [],
        },
        messages.ODOMETRY: {
            "header": header("odom", 2, 500_000_000),
            "child_frame_id": "base_link",
            "pose": {"pose": pose(1.0, -2.0, 0.5), "covariance": [0.0] * 36},
            "twist": {"twist": {"linear": nothing, "angular": nothing}, "covariance": [0.0] * 36},
        },
        messages.TRANSFORMS: {
            "transforms": [
                {
                    "header": header("map", 2, 500_000_000),
                    "child_frame_id": "odom",
                    "transform": {
                        "translation": {"x": 1.0, "y": 2.0, "z": 0.25},
                        "rotation": quaternion(-1.5),
                    },
                }
            ]
        },
        messages.GRID: {
            "header": header("map", 2, 500_000_000),
            "info": {
                "map_load_time": {"sec": 2, "nanosec": 500_000_000},
                "resolution": 0.05,
                "width": 3,
                "height": 2,
                "origin": pose(-1.0, -2.0, 0.0),
            },
            "data": [100, -1, 0, 0, 0, -1],
        },
        messages.PATH: {
            "header": header("map", 2, 500_000_000),
            "poses": [
                {"header": header("map", 1, 0), "pose": pose(0.0, 1.0, 2.0)},
                {"header": header("map", 2, 0), "pose": pose(0.5, 1.5, -2.0)},
            ],
        },
    }


def write_all(writer):
    writer.scan("/scan", "odd", 2.5, np.arange(9, dtype=np.float32) * 0.5, GEOMETRY)
    writer.odometry("/odom", "odom", "base_link", 2.5, (1.0, -2.0, 0.5))
    writer.transform("map", "odom", 2.5, (1.0, 2.0, -1.5), height=0.25)
    levels = np.array([[0, 127, 255], [255, 255, 127]], np.uint8)
    writer.grid("/map", "map", 2.5, levels, (-1.0, -2.0), 0.05)
    writer.path("/path", "map", 2.5, [1.0, 2.0], np.array([[0.0, 1.0, 2.0], [0.5, 1.5, -2.0]]))


@pytest.mark.parametrize("name", list(expected_messages()))
def test_bytes_are_those_that_mcap_ros2_encodes_by_the_definition_in_the_bag(name):
    file = io.BytesIO()
    writer = BagWriter(file)
    write_all(writer)
    writer.finish()
    reader = make_reader(io.BytesIO(file.getvalue()))
    ((definition, ours),) = [
        (schema.data.decode(), message.data) for schema, _, message in reader.iter_messages() if schema.name == name
    ]
    encode = serialize_dynamic(name, definition)[name]
    assert ours == bytes(encode(expected_messages()[name]))


def test_nothing_is_written_where_writing_fails(log, tmp_path):
    lent = bag(tmp_path / "half.mcap")
    write_all(lent.__enter__())
    assert not lent.__exit__(RuntimeError, RuntimeError("half-way"), None)
    assert list(tmp_path.iterdir()) == []
