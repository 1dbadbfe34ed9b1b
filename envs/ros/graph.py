"""A node of ROS 2: publishes and reads topics of a domain, and refuses invalid messages."""

import logging
import os
from collections import Counter
from collections.abc import Iterator
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, Entity, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from rosbags.serde import SerdeError

from lidarium.envs.ros.messages import DISCOVERY, definitions, quality, sample_of, wire_type
from lidarium.mapping.files.bags.writing import MessageWriter
from lidarium.mapping.geometry.bounds import shown

MAX_DOMAIN: Final = 232
"""Highest number of a domain: its ports must exist (RTPS 9.6.1)."""

MAX_MESSAGE_BYTES: Final = 1 << 25
"""Maximum size of a message from the network: a map of 5,000 x 5,000 cells fits."""

_TAKEN_AT_ONCE = 128

_DISCOVERY_TOPIC = "ros_discovery_info"

_LOCALHOST = """<General><AllowMulticast>false</AllowMulticast><Interfaces><NetworkInterface address="127.0.0.1"/>
</Interfaces></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>"""


class Heard(NamedTuple):
    """A message from the network.

    Attributes
    ----------
    message : object
        Decoded, of the type of its topic.
    source : int
        Number of its publisher.
    sent_s : float
        Time at which it was written, by the clock of the publisher's machine [s].
    """

    message: Any
    source: int
    sent_s: float = 0.0


def chosen_domain(domain: int | None) -> int:
    """Return a checked domain; if None, that of the environment (``ROS_DOMAIN_ID``, 0 by default)."""
    text = os.environ.get("ROS_DOMAIN_ID", "") or "0"
    if domain is None and not text.isdecimal():
        raise ValueError(f"ROS_DOMAIN_ID is {shown(text)}; want a number from 0 to {MAX_DOMAIN}")
    number = int(text) if domain is None else domain
    if not 0 <= number <= MAX_DOMAIN:
        raise ValueError(f"domain is {number}; want 0 to {MAX_DOMAIN}")
    return number


def _is_local() -> bool:
    """Whether the environment keeps ROS on this machine, as ``rmw`` reads it."""
    only = os.environ.get("ROS_LOCALHOST_ONLY") == "1"
    return only or os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST"


@cache
def _domain(number: int, localhost: bool) -> Domain:
    """Return the open domain of this process: a second one of the same number cannot be made."""
    own = f"<Internal><MaxSampleSize>{MAX_MESSAGE_BYTES}B</MaxSampleSize></Internal>{_LOCALHOST if localhost else ''}"
    given = os.environ.get("CYCLONEDDS_URI", "")
    fragments = [f'<CycloneDDS><Domain id="any">{own}</Domain></CycloneDDS>', *([given] if given else [])]
    return Domain(number, ",".join(fragments))


