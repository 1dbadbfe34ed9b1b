import copy
import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from driven_rooms import GEOMETRY, RING_ROUND, TWINS_VISITED, cast, driven, odd_room, ring, twins

from lidarium.mapping.geometry.rigid import composed, relative
from lidarium.mapping.localization.localizer import Sensing
from lidarium.mapping.localization.settings import ClosureSettings, GraphSettings, MatchingSettings, SlamSettings
from lidarium.mapping.localization.slam.localizer import ELSEWHERE, NO_MATCH, ODOMETRY_ALONE, Slam, _Doubt, _Doubts

EAGER = SlamSettings(graph=GraphSettings(waiting=5))
"""Corrects the past also where closures contradict it by little."""

ROOM_ROUND = [(1.0, 1.0), (4.5, 1.0), (4.5, 2.4), (1.5, 2.4), (1.0, 1.0)]


def follow(slam, sensings):
    """Return the poses told at each time, and for each the node and the place relative to it."""
    told, places = [], []
    for sensing in sensings:
        told.append(slam.localize(sensing))
        places.append(slam.place)
    return np.array(told), places


def final(slam, places):
    return composed(slam.nodes[[node for node, _ in places]], np.stack([pose for _, pose in places]))


def errors(poses, truth):
    return np.hypot(*(poses - truth)[:, :2].T)


@pytest.fixture(scope="module")
def ring_run():
    return driven(ring(), RING_ROUND, drift=(-0.05, -0.05))


@pytest.fixture(scope="module")
def ring_followed(ring_run):
    slam = Slam(SlamSettings(), GEOMETRY)
    told, places = follow(slam, ring_run.sensings)
    return slam, told, places


def test_a_loop_is_closed(ring_run, ring_followed):
    slam, told, places = ring_followed
    odometry = np.array([sensing.odometry for sensing in ring_run.sensings])
    assert errors(odometry, ring_run.truth).max() > 5.0
    assert errors(told, ring_run.truth).max() < 0.3
    assert slam.counts.closures > 5
    finished = copy.deepcopy(slam)
    finished.finish()
    assert errors(final(finished, places), ring_run.truth).max() < 0.1


def test_a_correction_is_told_once_with_all_scans_at_their_new_poses(ring_run):
    slam = Slam(EAGER, GEOMETRY)
    corrections = []
    for sensing in ring_run.sensings:
        slam.localize(sensing)
        correction = slam.take_correction()
        if correction is not None:
            corrections.append(correction)
            assert slam.take_correction() is None
    assert len(corrections) == slam.counts.corrections > 0
    last = slam.key_scans
    assert last.poses.shape == (len(last.ranges), 3)
    assert last.ranges.shape[1] == GEOMETRY.beams


def test_closures_act_a_second_after_they_are_found(ring_run):
    first = {}
    for delay in (1.0, 3.0):
        slam = Slam(replace(SlamSettings(), closures=ClosureSettings(delay_s=delay)), GEOMETRY)
        for sensing in ring_run.sensings:
            slam.localize(sensing)
            if slam.counts.closures:
                first[delay] = sensing.time_s
                break
    assert first[3.0] - first[1.0] == pytest.approx(2.0, abs=0.21)


def test_two_rooms_that_look_alike_are_not_taken_for_one():
    run = driven(twins(), TWINS_VISITED, drift=(0.03, 0.02))
    slam = Slam(SlamSettings(), GEOMETRY)
    _, places = follow(slam, run.sensings)
    slam.finish()
    poses = final(slam, places)
    assert errors(poses, run.truth).max() < 0.5
    first, second = (np.argmin(np.hypot(*(run.truth[:, :2] - np.array(room)).T)) for room in ((1.6, 2.2), (7.6, 2.2)))
    assert abs(np.hypot(*(poses[second] - poses[first])[:2]) - 6.0) < 0.4


def test_the_same_run_gives_the_same_poses_to_the_bit(ring_run, ring_followed):
    _, told, _ = ring_followed
    again = Slam(SlamSettings(), GEOMETRY)
    poses, _ = follow(again, ring_run.sensings[:300])
    assert (poses == told[:300]).all()
    again.reset(np.zeros(3), 1)
    assert (follow(again, ring_run.sensings[:100])[0] == told[:100]).all()


@pytest.mark.parametrize("twin_of", [copy.deepcopy, lambda slam: pickle.loads(pickle.dumps(slam))])
def test_a_copy_goes_on_by_itself(ring_run, ring_followed, twin_of):
    _, told, _ = ring_followed
    slam = Slam(SlamSettings(), GEOMETRY)
    follow(slam, ring_run.sensings[:150])
    twin = twin_of(slam)
    assert (follow(twin, ring_run.sensings[150:300])[0] == told[150:300]).all()
    assert (follow(slam, ring_run.sensings[150:300])[0] == told[150:300]).all()


