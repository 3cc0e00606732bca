"""rosbags, mcap-ros2-support and Rerun open what `infer-cpu live --mcap` records.

All points of a turn are those that velodyne-decoder finds in the same packets, and all objects
those of the JSON lines. Run by `cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import math
import os
import sys
from collections import Counter, defaultdict
from pathlib import Path

from peer import OUT, ROOT, edgepuck, infer, run, skipped_if_missing

with skipped_if_missing():
    import numpy
    import velodyne_decoder
    from mcap_ros2.reader import read_ros2_messages
    from rosbags.highlevel import AnyReader

SECONDS, TURNS_PER_S = 2, 10
TYPES = {
    "/points": "sensor_msgs/msg/PointCloud2",
    "/objects": "vision_msgs/msg/Detection3DArray",
    "/objects/markers": "visualization_msgs/msg/MarkerArray",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
}
POINT = numpy.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"),
                     ("ring", "<u2"), ("time", "<f4")])
# As velodyne_decoder.py derives.
READ_AZIMUTH_DEG = 0.02
# Packets have whole microseconds, and f64 holds the Unix time of 2000 to 1.2e-7 s, also where the
# decoder adds and we subtract it.
TIME_S = 0.5e-6 + 4 * 1.2e-7
# JSON lines are rounded to thousandths, half of which is the most that two numbers differ by.
ROUNDING = 0.0005 + 1e-12


def main():
    capture, recording = OUT / "drive.pcap", OUT / "run.mcap"
    edgepuck("gen-scenes", "street", "--drive", SECONDS, "--out", capture)
    live = infer("live", "--pcap", capture, "--poses", capture.with_suffix(".tum"), "--json", "--mcap",
                 recording, "--model", ROOT / "assets/weights/street-bev.safetensors")
    objects = [json.loads(line) for line in live.stdout.splitlines()]
    messages = rosbags_messages(recording)
    compare_points(messages["/points"], capture)
    compare_objects(messages["/objects"], messages["/objects/markers"], objects)
    compare_poses(messages["/tf"], messages["/tf_static"], capture.with_suffix(".tum"))
    compare_readers(recording, messages)
    convert(recording)


def rosbags_messages(recording):
    """The messages of each topic, by the definitions in the file alone."""
    messages = defaultdict(list)
    with AnyReader([recording]) as reader:
        types = {connection.topic: connection.msgtype for connection in reader.connections}
        assert types == TYPES, types
        for connection, time_ns, raw in reader.messages():
            messages[connection.topic].append(reader.deserialize(raw, connection.msgtype))
            assert time_ns > 0
    for topic in ("/points", "/objects", "/objects/markers", "/tf"):
        # The stream of a sensor ends in the middle of a turn.
        assert len(messages[topic]) in (SECONDS * TURNS_PER_S - 1, SECONDS * TURNS_PER_S), topic
    print("rosbags:", {topic: len(found) for topic, found in sorted(messages.items())})
    return messages


def stamp_s(message):
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def compare_points(clouds, capture):
    """Both find the same points, with their rings and times."""
    points, times_s = [], []
    for cloud in clouds:
        fields = [(field.name, field.offset) for field in cloud.fields]
        assert fields == [(name, POINT.fields[name][1]) for name in POINT.names], fields
        assert (cloud.point_step, cloud.height, cloud.is_dense) == (POINT.itemsize, 1, True)
        assert cloud.row_step == len(cloud.data) == cloud.width * cloud.point_step
        turn = numpy.frombuffer(cloud.data.tobytes(), POINT)
        points.append(numpy.stack([turn[name] for name in POINT.names[:5]], axis=1))
        times_s.append(stamp_s(cloud) + turn["time"].astype(float))
    ours, times_s = numpy.concatenate(points), numpy.concatenate(times_s)

    config = velodyne_decoder.Config(timestamp_first_packet=True, min_range=0, max_range=1000)
    scans = list(velodyne_decoder.read_pcap(str(capture), config))
    theirs = numpy.concatenate([cloud for _, cloud in scans])
    theirs_s = numpy.concatenate([stamp.device + cloud[:, 4].astype(float)
                                  for stamp, cloud in scans])
    assert len(ours) == len(theirs) > 0, (len(ours), len(theirs))
    assert (ours[:, 3:] == theirs[:, [3, 6]]).all(), "intensities or rings differ"
    apart_m = numpy.linalg.norm(ours[:, :3] - theirs[:, :3], axis=1)
    apart_deg = numpy.degrees(apart_m / numpy.linalg.norm(theirs[:, :3], axis=1)).max()
    apart_s = numpy.abs(times_s - theirs_s).max()
    print(f"velodyne-decoder: {len(theirs)} points, at most {apart_deg:.4f} deg and "
          f"{apart_s * 1e6:.2f} us apart")
    assert apart_deg < READ_AZIMUTH_DEG and apart_s < TIME_S


def compare_objects(detections, markers, objects):
    """A turn's messages hold the objects of its lines that have a class, in their order."""
    objects = [line for line in objects if line["class"] not in (None, "unknown")]
    found = [detection for turn in detections for detection in turn.detections]
    assert len(found) == len(objects) > 100, (len(found), len(objects))
    for detection, line in zip(found, objects, strict=True):
        box, position = detection.bbox, detection.bbox.center.position
        whole = line["whole_box"] or line | {"centre_m": line["position_m"]}
        assert (detection.id, detection.header.frame_id) == (str(line["track"]), line["frame"])
        near([position.x, position.y, position.z], whole["centre_m"])
        near([box.size.x, box.size.y, box.size.z], whole["size_m"])
        turned = box.center.orientation
        near([math.degrees(2 * math.atan2(turned.z, turned.w))], [whole["yaw_deg"]])
        assert abs(stamp_s(detection) - line["last_s"]) < 1e-6
        results = detection.results
        named = [(result.hypothesis.class_id, result.hypothesis.score) for result in results]
        assert [name for name, _ in named] == [line["class"]]
        near([score for _, score in named], [line["probability"]] * len(named))
    boxes = [marker for turn in markers for marker in turn.markers if marker.ns == "boxes"]
    assert [str(box.id) for box in boxes] == [detection.id for detection in found]
    print(f"{len(found)} objects are those of the lines")