class Graph(MessageWriter):
    """A node in the graph of ROS 2.

    Messages are bounded in size; those that cannot be decoded are refused. Refused messages are counted by topic and
    reason in ``refused``, and never raise.

    Parameters
    ----------
    node : str
        Name of the node.
    domain : int or None
        Domain. That of the environment by default.
    localhost : bool or None
        Whether only programs on this machine are reached, without multicast. The environment decides by default.
    is_humble : bool
        Whether the others run Humble, whose graph has longer ids of nodes; else that of Iron and later.
    """

    def __init__(
        self, node: str, domain: int | None = None, *, localhost: bool | None = None, is_humble: bool = False
    ) -> None:
        super().__init__()
        self.domain = chosen_domain(domain)
        local = _is_local() if localhost is None else localhost
        self.refused: Counter[str] = Counter()
        try:
            self._open = _domain(self.domain, local)
            self._participant = DomainParticipant(self.domain, Qos(Policy.Userdata(b"enclave=/;")))
        except DDSException as error:
            raise ValueError(f"DDS cannot open domain {self.domain}: {error}; see CYCLONEDDS_URI") from error
        self._node, self._is_humble, self._store = node, is_humble, definitions(is_humble=is_humble)
        self._topics: dict[tuple[str, str], Topic[Any]] = {}
        self._writers: dict[str, DataWriter[Any]] = {}
        self._readers: dict[str, dict[str, DataReader[Any]]] = {}
        self._conditions: list[ReadCondition] = []
        self._waiting = WaitSet(self._participant)
        self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._others: dict[Any, tuple[str, Any]] = {}

    def advertise(self, topic: str, name: str) -> None:
        """Publish a topic of a type of message, before the first message of it."""
        if topic in self._writers:
            return
        self._writers[topic] = DataWriter(
            self._participant, self._topic(topic, name), quality(topic, name, is_read=False)
        )
        self._announce()

    def subscribe(self, topic: str, *names: str) -> None:
        """Read a topic from now on, whichever of these types of message its publishers use."""
        if topic in self._readers:
            return
        self._readers[topic] = {}
        for name in names:
            reader = DataReader(self._participant, self._topic(topic, name), quality(topic, name, is_read=True))
            self._readers[topic][name] = reader
            condition = ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)
            self._conditions.append(condition)
            self._waiting.attach(condition)
        self._announce()

    def take(self, topic: str) -> Iterator[Heard]:
        """Yield the messages of a topic that have come since the last call, those of each type in order."""
        for name, reader in self._readers[topic].items():
            try:
                samples = reader.take(_TAKEN_AT_ONCE)
            except DDSException as error:
                self.refuse(topic, "DDS cannot read it")
                logging.getLogger(__name__).debug("%s: %s", topic, error)
                continue
            for sample in samples:
                content = getattr(sample, "content", None)
                if content is None:  # a publisher has left
                    continue
                if len(content) > MAX_MESSAGE_BYTES:
                    self.refuse(topic, "too long")
                    continue
                try:
                    message = self._store.deserialize_cdr(content, name)
                # Generated code of rosbags meets the ends of arrays in several ways.
                except (SerdeError, ValueError, IndexError, AssertionError, OverflowError, MemoryError):
                    self.refuse(topic, "malformed")
                    continue
                about = sample.sample_info
                yield Heard(message, int(about.publication_handle), 1e-9 * about.source_timestamp)

    def refuse(self, topic: str, reason: str) -> None:
        """Count a message that is not used."""
        self.refused[f"{topic}: {reason}"] += 1

    def wait(self, timeout_s: float) -> bool:
        """Wait until a topic has messages; return whether one has."""
        return self._waiting.wait(duration(seconds=max(timeout_s, 0.0))) > 0

    def publishers(self, topic: str) -> int:
        """Return the number of publishers of a topic in other nodes."""
        for found in self._publications.take(_TAKEN_AT_ONCE):
            if found.sample_info.valid_data:
                self._others[found.key] = found.topic_name, found.participant_key
            if found.sample_info.instance_state != InstanceState.Alive:
                self._others.pop(found.key, None)
        own = self._participant.guid
        return sum(1 for name, who in self._others.values() if name == f"rt{topic}" and who != own)

    def publish(self, topic: str, name: str, content: bytes) -> None:
        """Publish an encoded message."""
        self.advertise(topic, name)
        self._writers[topic].write(sample_of(wire_type(name, is_humble=self._is_humble), content))

    def subscribers(self, topic: str) -> int:
        """Return the number of subscribers of a topic that this node publishes."""
        return len(self._writers[topic].get_matched_subscriptions())

    def close(self) -> None:
        """Leave the graph."""
        self._waiting = None  # type: ignore[assignment]
        for entities in (self._conditions, self._writers, self._readers, self._topics):
            entities.clear()
        self._publications = self._participant = None  # type: ignore[assignment]

    def _write(self, topic: str, name: str, time_s: float, **fields: Any) -> None:  # noqa: ANN401
        self.publish(topic, name, bytes(self._store.serialize_cdr(self._made(name, **fields), name)))

    def _topic(self, topic: str, name: str) -> Topic[Any]:
        if (topic, name) not in self._topics:
            mangled = topic if name == DISCOVERY else f"rt{topic}"
            self._topics[topic, name] = Topic(self._participant, mangled, wire_type(name, is_humble=self._is_humble))
        return self._topics[topic, name]

    def _announce(self) -> None:
        """Publish the list of this node's topics, as ``rmw_dds_common`` does."""
        readers = [reader for of_type in self._readers.values() for reader in of_type.values()]
        writers = [writer for topic, writer in self._writers.items() if topic != _DISCOVERY_TOPIC]
        node = self._made(
            "rmw_dds_common/msg/NodeEntitiesInfo",
            node_namespace="/",
            node_name=self._node,
            reader_gid_seq=list(map(self._gid, readers)),
            writer_gid_seq=list(map(self._gid, writers)),
        )
        if _DISCOVERY_TOPIC not in self._writers:
            topic = self._topic(_DISCOVERY_TOPIC, DISCOVERY)
            self._writers[_DISCOVERY_TOPIC] = DataWriter(
                self._participant, topic, quality(_DISCOVERY_TOPIC, DISCOVERY, is_read=False)
            )
        self._write(_DISCOVERY_TOPIC, DISCOVERY, 0.0, gid=self._gid(self._participant), node_entities_info_seq=[node])

    def _gid(self, entity: Entity) -> Any:  # noqa: ANN401
        """Return the id of an entity; it is padded in Humble."""
        gid = np.zeros(24 if self._is_humble else 16, np.uint8)
        gid[:16] = np.frombuffer(entity.guid.bytes, np.uint8)
        return self._made("rmw_dds_common/msg/Gid", data=gid)
