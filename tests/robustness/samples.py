"""Valid files of every reader, small ones, from which damaged ones are made."""

import gzip
import importlib.util
import json
import math
from pathlib import Path

import cv2
import numpy as np
import yaml
from bag_forms import write_form
from cloud_files import lines_of, packed_body, pcd, ply
from drawn_decisions import drawn_decision

import lidarium
from lidarium.agents.learned.network import _shapes, save_weights
from lidarium.agents.srt.safe_region import DIRECTIONS
from lidarium.agents.srt.tree import RegionRules
from lidarium.agents.srt.tree_files import write_tree
from lidarium.envs.settings.making import make_settings
from lidarium.evaluation.episodes.runner import run_episode
from lidarium.evaluation.episodes.watching import WatchedExploration
from lidarium.evaluation.record import Recorder, write_record
from lidarium.evaluation.suites.campaign import Campaign
from lidarium.evaluation.suites.suite import read_suite
from lidarium.mapping.files.bags.writing import write_mcap_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.files.map_files import write_ros_map
from lidarium.mapping.files.npz_logs import write_npz_log
from lidarium.mapping.files.spline_files import write_spline_map
from lidarium.mapping.files.trajectories import write_tum
from lidarium.mapping.geometry.rigid import Transform
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.sparse.graph import build_graph
from lidarium.mapping.sparse.map_files import _GraphEdges, write_sparse_map
from lidarium.mapping.sparse.mapper.full import map_cloud
from lidarium.mapping.sparse.settings import MapperSettings
from lidarium.mapping.sparse.swept_body import SweptBody
from lidarium.mapping.splines.features import observe, scan_points
from lidarium.mapping.splines.spline_map import SplineMap
from lidarium.training.teaching.samples import samples_of, write_samples
from lidarium.training.teaching.teacher import Lesson

PLAN = {
    "name": "two rooms",
    "about": "Two rooms with a door.",
    "bounds": [0, 0, 6, 4],
    "outer_wall": 0.2,
    "walls": [[3, 0, 3, 4]],
    "blocks": [[1, 1, 1.5, 1.5]],
    "doors": [[3, 2]],
    "obstacles": [{"corners": [[4, 1], [5, 1], [4.5, 2]], "height": 1.2}],
    "wall_height": 2.5,
    "furniture": [["bed", 2, 3, 90]],
    "starts": [[1, 2, 0]],
    "goal": [5, 3],
}
PLANS = {
    "svg.svg": '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 60 40"><rect width="60" height="40" '
    'fill="none" stroke="black"/><path d="M 30 0 v 25 c 1 1 2 2 3 0 z" transform="rotate(3)"/></svg>',
    "sdf.world": '<?xml version="1.0"?><sdf version="1.6"><world name="w"><model name="m">'
    '<pose>1 0 0 0 0 1</pose><link name="a"><collision name="c"><pose>3 2 1 0 0 0</pose>'
    "<geometry><box><size>6 0.2 2</size></box>"
    '</geometry></collision><collision name="d"><geometry><cylinder><radius>0.4</radius><length>1</length>'
    "</cylinder></geometry></collision></link></model></world></sdf>",
    "posed.world": '<sdf version="1.9"><world name="w"><frame name="f"><pose>1 0 0 0 0 1</pose></frame><model name="m">'
    '<pose relative_to="f">1 0 0 0 0 1</pose><link name="a"><pose relative_to="b">1 0 0 0 0 0</pose>'
    '<collision name="c"><geometry><box><size>6 0.2 2</size></box></geometry></collision></link>'
    '<link name="b"/></model></world></sdf>',
    "stage.world": 'define plan model ( boundary 1 )\nplan ( size [6 4 1] pose [1 2 0 0] bitmap "image.pgm" )\n'
    "position ( pose [ 0 1 0 90 ] )\n",
    "styled.svg": "<svg viewBox='0 0 60 40'><style>.a > rect {fill: none} #b {stroke: #0008}</style><g class='a' "
    "opacity='.9'><rect width='60' height='40' stroke='black'/></g><path id='b' d='M 30 0 v 25'/>"
    "<linearGradient id='c'><stop stop-color='#000'/></linearGradient><use href='#b' x='9' fill='url(#c)'/></svg>",
    "movingai.map": "type octile\nheight 4\nwidth 6\nmap\n@@@@@@\n@...T@\n@.S..@\n@@@@@@\n",
}
SUITE = """
policies = ["random_walk", "greedy"]
floors = ["apartment"]
robots = [1, 2]
seeds = 2
draws_starts = true

[settings]
horizon_s = 2.0
robot = "pioneer"
lidar = { beams = 90, range_max = 4.0 }
radio = { kind = "range", reach = 5.0 }

[variants.plain]
[variants.noisy]
noise = "datasheet"

[policy_settings.greedy]
policy = "nearest_frontier"

[stop]
figure = "c_free"
at_least = 0.9
"""
TRAINING = """
seed = 3

[settings]
resolution = 0.05
lidar = "urg"

[[rounds]]
floors = 300
kinds = { apartment = 0.7, building = 0.3 }
robots = [1, 1, 2]
teaching_share = 0.5

[fit]
epochs = 20
learning_rate = 5e-4

[ppo]
decisions = 100
environments = 2
steps = 8
checkpoint = 64

[validation]
floors = ["set:validation:16", "apartment"]
robots = [1, 3]
"""
KTH = """<?xml version="1.0"?>
<floor><Scale PixelDistance="10" RealDistance="1.0"/>
<space name="a"><contour>{}</contour></space><space name="b"><contour>{}</contour></space></floor>
"""


