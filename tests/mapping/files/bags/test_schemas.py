"""Messages of ROS 2 as bags describe them."""

import re

import pytest

from lidarium.mapping.files.bags import schemas

NAMES = (schemas.LASER_SCAN, schemas.ODOMETRY, schemas.TRANSFORMS, schemas.GRID, schemas.PATH)


@pytest.mark.parametrize("name", NAMES)
def test_every_part_that_a_definition_refers_to_stands_in_it_once(name):
    text = schemas.definition(name)
    defined = re.findall(r"^MSG: (\S+)$", text, re.MULTILINE)
    used = set(re.findall(r"^(\w+/\w+)", text, re.MULTILINE))
    assert len(defined) == len(set(defined))
    assert set(defined) == used


def test_parts_are_set_off_by_lines_of_eighty_signs():
    first, second, *_ = schemas.definition(schemas.LASER_SCAN).split("\n" + "=" * 80 + "\n")
    assert first.startswith("std_msgs/Header header\nfloat32 angle_min")
    assert second == "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
