"""Messages of ROS 2 on DDS: their types as ``rmw`` names them, their hashes, and their quality of service.

``rosbags`` has the definitions of Humble and Jazzy and encodes the messages; DDS carries the bytes.

References
----------
Names of topics and types: design.ros2.org, "Topic and Service name mapping to DDS". Type hashes: REP-2016.
Quality of service: ``rmw/qos_profiles.h``, ``rclcpp::ClockQoS`` and tf2_ros.
"""

from functools import cache
from typing import Any, Final

from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.qos import Policy, Qos
from cyclonedds.util import duration
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from lidarium.mapping.files.bags.messages import CLOCK, LASER_SCAN, ODOMETRY, TRANSFORMS

DISCOVERY: Final = "rmw_dds_common/msg/ParticipantEntitiesInfo"

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "byte": types.uint8,
    "char": types.uint8,
    "string": str,
    **{name: getattr(types, name) for name in ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64")},
    **{name: getattr(types, name) for name in ("uint64", "float32", "float64")},
}


@cache
def definitions(*, is_humble: bool = False) -> Typestore:
    """Return the definitions of all messages in Humble, or in Jazzy.

    Only those of ``rmw_dds_common`` differ among the types used here.
    """
    return get_typestore(Stores.ROS2_HUMBLE if is_humble else Stores.ROS2_JAZZY)


@cache
def wire_type(name: str, *, is_humble: bool = False) -> type[IdlStruct]:
    """Return the type of a message for DDS; its samples hold encoded messages in ``content``."""
    own: Any = _struct(name, is_humble)
    # Encoding is that of rosbags, on whole arrays; that of cyclonedds goes through Python lists.
    own.serialize = lambda sample, *_, **__: sample.content
    own.deserialize = classmethod(lambda kind, content, *_, **__: sample_of(kind, content))
    found: type[IdlStruct] = own
    return found


def sample_of(kind: type[IdlStruct], content: bytes) -> Any:  # noqa: ANN401
    """Return a sample of DDS that holds an encoded message."""
    sample: Any = kind.__new__(kind)
    sample.content = bytes(content)
    return sample


@cache
def _struct(name: str, is_humble: bool) -> type[IdlStruct]:
    package, _, last = name.split("/")
    fields = {field: _field(kind, is_humble) for field, kind in definitions(is_humble=is_humble).fielddefs[name][1]}
    return make_idl_struct(f"{last}_", f"{package}.msg.dds_.{last}_", fields)


def _field(kind: Any, is_humble: bool) -> Any:  # noqa: ANN401
    node, about = kind
    if node == Nodetype.BASE:
        return _PRIMITIVES[about[0]]
    if node == Nodetype.NAME:
        return _struct(about, is_humble)
    inner, length = _field(about[0], is_humble), about[1]
    arrays: Any = types  # whose generics type checkers do not know
    return arrays.array[inner, length] if node == Nodetype.ARRAY else arrays.sequence[inner]


def type_hash(name: str) -> str:
    """Return the hash of a type, as Iron and later compare them."""
    return definitions().hash_rihs01(name)


def _quality(name: str, depth: int, *, is_reliable: bool = True, is_latched: bool = False) -> Qos:
    return Qos(
        Policy.Reliability.Reliable(duration(milliseconds=100)) if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(f"typehash={type_hash(name)};".encode()),
    )


_LATCHED = ("/tf_static", "map")
"""Endings of the names of topics whose last message reaches late subscribers."""

_DEPTHS = {LASER_SCAN: 5, CLOCK: 1, TRANSFORMS: 100, ODOMETRY: 50}


def quality(topic: str, name: str, *, is_read: bool) -> Qos:
    """Return the quality of service of a topic: as sensor drivers and tf2 publish, and as any publisher is read."""
    if name == DISCOVERY or topic.endswith(_LATCHED):
        return _quality(name, 100 if is_read or name == TRANSFORMS else 1, is_latched=True)
    is_reliable = not is_read and name not in (LASER_SCAN, CLOCK)
    return _quality(name, _DEPTHS.get(name, 10), is_reliable=is_reliable)