def make_samples(folder: Path) -> None:
    """Write a valid file of each kind into a folder; its name begins with the name of the reader."""
    folder.mkdir(parents=True, exist_ok=True)
    _maps(folder)
    _floors(folder)
    _logs(folder)
    _clouds(folder)
    _trees(folder)
    _results(folder)
    _trainings(folder)


def _room() -> np.ndarray:
    pixels = np.full((40, 60), 254, np.uint8)
    pixels[[0, -1]] = pixels[:, [0, -1]] = 0
    pixels[20, :40] = 0
    pixels[25:30, 50:55] = 205
    return pixels


def _maps(folder: Path) -> None:
    levels = np.where(_room() == 254, 255, np.where(_room() == 0, 0, 127)).astype(np.uint8)
    write_ros_map(folder, "map", levels, (1.0, -2.0, 0.3), 0.1)
    for suffix in ("png", "bmp", "jpg", "tif"):
        cv2.imwrite(str(folder / f"image.{suffix}"), _room())
    (folder / "image.pgm").write_bytes(b"P5\n# a remark\n60 40\n255\n" + _room().tobytes())
    rows = "\n".join(" ".join(map(str, row)) for row in _room())
    (folder / "image_ascii.pgm").write_text(f"P2\n60 40\n255\n{rows}\n")
    dungeon = np.where(_room() == 0, 100, 200).astype(np.uint8)
    dungeon[5:8, 5:8] = 208
    cv2.imwrite(str(folder / "dungeon.png"), dungeon)
    header = {"image": "map.pgm", "resolution": 0.1, "origin": [0.0, 0.0, 0.0], "negate": 0}
    header |= {"occupied_thresh": 0.65, "free_thresh": 0.196, "mode": "scale"}
    (folder / "map_scale.yaml").write_text(yaml.safe_dump(header))


def _floors(folder: Path) -> None:
    ring = [(0, 0, 60, 0), (60, 0, 60, 40), (60, 40, 0, 40), (0, 40, 0, 0)]
    tags = "".join(
        f'<linesegment x1="{a}" y1="{b}" x2="{c}" y2="{d}" type="{"Portal" if a == c == 60 else "Wall"}"/>'
        for a, b, c, d in ring
    )
    moved = tags.replace('"60"', '"130"').replace('"0"', '"65"')
    lines = [(0, 0, 6, 0), (6, 0, 6, 4), (6, 4, 0, 4), (0, 4, 0, 0), (3, 0, 3, 3)]
    texts = {
        "kth.xml": KTH.format(tags, moved),
        "amrl.vectormap.txt": "".join(f"{a}, {b}, {c}, {d}\n" for a, b, c, d in lines),
        "lifull.txt": "".join(f"{10 * a} {10 * b} {10 * c} {10 * d} wall\n" for a, b, c, d in lines)
        + "30 30 30 40 door\n",
        "houseexpo.json": json.dumps({"id": "h", "verts": [[0, 0], [6, 0], [6, 4], [3, 5], [0, 4], [0, 0]]}),
    }
    for name, text in PLANS.items():
        (folder / name).write_text(text)
    for name, text in texts.items():
        (folder / name).write_text(text)
        (folder / f"{name}.gz").write_bytes(gzip.compress(text.encode()))
    if importlib.util.find_spec("ezdxf") is not None:  # the extra dxf
        _drawing(folder / "dxf.dxf")
    (folder / "drawn.json").write_text(json.dumps(PLAN, indent=1))
    np.save(folder / "array.npy", _room())
    np.savez_compressed(folder / "array.npz", solid=_room() == 0, origin=np.array([0.0, 1.0]), resolution=np.array(0.1))


