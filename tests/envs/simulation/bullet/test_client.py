"""A server of PyBullet has a window only where there is a display."""

import pytest

import lidarium

pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install lidarium[bullet]")


def test_without_a_display_there_is_no_window(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    env = lidarium.parallel_env("apartment", backend="bullet", starts="fixed")
    env.reset(seed=0)
    assert env.world.show() is False
    assert env.world.bodies_of(0).client.is_open
    env.close()
