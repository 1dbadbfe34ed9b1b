"""Types, hashes and quality of service are those of ROS 2."""

import pytest

pytest.importorskip("cyclonedds", reason="cyclonedds (extra ros) is not installed")

from cyclonedds.qos import Policy
from cyclonedds.util import duration

from lidarium.envs.ros.messages import DISCOVERY, definitions, quality, type_hash, wire_type
from lidarium.mapping.files.bags.messages import (
    CLOCK,
    GRID,
    LASER_SCAN,
    ODOMETRY,
    POSE_STAMPED,
    TRANSFORMS,
    TWIST,
    TWIST_STAMPED,
)

USED = (CLOCK, GRID, LASER_SCAN, ODOMETRY, POSE_STAMPED, TRANSFORMS, TWIST, TWIST_STAMPED)


def test_types_have_the_names_that_rmw_gives_them():
    assert (
        wire_type(LASER_SCAN).__idl__.idl_transformed_typename.replace(".", "::")
        == "sensor_msgs::msg::dds_::LaserScan_"
    )


@pytest.mark.parametrize(
    ("name", "published"),  # as rmw_zenoh of Jazzy has them in keys, and `ros2 topic info -v` of Jazzy prints
    [
        ("std_msgs/msg/String", "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        (TWIST, "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"),
        (TRANSFORMS, "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
    ],
)
def test_hashes_are_those_that_jazzy_prints(name, published):
    assert type_hash(name) == published


@pytest.mark.parametrize("name", USED)
def test_types_are_the_same_in_humble_and_jazzy(name):
    humble, jazzy = definitions(is_humble=True), definitions()
    assert humble.hash_rihs01(name) == jazzy.hash_rihs01(name)


def test_ids_of_nodes_are_longer_in_humble():
    assert definitions(is_humble=True).hash_rihs01(DISCOVERY) != definitions().hash_rihs01(DISCOVERY)


def test_dds_reads_the_bytes_as_rosbags_writes_them():
    store = definitions()
    stamp = store.types["builtin_interfaces/msg/Time"](sec=3, nanosec=5)
    clock = store.types[CLOCK](clock=stamp)
    raw = bytes(store.serialize_cdr(clock, CLOCK))
    read = wire_type(CLOCK).__idl__.deserialize(raw)
    assert (read.clock.sec, read.clock.nanosec) == (3, 5)


@pytest.mark.parametrize(
    ("topic", "name", "is_read", "wanted"),
    [
        (
            "/scan",
            LASER_SCAN,
            False,
            (Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(5)),
        ),
        (
            "/clock",
            CLOCK,
            False,
            (Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(1)),
        ),
        ("/robot_0/map", GRID, False, (None, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))),
        ("/tf_static", TRANSFORMS, True, (None, Policy.Durability.TransientLocal, Policy.History.KeepLast(100))),
        ("/tf", TRANSFORMS, False, (None, Policy.Durability.Volatile, Policy.History.KeepLast(100))),
        # Publishers of either kind meet a reader that asks for no more than the best effort.
        (
            "/odom",
            ODOMETRY,
            True,
            (Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(50)),
        ),
    ],
)
def test_quality_of_service_is_that_of_drivers_and_tf2(topic, name, is_read, wanted):
    reliable = Policy.Reliability.Reliable(duration(milliseconds=100))
    found = quality(topic, name, is_read=is_read)
    assert found[Policy.Reliability] == (wanted[0] or reliable)
    assert found[Policy.Durability] == wanted[1]
    assert found[Policy.History] == wanted[2]