def _drawing(path: Path) -> None:
    """Write a room in millimetres with a table, which is a block, and curves."""
    import ezdxf

    ezdxf.options.write_fixed_meta_data_for_testing = True  # the same bytes at each call
    document = ezdxf.new(units=4)
    space, table = document.modelspace(), document.blocks.new("TABLE")
    table.add_lwpolyline([(0, 0), (100, 0), (100, 50)], close=True)
    space.add_lwpolyline([(0, 0), (6000, 0), (6000, 4000), (0, 4000)], close=True)
    space.add_blockref("TABLE", (1000, 1000), {"xscale": 10, "rotation": 30})
    space.add_line((3000, 0), (3000, 2500))
    space.add_arc((3000, 2500), 800, 0, 90)
    space.add_spline([(4000, 1000), (4500, 1500), (5000, 1000)])
    document.saveas(path)


def _logs(folder: Path) -> None:
    geometry = ScanGeometry(beams=90, field_of_view=math.pi, range_max=8.0)
    steps = np.arange(12)
    poses = np.stack([0.1 * steps, 0.02 * steps, 0.03 * steps], axis=1)
    angles = geometry.angles
    # A room of 6 m x 4 m about the start.
    ranges = np.array(
        [
            np.minimum(
                (3.0 - x * np.sign(np.cos(angles + t))) / np.abs(np.cos(angles + t)),
                (2.0 - y * np.sign(np.sin(angles + t))) / np.maximum(np.abs(np.sin(angles + t)), 1e-6),
            )
            for x, y, t in poses
        ],
        np.float32,
    )
    log = LaserLog(
        stamps=0.2 * steps,
        ranges=ranges,
        geometry=geometry,
        odometry=poses,
        readings_stamps=0.2 * steps,
        readings=poses,
        reading_of_scan=steps.astype(np.int64),
    )
    write_npz_log(folder / "log.npz", log)
    if importlib.util.find_spec("rosbags") is not None:  # the extra bags
        write_mcap_log(folder / "bag.mcap", log)
        for name in ("bag.db3", "bag_lz4.bag", "bag_bz2.bag", "bag.db3.zstd"):
            write_form(folder / name, folder / "bag.mcap")
    lines = ["PARAM robot_frontlaser_offset 0.1"]
    for scan, (x, y, theta), stamp in zip(ranges, poses, log.stamps, strict=True):
        pose = f"{x:.4f} {y:.4f} {theta:.4f}"
        told = " ".join(f"{value:.2f}" for value in scan)
        lines += [
            f"ODOM {pose} 0.1 0.0 0.0 {stamp:.3f} host {stamp:.3f}",
            f"FLASER {len(scan)} {told} {pose} {pose} {stamp:.3f} host {stamp:.3f}",
        ]
    lines.append(f"LASER_READING {len(scan)} {told} {pose} {stamp + 0.2:.3f}")
    rows = [
        f"{200_000 * k} 0 {100 * k} {110 * k} {'0 ' * 20}{' '.join(['1500'] * 682)} 5" for k in range(len(log.stamps))
    ]
    (folder / "mines.dat").write_text("\n".join(rows) + "\n")
    (folder / "carmen.log").write_text("\n".join(lines) + "\n")
    (folder / "carmen.log.gz").write_bytes(gzip.compress((folder / "carmen.log").read_bytes()))
    write_tum(folder / "trajectory.tum", log.stamps, poses)
    (folder / "relations.txt").write_text("0.0 1.0 0.5 0.1 0 0 0 0.1\n0.4 2.0 0.8 0.1 0 0 0 0.2\n")
    spline_map = SplineMap()
    for scan, pose in zip(ranges, poses, strict=True):
        spline_map.update(observe(scan_points(scan, geometry)), Transform(*pose))
    write_spline_map(folder / "splines.json", spline_map)
    write_spline_map(folder / "splines.npz", spline_map)


