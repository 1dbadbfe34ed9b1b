"""The page is served on this machine alone, at the port that was asked for, without a word on stdout."""

import importlib.metadata
import re
import socket
import sys
import time
import urllib.error
import urllib.request

import pytest

pytest.importorskip("viser", reason="viser is not installed: extra [viewer]")

from lidarium.evaluation.viewing.server import HOST, address_of, view_server
from lidarium.extras import install_command

PATIENCE_S = 120.0
"""How long a busy machine may take [s]."""


def fetch(address):
    with urllib.request.urlopen(address, timeout=PATIENCE_S) as answer:
        return answer.status, answer.read()


def is_gone(port):
    """Whether nobody listens at a port any more; a server ends a moment after its block."""
    ends = time.monotonic() + PATIENCE_S
    while time.monotonic() < ends:
        with socket.socket() as probe:
            if probe.connect_ex((HOST, port)) != 0:
                return True
        time.sleep(0.05)
    return False


def test_a_page_is_served_and_gone_afterwards():
    with view_server(0) as server:
        address = address_of(server)
        status, content = fetch(address)
        assert status == 200
        assert b"<html" in content.lower()
        port = server.get_port()
    assert is_gone(port)


def test_the_page_asks_for_nothing_from_elsewhere():
    with view_server(0) as server:
        _, content = fetch(address_of(server))
    assert b'<script src="http' not in content
    assert b'<link rel="stylesheet" href="http' not in content


def test_it_is_bound_to_this_machine_alone():
    with view_server(0) as server, socket.socket() as probe:
        assert server.get_host() == "127.0.0.1"
        probe.bind(("127.0.0.2", server.get_port()))  # all of the machine's addresses would be taken


def asked(address, **headers):
    """Return the status of a request."""
    request = urllib.request.Request(address, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def test_requests_of_other_pages_hosts_and_without_the_token_are_refused():
    with view_server(0) as server:
        address, port = address_of(server), server.get_port()
        assert asked(address) == 200
        assert asked(address, Origin=f"http://{HOST}:{port}") == 200
        assert asked(f"http://{HOST}:{port}/") == 403
        assert asked(f"http://{HOST}:{port}/wrong/index.html") == 403
        assert asked(address, Origin="https://elsewhere.example") == 403
        assert asked(address, Host="elsewhere.example") == 403


@pytest.mark.parametrize("origin", ["https://elsewhere.example", "null", None])
def test_a_socket_is_opened_for_the_page_alone(origin):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    with view_server(0) as server:
        address = address_of(server).replace("http://", "ws://").rstrip("/")
        options = {"subprotocols": [f"viser-v{importlib.metadata.version('viser')}"], "open_timeout": PATIENCE_S}
        own = f"http://{HOST}:{server.get_port()}"
        with connect(address, origin=own, **options) as connection:
            assert connection.recv(timeout=PATIENCE_S)
        wrong = address if origin is not None else address.rpartition("/")[0]
        with pytest.raises(InvalidStatus, match="403"):
            connect(wrong, origin=origin, **options)


def test_the_port_is_the_one_that_was_asked_for():
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port = probe.getsockname()[1]
    for _ in range(2):  # and is free again at once
        with view_server(port) as server:
            assert server.get_port() == port
        assert is_gone(port)


def test_a_port_in_use_is_named():
    with socket.socket() as other:
        other.bind((HOST, 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(OSError, match=f"port {port} of 127.0.0.1 cannot be used: .*; want another --view-port"):
            view_server(port).__enter__()


def test_a_missing_package_is_named_with_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ValueError, match=re.escape(f"needs the package viser: {install_command('viewer')}")):
        view_server(0).__enter__()


def test_nobody_can_have_it_shared_by_a_public_server():
    with view_server(0) as server:
        assert server.request_share_url() is None


def test_nothing_is_printed(capfd):
    with view_server(0) as server:
        fetch(address_of(server))
    assert capfd.readouterr().out == ""
