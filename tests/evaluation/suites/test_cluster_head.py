"""What needs no Ray: a head of a cluster that no longer answers, and a machine with another version."""

import socket
from functools import partial

import pytest

import lidarium
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


def test_another_version_on_a_machine_is_named():
    with pytest.raises(on_ray.OtherVersionError, match=r"has lidarium .*, this is 9\.9"):
        on_ray._done(partial(max, 1), 2, "9.9", "")
    assert on_ray._done(partial(max, 1), 2, lidarium.__version__, "") == 2