def test_walls_keep_headings_from_drifting():
    errors_of = {}
    run = driven(ring(), RING_ROUND, noise=0.05, drift=(-0.05, -0.05))
    for uses_walls in (True, False):
        slam = Slam(SlamSettings(uses_walls=uses_walls, closures=ClosureSettings(delay_s=1e6)), GEOMETRY)
        told, _ = follow(slam, run.sensings)
        errors_of[uses_walls] = np.degrees(np.sqrt(np.mean(np.square(relative(run.truth, told)[:, 2]))))
    assert errors_of[True] < 0.5
    assert errors_of[True] < 0.6 * errors_of[False]


def test_the_first_scan_is_laid_on_the_map_that_it_began():
    there_and_back = [(0.9, 0.9), (5.0, 0.9), (2.0, 0.9), (6.0, 0.9)]
    runs, turned = [driven(ring(), there_and_back, seed, noise=0.02) for seed in range(6)], {}
    for start_path_m in (7.0, 1e6):
        found = []
        for run in runs:
            slam = Slam(SlamSettings(uses_walls=False, graph=GraphSettings(start_path_m=start_path_m)), GEOMETRY)
            told, _ = follow(slam, run.sensings)
            found.append(np.mean(relative(run.truth, told)[len(told) // 2 :, 2]))
            assert (slam.key_scans.poses[0] == 0.0).all()
        turned[start_path_m] = np.sqrt(np.mean(np.square(found)))
    assert turned[7.0] < 0.75 * turned[1e6]


def test_the_frame_is_that_of_the_first_pose():
    run = driven(odd_room(), ROOM_ROUND)
    start = np.array([3.0, -2.0, 2.0])
    slam = Slam(SlamSettings(), GEOMETRY)
    slam.reset(start, 0)
    told, _ = follow(slam, run.sensings)
    assert (told[0] == start).all()
    assert errors(relative(np.broadcast_to(start, told.shape), told), run.truth).max() < 0.1


def test_the_map_holds_the_walls():
    run = driven(odd_room(), ROOM_ROUND)
    slam = Slam(SlamSettings(), GEOMETRY)
    follow(slam, run.sensings)
    grid = slam.map
    rows, columns = np.nonzero(grid.levels() == 0)
    places = np.stack([columns + 0.5, rows + 0.5], axis=1) * grid.settings.resolution + np.array(grid.origin)
    places += np.array(ROOM_ROUND[0])
    walls = odd_room()
    along = walls[:, 2:] - walls[:, :2]
    share = np.clip(((places[:, None] - walls[None, :, :2]) * along).sum(-1) / (along**2).sum(-1), 0.0, 1.0)
    gaps = np.linalg.norm(places[:, None] - walls[None, :, :2] - share[..., None] * along, axis=-1).min(axis=1)
    assert len(places) > 300
    assert (gaps < 0.1).mean() > 0.95


def test_covariance_grows_with_the_way_and_shrinks_with_closures(ring_run):
    slam = Slam(EAGER, GEOMETRY)
    variances = []
    for sensing in ring_run.sensings:
        slam.localize(sensing)
        variances.append(np.trace(slam.covariance[:2, :2]))
        assert (np.linalg.eigvalsh(slam.covariance) >= -1e-12).all()
    # The first local map lies where the first scan was taken, as well as any scan lies on a map.
    assert variances[0] == pytest.approx(2.0 * GraphSettings().deviation_m ** 2)
    assert variances[-1] < 0.5 * max(variances)


def test_motion_without_odometry_is_followed():
    run = driven(odd_room(), ROOM_ROUND)
    blind = [replace(sensing, odometry=np.zeros(3)) for sensing in run.sensings]
    slam = Slam(SlamSettings(uses_odometry=False), GEOMETRY)
    told, _ = follow(slam, blind)
    assert errors(told, run.truth).max() < 0.1


def test_wheels_that_tell_back_for_forth_are_not_believed():
    run = driven(odd_room(), ROOM_ROUND)
    odometry, wrong = np.zeros(3), []
    for k, sensing in enumerate(run.sensings):
        if k:
            motion = relative(run.truth[k - 1], run.truth[k])
            odometry = composed(odometry, motion * np.array([-1.0 if 20 <= k < 40 else 1.0, 1.0, 1.0]))
        wrong.append(replace(sensing, odometry=odometry))
    slam = Slam(SlamSettings(), GEOMETRY)
    told, _ = follow(slam, wrong)
    assert errors(told, run.truth)[-1] < 0.15


def sensing(ranges, k, x=0.0):
    return Sensing(0.1 * k, np.array([x, 0.0, 0.0]), np.asarray(ranges, np.float32))


@pytest.mark.parametrize("value", [np.nan, np.inf, 2.0, 0.0, -1.0, 1e9])
def test_scans_that_say_nothing_leave_the_pose_to_odometry(value):
    slam = Slam(SlamSettings(), GEOMETRY)
    told, _ = follow(slam, [sensing(np.full(GEOMETRY.beams, value), k, 0.02 * k) for k in range(40)])
    assert np.isfinite(told).all()
    assert np.isfinite(slam.covariance).all()
    if not 0.0 < value < 5.0:
        assert told[-1] == pytest.approx([0.78, 0.0, 0.0])


def test_odometry_that_is_no_number_is_no_motion():
    slam = Slam(SlamSettings(), GEOMETRY)
    scan = cast(odd_room(), np.array([2.0, 2.0, 0.0]))
    slam.localize(sensing(scan, 0))
    assert np.isfinite(slam.localize(Sensing(0.1, np.full(3, np.nan), scan))).all()
    assert np.isfinite(slam.localize(sensing(scan, 2, 0.2))).all()


def test_a_kidnapped_robot_goes_on_in_a_new_local_map():
    before, after = driven(odd_room(), ROOM_ROUND[:3]), driven(ring(), RING_ROUND[:3])
    moved = [
        replace(s, time_s=s.time_s + 100.0, odometry=composed(before.sensings[-1].odometry, s.odometry))
        for s in after.sensings
    ]
    slam = Slam(SlamSettings(), GEOMETRY)
    told, _ = follow(slam, [*before.sensings, *moved])
    assert slam.counts.restarts >= 1
    assert np.isfinite(told).all()
    # Near the end it follows the new place by its walls again.
    end, true = told[-30:], after.truth[-30:]
    assert np.abs(relative(end[0], end[-1]) - relative(true[0], true[-1])).max() < 0.1
    assert slam.covariance[0, 0] > 1.0


def test_a_scan_of_another_length_is_refused():
    with pytest.raises(ValueError, match=r"shape \(3,\); want \(241,\)"):
        Slam(SlamSettings(), GEOMETRY).localize(sensing([1.0, 1.0, 1.0], 0))


def test_scans_are_matched_after_enough_motion_only():
    scan = cast(odd_room(), np.array([2.0, 2.0, 0.0]))
    slam = Slam(SlamSettings(matching=MatchingSettings(distance_m=0.1)), GEOMETRY)
    follow(slam, [sensing(scan, k, 0.001 * k) for k in range(50)])
    assert slam.counts.matches == 0


ROUND = [(1.0, 1.0), (4.5, 1.0), (4.5, 2.4), (1.5, 2.4), (1.0, 1.0)]


def with_hidden_turn(run):
    """Leave out the scans of the first turn of more than 60 degrees; odometry does not know it."""
    turned = np.concatenate([[0.0], np.cumsum(np.diff(run.truth[:, 2]))])
    first = int(np.flatnonzero(np.abs(np.diff(turned)) > 0.05)[0])
    last = int(np.flatnonzero(np.abs(turned - turned[first]) > math.radians(80.0))[0])
    kept = [*range(first + 1), *range(last, len(run.sensings))]
    odometry, sensings = np.zeros(3), []
    for before, here in zip([kept[0], *kept[:-1]], kept, strict=True):
        if here - before <= 1:
            odometry = composed(odometry, relative(run.truth[before], run.truth[here]))
        sensings.append(replace(run.sensings[here], odometry=odometry.copy()))
    return sensings, run.truth[kept], first + 1


def test_a_turn_that_odometry_does_not_know_is_found():
    sensings, truth, at = with_hidden_turn(driven(odd_room(), ROUND))
    slam = Slam(SlamSettings(), GEOMETRY)
    found = np.array([slam.localize(sensing) for sensing in sensings])
    assert abs(relative(truth[at - 1], truth[at])[2]) > math.radians(75.0)
    assert slam.counts.recoveries == 1
    assert slam.counts.restarts == 0
    assert np.hypot(*(found - truth)[:, :2].T).max() < 0.1
    [doubt] = slam.doubts.stretches
    assert doubt.reason == ELSEWHERE
    # A scan is matched after some motion: here the second one after the turn.
    assert doubt.start_s <= sensings[at].time_s <= doubt.end_s <= sensings[at + 3].time_s


def test_stretches_begin_at_the_last_sure_scan_and_grow():
    doubts = _Doubts()
    for time_s, reason in [(0.0, None), (1.0, NO_MATCH), (2.0, NO_MATCH), (3.0, None), (4.0, ODOMETRY_ALONE)]:
        doubts.note(time_s, reason)
    doubts.note(5.0, NO_MATCH)
    assert doubts.stretches == [
        _Doubt(0.0, 2.0, 2, NO_MATCH),
        _Doubt(3.0, 4.0, 1, ODOMETRY_ALONE),
        _Doubt(3.0, 5.0, 1, NO_MATCH),
    ]


def test_a_kidnapped_robot_is_doubtful():
    before = driven(odd_room(), ROUND[:3])
    other = np.array([[-9.0, -7.0, 9.0, -7.0], [9.0, -7.0, 9.0, 0.4], [9.0, 0.4, -9.0, 0.4], [-9, 0.4, -9, -7]])
    after = driven(other, [(0.0, 0.0), (2.0, -0.4), (2.0, -2.0)])
    last = before.sensings[-1]
    moved = [
        replace(s, time_s=s.time_s + last.time_s + 1.0, odometry=composed(last.odometry, s.odometry))
        for s in after.sensings
    ]
    slam = Slam(SlamSettings(), GEOMETRY)
    for sensing in [*before.sensings, *moved]:
        slam.localize(sensing)
    doubt = slam.doubts.stretches[0]
    assert doubt.start_s == pytest.approx(last.time_s, abs=0.6)
    assert doubt.end_s > last.time_s
