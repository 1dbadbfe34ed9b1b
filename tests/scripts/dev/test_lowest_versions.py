"""Constraints with which CI installs the lowest versions of the dependencies."""

import tomllib

import pytest

from lidarium.scripts.dev.lowest_versions import PYPROJECT, lowest


def test_each_dependency_is_at_the_lowest_version_that_it_allows():
    given = ["numpy>=2", "imageio[ffmpeg]>=2.31", "opencv-python-headless>=4.10.0.84,<6"]
    assert lowest(given) == ["numpy==2", "imageio==2.31", "opencv-python-headless==4.10.0.84"]


def test_every_dependency_of_the_package_has_a_lowest_version():
    dependencies = tomllib.loads(PYPROJECT.read_text())["project"]["dependencies"]
    assert len(lowest(dependencies)) == len(dependencies)
    with pytest.raises(ValueError, match=r"dependency 'numpy' has no lowest version; want NAME>=VERSION"):
        lowest(["numpy"])
