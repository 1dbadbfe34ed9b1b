"""A server of PyBullet has a window only where there is a display."""

import pytest

import lidarium

pytest.importorskip("pybullet", reason="PyBullet is not installed: pip install lidarium[bullet]")


def test_a_window_without_a_display_is_refused(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ValueError, match="DISPLAY names no display"):
        lidarium.parallel_env("apartment", backend="bullet", render_mode="human")
