"""Frames with right poses agree; wrong poses, scales and intrinsics contradict."""

import numpy as np
import pytest
from furnished_room import pose_at, room_points, seen_from

from lidarium.mapping.geometry.rigid_motions import inverse_of
from lidarium.mapping.point_clouds.agreement import FRAMES, FrameAgreement
from lidarium.mapping.point_clouds.cameras import Intrinsics, read_depth_image, read_pose


def agreement_of(frames):
    found = FrameAgreement()
    for points, pose in frames:
        found.add(points, pose)
    return found.share


@pytest.fixture(scope="module")
def kitchen(shared_data):
    folder = shared_data / "clouds" / "redkitchen"
    if not folder.is_dir():
        pytest.skip(f"no clouds at {folder}")
    return sorted(folder.glob("*.depth.png"))[::2]


def frames_of(kitchen, focal=585.0, scale=1e-3, centre=(320.0, 240.0)):
    for path in kitchen:
        points = read_depth_image(path, Intrinsics(focal, focal, *centre), scale).points
        yield points, read_pose(str(path).replace("depth.png", "pose.txt"))


def test_frames_of_a_kitchen_agree(kitchen):
    assert agreement_of(frames_of(kitchen)) > 0.999


def test_inverse_poses_scales_and_other_focal_lengths_contradict(kitchen):
    assert agreement_of((points, inverse_of(pose)) for points, pose in frames_of(kitchen)) < 0.7
    assert agreement_of(frames_of(kitchen, scale=5e-3)) < 0.9
    assert agreement_of(frames_of(kitchen, scale=2e-4)) < 0.9
    assert agreement_of(frames_of(kitchen, focal=365.0)) < 0.95
    assert agreement_of(frames_of(kitchen, centre=(160.0, 120.0))) < 0.98


def test_noise_of_a_camera_is_no_contradiction():
    frames = []
    for k in range(5):
        pose = pose_at(1.0 + 0.4 * k, 1.0, 1.1, yaw=0.5 + 0.1 * k, pitch=0.3)
        points = seen_from(room_points(0.03, noise=0.01, seed=k), pose, half_angle=0.6)
        frames.append((points, pose))
    assert agreement_of(frames) > 0.98


def test_frames_that_see_little_twice_do_not_tell():
    ahead = np.random.default_rng(0).normal((0.0, 0.0, 3.0), 0.3, (4000, 3))
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    assert agreement_of([(ahead, np.eye(4)), (ahead, turned)]) is None


def test_a_long_sequence_keeps_few_frames():
    found, points = FrameAgreement(), np.random.default_rng(0).normal((0.0, 0.0, 3.0), 0.3, (500, 3))
    for _ in range(100):
        found.add(points, np.eye(4))
    assert len(found._views) <= FRAMES
