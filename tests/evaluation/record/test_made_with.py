"""What figures may depend on is named."""

import numba
import numpy as np
import pytest

from lidarium.evaluation.record.made_with import made_with


def test_versions_are_those_that_run():
    found = made_with("kinematic")
    assert (found["numpy"], found["numba"]) == (np.__version__, numba.__version__)
    assert found["machine"]
    assert "pybullet" not in found


def test_what_moves_the_bodies_is_named():
    pytest.importorskip("pybullet", reason="PyBullet is not installed")
    assert made_with("bullet")["pybullet"][0].isdigit()
