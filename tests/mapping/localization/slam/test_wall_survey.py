"""Walls are surveyed after a stretch of a path, where there are any, and again after a new beginning."""

import numpy as np
import pytest

from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.matching.settings.slam import SlamSettings
from lidarium.mapping.localization.slam.scan_history import ScanHistory
from lidarium.mapping.localization.slam.scan_sampling import ScanSampling
from lidarium.mapping.localization.slam.wall_survey import WallSurvey

LASER = ScanGeometry()
SETTINGS = SlamSettings()
DUE_M = SETTINGS.graph.start_path_m
NODE = np.zeros((1, 3))


def box_scan(heading=0.0, half=2.0):
    """Ranges in the middle of a square room [m]."""
    angles = heading + LASER.angle_first + LASER.angle_increment * np.arange(LASER.beams)
    gaps = half / np.maximum(np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles))), 1e-9)
    return gaps.astype(np.float32)


def with_history(*headings):
    history = ScanHistory(LASER, 0.05)
    for time_s, heading in enumerate(headings):
        history.append(0, np.array([0.0, 0.0, heading]), box_scan(heading), float(time_s))
    return WallSurvey(SETTINGS, ScanSampling(SETTINGS, LASER)), history


def test_walls_are_surveyed_once_the_path_is_long_enough():
    survey, history = with_history(0.0, 0.7, 1.4)
    survey.survey(DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed
    assert survey.compass.bearings[0].direction == pytest.approx(0.0, abs=0.01)


def test_without_scans_they_are_surveyed_again_after_as_much_of_the_path():
    survey, history = with_history()
    survey.survey(DUE_M, 0, history, NODE)
    history.append(0, np.zeros(3), box_scan(), 0.0)
    survey.survey(2.0 * DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(2.0 * DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed


def test_a_new_beginning_puts_the_survey_off():
    survey, history = with_history(0.0, 0.7)
    survey.restart(5.0)
    survey.survey(5.0 + DUE_M - 0.1, 0, history, NODE)
    assert not survey.compass.is_surveyed
    survey.survey(5.0 + DUE_M, 0, history, NODE)
    assert survey.compass.is_surveyed


def test_where_walls_are_not_used_nothing_is_surveyed():
    settings = SlamSettings(uses_walls=False)
    survey, (_, history) = WallSurvey(settings, ScanSampling(settings, LASER)), with_history(0.0)
    survey.observe(box_scan(), np.zeros(3))
    survey.restart(1.0)
    survey.survey(1e3, 0, history, NODE)
    assert survey.compass is None
