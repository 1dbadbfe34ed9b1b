"""A node publishes and reads as nodes of ROS 2 do, and refuses what cannot be trusted."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy
from ros_graphs import DOMAIN, GEOMETRY, heard, node, until

from lidarium.envs.ros import graph as graphs
from lidarium.envs.ros.messages import DISCOVERY
from lidarium.mapping.files.bags.messages import GRID, LASER_SCAN, TRANSFORMS, TWIST

SCAN = np.linspace(1.0, 2.0, GEOMETRY.beams).astype(np.float32)


def test_a_scan_arrives_as_it_was_sent():
    with node("a") as a, node("b") as b:
        b.subscribe("/scan", LASER_SCAN)
        a.advertise("/scan", LASER_SCAN)
        until(lambda: a.subscribers("/scan"))
        a.scan("/scan", "laser", 12.5, SCAN, GEOMETRY)
        (message,) = heard(b, "/scan")
    assert message.header.frame_id == "laser"
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 500_000_000)
    np.testing.assert_array_equal(message.ranges, SCAN)


def test_a_late_reader_gets_the_last_map_and_the_mounts():
    with node("a") as a, node("b") as b:
        a.grid("/map", "map", 1.0, np.full((3, 4), 255, np.uint8), (1.0, 2.0), 0.05)
        a.mounts({"base": "laser"}, 1.0, 0.3)
        b.subscribe("/map", GRID)
        b.subscribe("/tf_static", TRANSFORMS)
        assert heard(b, "/map")[0].info.width == 4
        assert heard(b, "/tf_static")[0].transforms[0].child_frame_id == "laser"


def test_the_graph_of_ros_sees_topic_type_hash_and_node():
    with node("seen") as a, node("b") as b:
        a.advertise("/robot_0/cmd_vel", TWIST)
        b.subscribe("ros_discovery_info", DISCOVERY)
        participant = DomainParticipant(DOMAIN)
        reader = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
        found = {}
        until(
            lambda: (
                found.update({e.topic_name: e for e in reader.take(20) if e.topic_name})
                or "rt/robot_0/cmd_vel" in found
            )
        )
        topic = found["rt/robot_0/cmd_vel"]
        assert topic.type_name == "geometry_msgs::msg::dds_::Twist_"
        assert topic.qos[Policy.Userdata].data.startswith(b"typehash=RIHS01_9c45bf16")
        names = []
        until(
            lambda: (
                names.extend(
                    n.node_name for each in b.take("ros_discovery_info") for n in each.message.node_entities_info_seq
                )
                or "seen" in names
            )
        )


def test_messages_that_are_malformed_or_too_long_are_refused_and_counted(monkeypatch):
    monkeypatch.setattr(graphs, "MAX_MESSAGE_BYTES", 100)
    info = SimpleNamespace(publication_handle=1, source_timestamp=0)
    bad = [
        b"",
        b"\x00\x01\x00\x00\xff\xff\xff\xff",
        b"\x07\x07" + bytes(48),
        b"\x00\x01\x00\x00" + bytes(13),
        bytes(101),
    ]
    with node() as a:
        a.subscribe("/cmd_vel", TWIST)
        samples = [SimpleNamespace(content=content, sample_info=info) for content in bad]
        monkeypatch.setitem(a._readers, "/cmd_vel", {TWIST: SimpleNamespace(take=lambda _: samples)})
        assert list(a.take("/cmd_vel")) == []
        assert a.refused == {"/cmd_vel: malformed": 4, "/cmd_vel: too long": 1}
        monkeypatch.setitem(a._readers, "/cmd_vel", {TWIST: SimpleNamespace(take=lambda _: [])})


def test_other_publishers_of_a_topic_are_counted():
    with node("a") as a:
        a.advertise("/cmd_vel", TWIST)
        assert a.publishers("/cmd_vel") == 0
        with node("b") as b:
            b.advertise("/cmd_vel", TWIST)
            assert until(lambda: a.publishers("/cmd_vel")) == 1
        until(lambda: a.publishers("/cmd_vel") == 0)


def test_nothing_comes_from_another_domain():
    with node("a") as a, node("b", DOMAIN + 64) as b:
        b.subscribe("/scan", LASER_SCAN)
        a.scan("/scan", "laser", 1.0, SCAN, GEOMETRY)
        time.sleep(0.3)
        assert list(b.take("/scan")) == []
        assert a.subscribers("/scan") == 0


@pytest.mark.parametrize("domain", [-1, 233])
def test_a_domain_without_ports_is_refused(domain):
    with pytest.raises(ValueError, match=f"domain is {domain}; want 0 to 232"):
        graphs.chosen_domain(domain)


def test_the_environment_names_the_domain(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert graphs.chosen_domain(None) == 42
    monkeypatch.setenv("ROS_DOMAIN_ID", "mine")
    with pytest.raises(ValueError, match="ROS_DOMAIN_ID is 'mine'"):
        graphs.chosen_domain(None)