def _clouds(folder: Path) -> None:
    """Write a floor of 3 m x 2 m with a wall in each form of clouds, as depth image and as sparse map."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0.0, 3.0, 0.2), np.arange(0.0, 2.0, 0.2)))
    across, up = (each.ravel() for each in np.meshgrid(np.arange(0.0, 2.0, 0.2), np.arange(0.2, 1.0, 0.2)))
    ground, wall = np.stack([x, y, 0.0 * x], axis=1), np.stack([0.0 * up + 3.0, across, up], axis=1)
    points = np.concatenate([ground, wall]).round(2).astype(np.float32)
    count, lines = len(points), lines_of(points)
    vertices = b"".join(b"v " + line + b"\n" for line in lines.splitlines())
    faces = b"property list uchar int vertex_indices\nend_header"
    files = {
        "ascii.pcd": pcd(points=count, body=lines),
        "binary.pcd": pcd("binary", points=count, body=points.tobytes()),
        "packed.pcd": pcd("binary_compressed", points=count, body=packed_body(points.T.tobytes())),
        "ascii.ply": ply("ascii", lines, count=count),
        "faces.ply": ply("binary_big_endian", points.astype(">f4").tobytes(), count=count)
        .replace(b"element face 0", b"element face 1")
        .replace(b"property list uchar int i\nend_header", faces)
        + b"\x03"
        + np.array([0, 1, 20], ">i4").tobytes(),
        "mesh.obj": b"# a floor\n" + vertices + b"f 1 2 17 16\nf -1/1 -2/2 -3/3\n",
        "lines.xyz": b"# x y z\n" + lines,
        "commas.txt": lines.replace(b" ", b"; ").replace(b".", b","),
    }
    for name, content in files.items():
        (folder / f"cloud_{name}").write_bytes(content)
    np.savez_compressed(folder / "cloud.npz", xyz=points)
    depth = np.full((24, 32), 2000, np.uint16)
    depth[:8], depth[20:, :5] = 0, 65535
    cv2.imwrite(str(folder / "depth.png"), depth)
    cv2.imwrite(str(folder / "depth.pgm"), depth)
    (folder / "pose.txt").write_text("0 0 1 0.5\n-1 0 0 0.25\n0 -1 0 1.0\n0 0 0 1\n")
    sparse_map = map_cloud(points, 32)
    graph = build_graph(sparse_map.free, sparse_map.boxes, SweptBody(radius=0.2, height=0.5))
    write_sparse_map(folder / "sparse.smap", sparse_map, _GraphEdges(graph.nodes, graph.edges))
    write_sparse_map(folder / "sparse_text.txt", map_cloud(points, 32, MapperSettings(mode="thesis")))


def _trees(folder: Path) -> None:
    """Write a tree of two agents; one sees a wall."""
    rules = RegionRules("star", 0.3, 4.0, 0.1, False)
    view = np.full(DIRECTIONS, 4.0)
    first = rules.node(0, "robot_0", np.array([0.0, 0.0, 0.5]), None, view)
    near = np.where(np.arange(DIRECTIONS) < DIRECTIONS // 3, 1.5, view)
    nodes = [first, rules.node(1, "robot_1", np.array([1.0, 0.5, -1.0]), 0, near)]
    nodes[0].neighbours[1] = 1.1
    write_tree(folder / "tree.npz", nodes, {"robot_0": rules, "robot_1": rules}, np.array([2.0, -1.0]))


def _results(folder: Path) -> None:
    recorder = Recorder("nearest_frontier", 3, "apartment")
    settings = make_settings(robots=2, horizon_s=3.0, lidar={"beams": 90}, noise="datasheet")
    env = WatchedExploration("apartment", settings, watchers=[recorder])
    run_episode(lidarium.policy("nearest_frontier"), env, 3)
    write_record(folder / "record.npz", recorder.finish())
    (folder / "suite.toml").write_text(SUITE)
    evaluated = folder / "evaluated"
    campaign = Campaign(read_suite(folder / "suite.toml"), evaluated, 1, False)
    for _ in campaign.run():
        pass
    (folder / "episodes.jsonl").write_bytes((evaluated / "episodes.jsonl").read_bytes())
    (folder / "kept_suite.json").write_bytes((evaluated / "suite.json").read_bytes())


def _trainings(folder: Path) -> None:
    generator = np.random.default_rng(0)
    drawn = {name: 0.1 * generator.normal(size=shape) for name, shape in _shapes().items()}
    save_weights(folder / "weights.safetensors", {name: each.astype(np.float32) for name, each in drawn.items()})
    lessons = [Lesson(drawn_decision(generator, 4, 2), generator.uniform(0, 9, 4)) for _ in range(3)]
    write_samples(folder / "lessons.npz", samples_of(lessons))
    (folder / "training.toml").write_text(TRAINING)
