"""Messages of ROS 1 and 2: the types that bags are read and written with, and their codecs."""

from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

LASER_SCAN: Final = "sensor_msgs/msg/LaserScan"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
GRID: Final = "nav_msgs/msg/OccupancyGrid"
PATH: Final = "nav_msgs/msg/Path"
TWIST: Final = "geometry_msgs/msg/Twist"
TWIST_STAMPED: Final = "geometry_msgs/msg/TwistStamped"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
CLOCK: Final = "rosgraph_msgs/msg/Clock"

BAG_SUFFIXES: Final = (".mcap", ".db3", ".bag", ".mcap.zstd", ".db3.zstd")
"""Endings of the names of files that are bags, or parts of one."""

READ: Final = (LASER_SCAN, ODOMETRY, TRANSFORMS)
"""Types that a log is made from."""


def normalized(name: str) -> str:
    """Return the name of a type as ROS 2 writes it."""
    package, _, last = name.partition("/")
    whole = f"{package}/msg/{last.removeprefix('msg/')}"
    return TRANSFORMS if whole == "tf/msg/tfMessage" else whole


@cache
def typestore(is_ros1: bool = False) -> "Typestore":
    """Return the definitions of all messages.

    Those in a bag are not used: they are the same, and parsing them has no bound in time.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    if is_ros1:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TRANSFORMS))
    return store


def decoder(is_ros1: bool) -> Callable[[bytes, str], Any]:
    """Return the function that decodes the bytes of a message of some type."""
    store = typestore(is_ros1)
    return store.deserialize_ros1 if is_ros1 else store.deserialize_cdr
