"""The parts of the sensor-based random tree: safe regions, openings, candidates, the graph and the drive."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lidarium.agents.srt.candidates import CandidateSource
from lidarium.agents.srt.frontier_arcs import openings_of
from lidarium.agents.srt.memories.region_memory import RegionMemory
from lidarium.agents.srt.motion.drive import Drive, Limits, Phase, driven, free_way
from lidarium.agents.srt.motion.progress import Progress
from lidarium.agents.srt.safe_region import (
    ANGLES,
    DIRECTIONS,
    STEP,
    UNIT,
    joined_views,
    region_of,
    safe_region,
    seen_region,
    view_of,
)
from lidarium.agents.srt.senses import Senses
from lidarium.agents.srt.settings import SHAPES, SrtSettings, make_srt_settings
from lidarium.agents.srt.tree import Node, Tree, way_to
from lidarium.mapping.grids.scan_geometry import ScanGeometry

BODY, PERCEPTION = 0.2, 4.0
HERE = np.zeros(2)
URG = ScanGeometry()


def box_view(half=2.0, door=None):
    """What is seen from the middle of a square room; through a door, between two angles, nothing is met."""
    view = np.minimum(
        half / np.maximum(np.abs(UNIT[:, 0]), 1e-9), half / np.maximum(np.abs(UNIT[:, 1]), 1e-9)
    )
    if door is not None:
        view[(door[0] <= ANGLES) & (door[1] >= ANGLES)] = np.inf
    return view


def region(view, shape="radial", place=HERE, heading=0.0):
    return safe_region(place, view, heading, shape, BODY, PERCEPTION)


def node(number, place, view, parent=None):
    place = np.array(place, float)
    openings = openings_of(place, view, PERCEPTION, BODY, with_blind=False)
    return Node(
        number,
        "robot_0",
        np.array([*place, 0.0]),
        region(view, place=place),
        seen_region(place, view, PERCEPTION),
        openings,
        parent,
        view,
    )


def test_a_scan_becomes_ranges_along_the_axes_of_the_map():
    scan = np.full(727, 3.0, np.float32)
    scan[363], scan[400] = 1.0, np.nan
    view = view_of(scan, URG, heading=math.pi / 2)
    assert view[DIRECTIONS // 4] == 1.0
    assert np.isnan(view).sum() == pytest.approx(DIRECTIONS // 3, abs=4)
    assert np.isnan(view[round((math.pi / 2 + 37 * URG.angle_increment) / STEP)])
    assert np.isnan(view[3 * DIRECTIONS // 4])
    assert not np.isnan(joined_views(view, view_of(scan, URG, -math.pi / 2))[3 * DIRECTIONS // 4])


@pytest.mark.parametrize("value", [5.6, np.float32(5.6), math.inf])
def test_a_beam_that_meets_nothing_is_endless(value):
    assert np.isinf(view_of(np.full(727, value, np.float32), URG, 0.0)[0])


def test_the_five_laser_regions_go_from_right_to_left():
    degrees = np.array([-120, -73, -72, -25, -24, 0, 23, 24, 71, 72, 119, 121, 179])
    assert region_of(np.radians(degrees)).tolist() == [0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4, 5, 6]


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.floats(-3.0, 3.0))
def test_a_ball_lies_within_the_star_and_the_star_within_the_radial_region(seed, heading):
    generator = np.random.default_rng(seed)
    view = np.repeat(generator.uniform(0.3, 5.0, DIRECTIONS // 30), 30)
    view[generator.integers(DIRECTIONS, size=50)] = np.nan
    ball, star, radial = (region(view, shape, heading=heading).radii for shape in ("ball", "star", "radial"))
    assert (ball <= star + 1e-9).all()
    assert (star <= radial + 1e-9).all()
    assert (radial[np.isnan(view)] == 0.0).all()


@settings(max_examples=15)
@given(st.integers(0, 2**31))
def test_no_end_of_a_ray_comes_within_the_body_on_the_way_through_a_region(seed):
    generator = np.random.default_rng(seed)
    view = np.repeat(generator.uniform(0.4, 3.5, DIRECTIONS // 20), 20)
    ends = view[:, None] * UNIT
    for shape in SHAPES:
        radii = region(view, shape).radii
        for direction in generator.integers(DIRECTIONS, size=8):
            way = np.linspace(0.0, radii[direction], 30)[:, None] * UNIT[direction]
            gaps = np.linalg.norm(way[:, None] - ends[None], axis=2)
            assert gaps.min() >= BODY - 0.01


def test_points_within_a_region_are_told():
    square = region(box_view(), place=np.array([1.0, 1.0]))
    points = np.array([[1.0, 1.0], [2.7, 1.0], [2.9, 1.0], [1.0, -0.7], [4.0, 4.0]])
    assert square.contains(points).tolist() == [True, True, False, True, False]


def test_a_region_with_a_near_return_is_not_safe_to_turn_in():
    view = box_view()
    view[0] = 0.25
    radii = safe_region(HERE, view, 0.0, "radial", BODY, PERCEPTION, turn_room=0.1).radii
    assert (radii[region_of(ANGLES) == 2] == 0.0).all()
    assert (radii[region_of(ANGLES) == 4] > 0.0).all()


def test_a_closed_room_has_no_opening_and_a_door_is_one():
    assert openings_of(HERE, box_view(), PERCEPTION, BODY, with_blind=False) == []
    arcs = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.8)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert len(arcs) == 1
    assert arcs[0].width == pytest.approx(0.3, abs=0.02)
    assert arcs[0].lengths.sum() == pytest.approx(0.3 * PERCEPTION, rel=0.05)


def test_an_arc_across_the_first_direction_is_one_and_a_narrow_one_is_none():
    across = box_view()
    across[:60], across[-60:] = np.inf, np.inf
    assert [
        each.width
        for each in openings_of(HERE, across, PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ] == [pytest.approx(120 * STEP)]
    narrow = [
        each
        for each in openings_of(HERE, box_view(door=(0.5, 0.54)), PERCEPTION, BODY, with_blind=False)
        if not each.is_gap
    ]
    assert narrow == []


def test_a_gap_beside_an_edge_is_looked_into_on_the_hidden_side():
    view = np.full(DIRECTIONS, 3.0)
    view[: DIRECTIONS // 4] = 1.0
    gaps = openings_of(HERE, view, PERCEPTION, BODY, with_blind=False)
    assert len(gaps) == 2
    first = next(each for each in gaps if each.points[0, 1] > 0.5)
    assert (first.beyond[:, 0] > first.points[:, 0]).all()
    assert np.linalg.norm(first.points, axis=1).min() >= 1.0
    assert np.linalg.norm(first.points, axis=1).max() <= 3.0


def test_an_opening_that_was_seen_through_stays_closed():
    opening = openings_of(HERE, box_view(door=(0.5, 0.8)), PERCEPTION, BODY, with_blind=False)[0]
    assert len(opening.open_points(lambda points: np.zeros(len(points), bool), 0.5))
    assert not len(opening.open_points(lambda points: np.ones(len(points), bool), 0.5))
    assert not len(opening.open_points(lambda points: np.zeros(len(points), bool), 0.5))


@pytest.mark.parametrize("candidates", ["random", "farthest", "goal"])
def test_candidates_lie_within_the_safe_region_far_enough_and_outside_of_others(candidates):
    start = node(0, (0.0, 0.0), box_view(door=(0.4, 0.9)))
    wanted = SrtSettings(candidates=candidates, memory="regions")
    source = CandidateSource(wanted, BODY, np.random.default_rng(3))
    found = source.of_node(start, RegionMemory([start]), [start])
    assert found
    for candidate in found:
        assert bool(start.safe.contains(candidate.place))
        assert math.dist(candidate.place, start.place) > wanted.least_step
        source.note_tried(candidate)
    other = node(1, found[0].place, np.full(DIRECTIONS, 6.0), 0)
    assert source.of_node(start, RegionMemory([start, other]), [start, other]) == []


def test_the_base_algorithm_keeps_out_of_all_other_regions():
    wanted = SrtSettings(algorithm="base", memory="regions")
    source = CandidateSource(wanted, BODY, np.random.default_rng(3))
    start = node(0, (0.0, 0.0), box_view())
    assert len(source.of_node(start, RegionMemory([start]), [start])) == 1
    other = node(1, (0.3, 0.0), np.full(DIRECTIONS, 6.0), 0)
    assert source.of_node(start, RegionMemory([start, other]), [start, other]) == []


def test_a_tree_has_parents_bridges_and_shortest_ways():
    tree, known = Tree(), set[int]()
    for number, (place, parent) in enumerate(
        [((0, 0), None), ((1, 0), 0), ((2, 0), 1), ((2, 1), 2), ((0, 1.2), 3)]
    ):
        tree.add(
            node(number, place, box_view(), parent),
            lambda first, second: math.dist(first.place, second.place) < 1.3,
            known,
        )
        known.add(number)
    assert tree.chain(4) == [4, 3, 2, 1, 0]
    assert set(tree.nodes[4].neighbours) == {3, 0}
    lengths, before = tree.ways(4, known)
    assert way_to(1, before) == [0, 1]
    assert lengths[1] == pytest.approx(2.2)
    tree.disconnect(4, 0)
    assert way_to(0, tree.ways(4, known)[1]) == [3, 2, 1, 0]
    assert 0 not in tree.ways(4, {4, 3})[0]


def test_a_tree_refuses_a_wrong_number_and_an_unknown_parent():
    with pytest.raises(ValueError, match="number of the node is 3"):
        Tree().add(node(3, (0, 0), box_view()), None, ())
    with pytest.raises(ValueError, match="parent of node 0 is 2"):
        Tree().add(node(0, (0, 0), box_view(), 2), None, ())


LIMITS = Limits(0.4, 1.0, 0.5, 0.18)


@pytest.mark.parametrize("kind", ["turn_advance", "controls"])
@pytest.mark.parametrize("target", [(1.0, 0.5), (-1.0, 0.1), (0.0, -0.8)])
def test_a_drive_turns_advances_and_is_done(kind, target):
    wanted, drive, pose = SrtSettings(drive=kind), Drive(np.array(target)), np.zeros(3)
    phases = []
    for _ in range(300):
        drive, speed, turn_rate = driven(drive, pose, 5.0, LIMITS, wanted, 0.1)
        phases.append(drive.phase)
        if drive.phase is Phase.DONE:
            break
        assert 0.0 <= speed <= LIMITS.speed
        assert abs(turn_rate) <= LIMITS.turn_rate
        pose = pose + 0.1 * np.array([speed * math.cos(pose[2]), speed * math.sin(pose[2]), turn_rate])
    assert phases[-1] is Phase.DONE
    assert Phase.ADVANCE in phases
    assert math.dist(pose[:2], target) <= 0.1


def test_a_robot_turns_to_where_its_way_leads_exactly_where_something_is_near():
    aside = np.array([2.0 * math.cos(0.2), 2.0 * math.sin(0.2)])
    for free, phase in ((3.0, Phase.ADVANCE), (0.3, Phase.TURN)):
        drive, speed, _ = driven(Drive(aside), np.zeros(3), free, LIMITS, SrtSettings(), 0.1)
        assert drive.phase is phase
        assert (speed > 0.0) == (phase is Phase.ADVANCE)
    drive, speed, _ = driven(Drive(aside), np.array([0.0, 0.0, 0.19]), 0.3, LIMITS, SrtSettings(), 0.1)
    assert speed > 0.0


def test_blocks_at_one_place_are_counted_in_a_row():
    def there(x, time_s):
        return Senses(time_s, np.array([x, 0.0, 0.0]), np.empty(0, np.float32), False, None, [])

    progress = Progress()
    assert [progress.note_block(there(x, 0.0)) for x in (1.0, 1.3, 1.1, 3.0, 3.2, 1.0)] == [1, 2, 3, 1, 2, 1]
    progress.stand(there(1.0, 10.0))
    assert not progress.is_stuck(there(1.01, 12.9))
    assert progress.is_stuck(there(1.01, 13.2))
    assert not progress.is_stuck(there(1.2, 13.3))


@pytest.mark.parametrize("beside", [0.182, 0.189, 0.195])
def test_a_wall_beside_the_robot_is_no_end_of_a_way_along_it(beside):
    scan = np.full(727, 5.6, np.float32)
    left = np.flatnonzero(URG.angles > math.radians(10.0))
    scan[left] = np.minimum(beside / np.sin(np.minimum(URG.angles[left], math.pi / 2)), 5.6)
    assert free_way(scan, URG, 0.18) == pytest.approx(5.6)
    # Towards the wall the way ends where the body would touch it.
    assert free_way(scan, URG, 0.18, heading=math.radians(30.0)) < 0.05


def test_a_drive_stops_before_what_the_laser_sees_ahead():
    scan = np.full(727, 5.6, np.float32)
    assert free_way(scan, URG, 0.18) == pytest.approx(5.6)
    scan[363] = 1.0
    assert free_way(scan, URG, 0.18) == pytest.approx(0.81, abs=0.01)
    scan[:300] = 0.3
    assert free_way(np.full(727, np.nan, np.float32), URG, 0.18) == pytest.approx(5.6)
    _, speed, _ = driven(
        Drive(np.array([2.0, 0.0]), Phase.ADVANCE), np.zeros(3), 0.02, LIMITS, SrtSettings(), 0.1
    )
    assert speed == 0.0


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("shape", "cube"),
        ("candidates", "best"),
        ("nodes", 0),
        ("step_share", 1.0),
        ("margin", math.nan),
        ("random_share", 2.0),
        ("least_step", 0.0),
        ("turning_starts", 0.1),
    ],
)
def test_bad_settings_are_refused_by_name(setting, value):
    with pytest.raises(ValueError, match=setting):
        SrtSettings(**{setting: value})


def test_modes_and_unknown_settings():
    assert make_srt_settings("thesis").shape == "star"
    assert make_srt_settings("thesis", shape="ball").shape == "ball"
    with pytest.raises(ValueError, match="mode of the tree is 'printed'"):
        make_srt_settings("printed")
    with pytest.raises(TypeError, match="unknown setting 'colour'"):
        make_srt_settings(colour="red")
