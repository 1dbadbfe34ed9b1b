"""Settings that are made by themselves refuse what is no number, none of their type, or absurd."""

import dataclasses
import math
import re

import pytest

from lidarium.agents.srt.settings import SrtSettings
from lidarium.agents.supervisor.settings import SupervisorSettings
from lidarium.envs.faces.merged_maps import MergingSettings
from lidarium.mapping.geometry.bounds import UNBOUNDED, rules_of
from lidarium.mapping.grids.occupancy import OccupancySettings
from lidarium.mapping.grids.scan_geometry import ScanGeometry
from lidarium.mapping.localization.on_splines.spline_filter import SplineFilterSettings
from lidarium.mapping.merging.agreement import ValidationSettings
from lidarium.mapping.merging.alignment import AlignmentSettings
from lidarium.mapping.merging.corners import CornerSettings
from lidarium.mapping.merging.correlation import CorrelationSettings
from lidarium.mapping.merging.correspondence import CorrespondenceSettings
from lidarium.mapping.merging.descriptors import DescriptorSettings
from lidarium.mapping.merging.settings import MergeSettings

KINDS = (
    OccupancySettings,
    ScanGeometry,
    SplineFilterSettings,
    MergingSettings,
    MergeSettings,
    ValidationSettings,
    AlignmentSettings,
    CorrelationSettings,
    CorrespondenceSettings,
    CornerSettings,
    DescriptorSettings,
    SrtSettings,
    SupervisorSettings,
)
ABSURD = (math.nan, -math.inf, 1e300, -1e300, 10**400, 1e8)
OTHERS = ("x", None, [1.0], {}, 1j, b"1", object())


def settings_of(*kinds):
    """Name each setting of a kind that has such a type."""
    return [
        pytest.param(kind, field.name, id=f"{kind.__name__}.{field.name}")
        for kind in KINDS
        for field in dataclasses.fields(kind)
        if rules_of(kind)[field.name].kind in kinds
    ]


def refused(kind, name, value):
    """Return the message with which a value is refused."""
    with pytest.raises(ValueError, match=re.escape(name)) as caught:
        kind(**{name: value})
    message = str(caught.value)
    assert "want" in message, message
    assert len(message) < 300, message
    return message


@pytest.mark.parametrize(("kind", "name"), settings_of(int, float))
def test_numbers_are_bounded_and_no_number_is_refused(kind, name):
    rule = rules_of(kind)[name]
    assert rule.bounds.maximum < UNBOUNDED
    assert rule.hold(getattr(kind(), name))
    for value in (*ABSURD, *OTHERS, True):
        refused(kind, name, value)
    if not rule.bounds.never:
        refused(kind, name, math.inf)
    assert "nan" in refused(kind, name, math.nan)


@pytest.mark.parametrize(("kind", "name"), settings_of(bool))
def test_what_is_true_or_false_is_nothing_else(kind, name):
    for value in (*ABSURD, *OTHERS, 0, 1):
        assert "want true or false" in refused(kind, name, value)


@pytest.mark.parametrize(("kind", "name"), settings_of(str))
def test_words_are_some_that_are_known(kind, name):
    for value in ("no such word", 1, None, ["x"], {}):
        refused(kind, name, value)


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (CornerSettings, "neighbours"),
        (AlignmentSettings, "refinements"),
        (SupervisorSettings, "assignment"),
        (MergingSettings, "merge"),
        (MergeSettings, "corners"),
        (SplineFilterSettings, "tracking"),
    ],
)
def test_lists_and_parts_are_of_their_type(kind, name):
    for value in (1, None, "x", [[1]], {"a": 1}, object()):
        refused(kind, name, value)


def test_rings_of_descriptors_are_not_without_number():
    with pytest.raises(ValueError, match="at most 1000 rings"):
        DescriptorSettings(radius_step=1e-9)