def near(found, expected):
    assert all(abs(a - b) < ROUNDING for a, b in zip(found, expected, strict=True)), \
        (found, expected)


def compare_poses(moved, still, tum):
    """The world is the parent of what carries the sensor, and that is the sensor's."""
    poses = numpy.loadtxt(tum)
    for message in moved:
        [transform] = message.transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("world", "base_link")
        at = transform.transform.translation
        time_s = stamp_s(transform)
        expected = [numpy.interp(time_s, poses[:, 0], poses[:, axis]) for axis in (1, 2, 3)]
        near([at.x, at.y, at.z], expected)
    [[transform]] = [message.transforms for message in still]
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_link", "sensor")


def compare_readers(recording, messages):
    """mcap-ros2-support reads as many messages, and the same boxes."""
    counts, ids = Counter(), []
    for message in read_ros2_messages(str(recording)):
        counts[message.channel.topic] += 1
        if message.channel.topic == "/objects":
            ids += [detection.id for detection in message.ros_msg.detections]
    assert counts == {topic: len(found) for topic, found in messages.items()}, counts
    assert ids == [detection.id for turn in messages["/objects"] for detection in turn.detections]
    print("mcap-ros2-support: the same messages")


def convert(recording):
    """Rerun understands the clouds and the transforms, not only their bytes."""
    rerun = Path(sys.executable).with_name("rerun")
    # Its settings, of which one is that it reports nothing of this, are not the user's.
    os.environ["HOME"] = str(OUT)
    run(rerun, "analytics", "disable")
    out = OUT / "run.rrd"
    run(rerun, "mcap", "convert", recording, "-o", out)
    shown = run(rerun, "rrd", "print", out).stdout
    for name in ("Points3D", "Transform3D"):
        assert name in shown, f"{name} is not in what Rerun made of {recording}"
    print("Rerun: points and transforms are shown")


main()
