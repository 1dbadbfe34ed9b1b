"""Inputs of a robot's decision, in the frame of its map's first cell."""

from types import SimpleNamespace

import numpy as np
import pytest

from lidarium.agents.srt.memories import MapMemory, RegionMemory
from lidarium.agents.srt.senses import CONTACT_AGE_S, memory_of, senses_of
from lidarium.agents.srt.settings import SrtSettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry

LASER = ScanGeometry(beams=3, range_min=0.1)


def belief(goal=None, **teammates):
    return SimpleNamespace(
        map_origin=(-2.0, 1.0),
        pose=np.array([1.0, 2.0, 0.5]),
        goal=goal,
        teammates={
            name: SimpleNamespace(pose=np.array([*place, 0.0]), age_s=age) for name, (place, age) in teammates.items()
        },
    )


def observed(scan=(1.0, 2.0, 3.0), **more):
    return {"scan": np.array(scan, np.float32), **more}


def test_places_are_counted_from_the_first_cell():
    senses = senses_of(7.0, observed(), belief(np.array([0.0, 0.0]), a=((3.0, 3.0), 0.5)))
    assert senses.pose.tolist() == [3.0, 1.0, 0.5]
    assert senses.goal.tolist() == [2.0, -1.0]
    assert senses.teammates[0].tolist() == [5.0, 2.0]
    assert senses.distance_to(np.array([3.0, 5.0])) == 4.0
    assert senses_of(7.0, observed(), belief()).goal is None


def test_teammates_count_that_were_heard_of_recently():
    near = belief(a=((0.0, 0.0), CONTACT_AGE_S), b=((0.0, 0.0), CONTACT_AGE_S + 0.1))
    assert len(senses_of(0.0, observed(), near).teammates) == 1


@pytest.mark.parametrize(("bumper", "is_pressed"), [(np.array([0, 1]), True), (np.zeros(2), False), (None, False)])
def test_a_bumper_is_pressed_where_there_is_one(bumper, is_pressed):
    given = observed() if bumper is None else observed(bumper=bumper)
    assert senses_of(0.0, given, belief()).is_pressed is is_pressed


@pytest.mark.parametrize(
    ("scan", "is_blind"), [((np.nan, 0.05, 0.0), True), ((np.nan, 0.1, 0.0), False), ((np.inf,) * 3, False)]
)
def test_a_robot_is_blind_where_no_beam_measures_anything(scan, is_blind):
    assert senses_of(0.0, observed(scan), belief()).is_blind(LASER) is is_blind


def test_a_robot_remembers_regions_or_the_map_that_reached_it():
    assert isinstance(memory_of(belief(), [], SrtSettings(memory="regions")), RegionMemory)
    made = []
    knows = SimpleNamespace(map="own", shared_map=None, radius=0.2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MapMemory, "__init__", lambda self, known, radius: made.append((known, radius)))
        memory_of(knows, [], SrtSettings(memory="map"))
        knows.shared_map = "team"
        memory_of(knows, [], SrtSettings(memory="map"))
    assert made == [("own", 0.2), ("team", 0.2)]
