"""What is done with a file of each kind: it is read, and used for the first time."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from drawn_decisions import drawn_decision

from lidarium.agents import make_policy
from lidarium.agents.learned.network import Network, load_weights
from lidarium.agents.srt.tree_files import read_tree
from lidarium.envs.floors.catalogue.drawn import load_drawn
from lidarium.envs.floors.catalogue.names import load_floor
from lidarium.envs.floors.floor import Floor
from lidarium.evaluation.analysis.episodes import read_episodes as read_rows
from lidarium.evaluation.analysis.groups import grouped
from lidarium.evaluation.drawing.record_frames import TrackFrames, radius_of
from lidarium.evaluation.metrics.relations import read_relations
from lidarium.evaluation.record import read_record
from lidarium.evaluation.record.replay import drive_again
from lidarium.evaluation.suites.campaign import _kept_suite
from lidarium.evaluation.suites.episodes_file import read_episodes
from lidarium.evaluation.suites.suite import read_suite
from lidarium.mapping.files.bags.reading import read_bag_log
from lidarium.mapping.files.carmen_logs import read_carmen_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.map_files import cropped, read_grey_map, read_ros_map
from lidarium.mapping.files.mines_logs import read_mines_log
from lidarium.mapping.files.npz_logs import read_npz_log
from lidarium.mapping.files.spline_files import compact_arrays, read_spline_map
from lidarium.mapping.files.trajectories import interpolated, read_tum
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.registry import make_localizer
from lidarium.mapping.point_clouds.cameras import Intrinsics, read_pose
from lidarium.mapping.point_clouds.cloud_files import read_cloud
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.map_files import _parsed_binary, binary_content, read_sparse_map
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.planning import plan
from lidarium.mapping.sparse.swept_body import SweptBody
from lidarium.mapping.sparse.up_axis import check_up
from lidarium.scripts.commands.evaluate import summary_of
from lidarium.training.places import place_of
from lidarium.training.settings import read_training
from lidarium.training.teaching.samples import joined, read_samples

SCANS = 3


def _use_floor(floor: Floor) -> None:
    floor.raster(0.05, 0.2, 0.2)
    _ = floor.sha256, floor.geometry_sha256


def _floor(path: Path) -> None:
    _use_floor(load_floor(path))


def _image(path: Path) -> None:
    _use_floor(load_floor(path, 0.1))
    read_grey_map(path, 0.05)


def _plan(path: Path) -> None:
    _use_floor(load_floor(path, 0.1))


def _map(path: Path) -> None:
    found = read_ros_map(path)
    cropped(found.levels, found.origin[:2], found.resolution)
    _use_floor(load_floor(path))


def _drawn(path: Path) -> None:
    _use_floor(load_drawn(path))


def _array(path: Path) -> None:
    _use_floor(load_floor(path, None if path.suffix == ".npz" else 0.1))


def _log(read: Callable[[Path], LaserLog], path: Path) -> None:
    log = read(path).limited(20.0, True)
    slam = make_localizer("slam", log.geometry)
    slam.reset(log.laser_pose, 0)
    poses = np.zeros((len(log.stamps), 3)) if log.odometry is None else log.odometry
    for k in range(min(SCANS, len(log.stamps))):
        if np.isfinite(poses[k]).all():
            slam.localize(Sensing(float(log.stamps[k]), poses[k], log.ranges[k]))


def _trajectory(path: Path) -> None:
    stamps, poses = read_tum(path)
    interpolated(stamps, poses, np.linspace(stamps[0], stamps[-1], 5))


def _splines(path: Path) -> None:
    spline_map = read_spline_map(path)
    compact_arrays(spline_map)
    spline_map.sample()


def _cloud(path: Path) -> None:
    cloud = read_cloud(path)
    assert np.isfinite(cloud.points).all()
    check_up(cloud.points, (0.0, 0.0, 1.0), 0)
    map_cloud(cloud.points, 16)


def _depth(path: Path) -> None:
    cloud = read_cloud(path, intrinsics=Intrinsics(30.0, 30.0, 16.0, 12.0))
    assert np.isfinite(cloud.points).all()


def _sparse(path: Path) -> None:
    sparse_map, edges = read_sparse_map(path)
    again, _ = _parsed_binary(binary_content(sparse_map, edges))
    assert np.array_equal(again.free, sparse_map.free) or path.suffix == ".txt"  # text has more digits
    graph = build_graph(sparse_map.free, sparse_map.boxes, SweptBody(radius=0.2, height=0.5))
    if len(graph.nodes):
        plan(graph, graph.nodes[0, :2], graph.nodes[-1, :2])


def _tree(path: Path) -> None:
    tree = read_tree(path)
    for node in tree.nodes:
        assert np.isfinite(node.pose).all()


def _record(path: Path) -> None:
    record = read_record(path)
    display = record.display
    display.map_at(float(display.times[-1]))
    display.poses_at(1.0)
    display.coverage_at(1.0)
    drive_again(record)
    TrackFrames(record, size=64).draw(0.5)
    radius_of(record)


def _suite(path: Path) -> None:
    suite = read_suite(path)
    suite.as_dict()
    for _, trial in zip(range(20), suite.trials(), strict=False):
        suite.starts_of(trial)
        make_policy("random_walk") if trial.policy == "" else suite.make_policy(trial.policy)
        suite.settings(trial.variant, trial.robots)


def _episodes(path: Path) -> None:
    folder = path.parent / "folder"
    folder.mkdir(exist_ok=True)
    shutil.copy(path, folder / "episodes.jsonl")
    rows = read_rows(folder).rows
    for group in grouped(rows):
        _ = group.title, group.slug, group.floors
    summary_of([{"variant": "", **row} for row in rows])
    read_episodes(path)


def _weights(path: Path) -> None:
    Network(load_weights(path)).preferences(drawn_decision(np.random.default_rng(0)))


def _lessons(path: Path) -> None:
    samples = joined([read_samples(path)] * 2)
    samples.decisions.take(np.arange(len(samples)))


def _training(path: Path) -> None:
    training = read_training(path)
    place_of(training, training.rounds[-1], 7)
    training.as_dict()


USES: dict[str, Callable[[Path], None]] = {
    "map": _map,
    "image": _image,
    "dungeon": _image,
    "kth": _floor,
    "amrl": _floor,
    "lifull": _floor,
    "houseexpo": _floor,
    "drawn": _drawn,
    "svg": _plan,
    "sdf": _floor,
    "posed": _floor,
    "stage": _floor,
    "styled": _plan,
    "movingai": _plan,
    "dxf": _floor,
    "bag": lambda path: _log(read_bag_log, path),
    "array": _array,
    "log": lambda path: _log(read_npz_log, path),
    "carmen": lambda path: _log(read_carmen_log, path),
    "mines": lambda path: _log(read_mines_log, path),
    "trajectory": _trajectory,
    "relations": read_relations,
    "splines": _splines,
    "cloud": _cloud,
    "depth": _depth,
    "pose": read_pose,
    "sparse": _sparse,
    "tree": _tree,
    "record": _record,
    "suite": _suite,
    "episodes": _episodes,
    "kept": _kept_suite,
    "weights": _weights,
    "lessons": _lessons,
    "training": _training,
}
"""By the beginning of a sample's name."""


def use(path: Path) -> None:
    """Read a file and use it, as its name says."""
    USES[path.name.replace("_", ".").split(".")[0]](path)
