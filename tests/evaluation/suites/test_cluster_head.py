"""The head of a Ray cluster that no longer answers (Ray itself is not needed)."""

import socket

import pytest

from lidarium.evaluation.suites import on_ray


def ask_until_lost(head):
    while True:
        head.check()


def test_a_head_that_answers_no_more_is_told_after_a_while(monkeypatch):
    monkeypatch.setattr(on_ray, "LOST_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        head = on_ray._Head(f"127.0.0.1:{server.getsockname()[1]}")
        head.check()
    with pytest.raises(on_ray.ClusterLostError, match="finished episodes are kept"):
        ask_until_lost(head)
    assert head.is_lost
