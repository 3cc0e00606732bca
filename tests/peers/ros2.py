"""Cyclone DDS, by which ROS 2 talks, receives what `edgepuck-ros2` publishes.

First the JSON lines of `infer-cpu live` are piped to it, then a recording to which a cloud of a
full turn is added, of 57,870 points and 1.3 MB. Whatever arrives must be, field by field, what the
lines or the recording hold. The types are those of the recording, which recordings.py holds to
ROS 2's. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import dataclasses
import json
import os
import socket
import subprocess
import time
from collections import defaultdict

from peer import OUT, ROOT, edgepuck, run, skip, skipped_if_missing

with skipped_if_missing():
    import numpy
    from cyclonedds.core import Policy, Qos
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.idl import IdlStruct, types
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration
    from mcap.writer import Writer
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Nodetype
if [name for _, name in socket.if_nameindex()] == ["lo"]:
    skip("DDS finds others by multicast, and there is no network")

LIVE = [os.environ["EDGEPUCK_INFER"], "live", "--model",
        ROOT / "assets/weights/street-bev.safetensors", "--pcap", OUT / "drive.pcap"]
SECONDS = 6
# One that other programs of this machine do not use.
DOMAIN = 40 + os.getpid() % 60
# Points of a turn in which every beam of a VLP-32C returns.
FULL_TURN = 57_870
TOPICS = {
    "/points": "sensor_msgs/msg/PointCloud2",
    "/objects": "vision_msgs/msg/Detection3DArray",
    "/objects/markers": "visualization_msgs/msg/MarkerArray",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}


def main():
    edgepuck("gen-scenes", "street", "--drive", SECONDS, "--out", OUT / "drive.pcap")
    lines = run(*LIVE, "--json", "--mcap", OUT / "run.mcap").stdout
    with AnyReader([OUT / "run.mcap"]) as reader:
        connections = {connection.topic: connection for connection in reader.connections}
        recorded = [(c.topic, time_ns, bytes(raw)) for c, time_ns, raw in reader.messages()]
        subscriber = Subscriber(reader.typestore)
        compare_lines(subscriber, [json.loads(line) for line in lines.splitlines()])
        compare_recording(subscriber, reader.typestore, connections, recorded)


class Subscriber:
    """Readers of all topics, and what they have received."""

    def __init__(self, typestore):
        participant = DomainParticipant(DOMAIN)
        structures = {}
        self.readers, self.received = {}, defaultdict(list)
        for topic, name in TOPICS.items():
            kind = Topic(participant, f"rt{topic}", structure(name, typestore, structures))
            kept = Policy.Durability.TransientLocal if topic == "/tf_static" else \
                Policy.Durability.Volatile
            quality = Qos(Policy.Reliability.Reliable(duration(seconds=1)), kept,
                          Policy.History.KeepLast(20))
            self.readers[topic] = DataReader(participant, kind, qos=quality)

    def take(self):
        for topic, reader in self.readers.items():
            # A publisher that leaves is told as a sample without data.
            samples = (sample for sample in reader.take(N=20) if isinstance(sample, IdlStruct))
            self.received[topic].extend(samples)

    def take_all_of(self, process):
        """Receives until the program ends; gives what has come since the last call."""
        self.received.clear()
        while process.poll() is None:
            self.take()
            time.sleep(0.01)
        self.take()
        assert process.returncode == 0, process.returncode
        return self.received


def structure(name, typestore, known):
    """The IDL structure of a message, named as ROS 2 names it in DDS."""
    if name not in known:
        _, fields = typestore.fielddefs[name]
        members = [(field, member(kind, typestore, known)) for field, kind in fields]
        package, _, short = name.split("/")
        made = dataclasses.make_dataclass(f"{short}_", members, bases=(IdlStruct,))
        made.__idl_typename__ = f"{package}.msg.dds_.{short}_"
        made.__idl__.idl_transformed_typename = f"{package}::msg::dds_::{short}_"
        known[name] = made
    return known[name]


def member(kind, typestore, known):
    node, what = kind
    if node == Nodetype.NAME:
        return structure(what, typestore, known)
    if node == Nodetype.BASE:
        named = {"string": str, "bool": bool}
        return named.get(what[0]) or getattr(types, what[0])
    of, length = what
    element = member(of, typestore, known)
    return types.array[element, length] if node == Nodetype.ARRAY else types.sequence[element]


def compare_lines(subscriber, lines):
    """Each turn is a message of its objects that have a class, in the order of their lines."""
    turns = defaultdict(list)
    for line in lines:
        named = turns[line["turn"]]
        if line["class"] not in (None, "unknown"):
            named.append(str(line["track"]))
    live = subprocess.Popen([*LIVE, "--realtime"], stdout=subprocess.PIPE)
    bridge = subprocess.Popen(bridge_command(), stdin=live.stdout)
    received = subscriber.take_all_of(bridge)
    assert live.wait() == 0
    found = [[object.id for object in array.detections] for array in received["/objects"]]
    expected = list(turns.values())
    # What came before they had found each other is lost, and nothing after it.
    assert len(found) > len(expected) / 3, f"{len(found)} of {len(expected)} turns"
    assert found == expected[-len(found):], "the objects of a turn"
    boxes = [[str(box.id) for box in array.markers if box.ns == "boxes"]
             for array in received["/objects/markers"]]
    assert boxes == expected[-len(boxes):] and len(boxes) > len(expected) / 3
    print(f"of lines, {len(found)} of {len(expected)} turns")


def bridge_command():
    return [os.environ["EDGEPUCK_ROS2"], "--domain", str(DOMAIN)]


def compare_recording(subscriber, typestore, connections, recorded):
    """Each message is that of the recording, to the last field."""
    recorded = [message for message in recorded if message[0] in TOPICS]
    topic, time_ns, raw = next(message for message in recorded if message[0] == "/points")
    # Three times: of a thousand packets, a busy machine may lose one.
    recorded += 3 * [(topic, time_ns, full_turn(typestore, raw))]
    bridge = subprocess.Popen(bridge_command(), stdin=subprocess.PIPE)
    writer = Writer(Pipe(bridge.stdin), use_chunking=False)
    writer.start()
    channels = {}
    for name, connection in connections.items():
        schema = writer.register_schema(connection.msgtype, "ros2msg",
                                        connection.msgdef.data.encode())
        channels[name] = writer.register_channel(name, "cdr", schema)
    subscriber.received.clear()
    for topic, time_ns, raw in recorded:
        writer.add_message(channels[topic], time_ns, raw, time_ns)
        bridge.stdin.flush()
        # A turn has three messages and takes a tenth of a second.
        time.sleep(0.03)
        subscriber.take()
    writer.finish()
    bridge.stdin.close()
    received = dict(subscriber.received)
    for topic, messages in subscriber.take_all_of(bridge).items():
        received.setdefault(topic, []).extend(messages)
    for topic, name in TOPICS.items():
        expected = [typestore.deserialize_cdr(raw, name) for t, _, raw in recorded if t == topic]
        found = received.get(topic, [])
        assert len(found) > len(expected) / 3, f"{topic}: {len(found)} of {len(expected)}"
        # A subscriber that is late loses messages, but none changes or overtakes another.
        left = iter(expected)
        for ours in found:
            assert any(are_same(ours, theirs) for theirs in left), f"{topic}: {ours} is not in order"[:2000]
        print(f"of a recording, {topic}: {len(found)} of {len(expected)} messages")
    largest = max(len(cloud.data) for cloud in received["/points"])
    assert largest > 1.27e6, largest
    print(f"the largest cloud has {largest} bytes")


class Pipe:
    """Tells how much was written to a stream that cannot tell."""

    def __init__(self, stream):
        self.stream, self.n_bytes = stream, 0

    def write(self, data):
        self.n_bytes += len(data)
        return self.stream.write(data)

    def tell(self):
        return self.n_bytes

    def flush(self):
        self.stream.flush()


def full_turn(typestore, raw):
    """A cloud whose points are repeated until all beams of a turn have one."""
    cloud = typestore.deserialize_cdr(raw, TOPICS["/points"])
    size = FULL_TURN * cloud.point_step
    data = numpy.resize(cloud.data, size)
    full = dataclasses.replace(cloud, width=FULL_TURN, row_step=size, data=data)
    return bytes(typestore.serialize_cdr(full, TOPICS["/points"]))


def are_same(ours, theirs):
    """Whether all fields of `ours` are equal; `theirs` has constants beside them."""
    if dataclasses.is_dataclass(ours):
        names = [field.name for field in dataclasses.fields(ours)]
        return all(are_same(getattr(ours, name), getattr(theirs, name)) for name in names)
    if isinstance(theirs, numpy.ndarray):
        return numpy.array_equal(numpy.asarray(ours, theirs.dtype), theirs)
    if isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(are_same, ours, theirs))
    return ours == theirs


main()
