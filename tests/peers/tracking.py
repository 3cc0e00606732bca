"""TrackEval's HOTA of `infer-cpu live` on a simulated drive, beside assignment by the Hungarian method.

The tracker of `live` takes the clusters of a turn one after the other, each to the track that expects
it most. A tracker of the same Kalman filters and footprints that assigns all of them at once by SciPy's
`linear_sum_assignment`, but does not know pieces of objects by their whole boxes, must be worse by
five points of HOTA on the mean of three drives: it is by six. Both get the same clusters, those that `live` reports; the truth is the drive's. Run by
`cargo xtask test`; see xtask/src/test/peers.rs.
"""

import json
import math
from collections import defaultdict

from peer import OUT, ROOT, edgepuck, infer, skipped_if_missing

with skipped_if_missing():
    import numpy

    # TrackEval 1.3.0 uses names that NumPy 1.24 took away.
    numpy.float, numpy.int = float, int
    import trackeval
    from scipy.optimize import linear_sum_assignment

SECONDS = 12
SEEDS = [0, 1, 2]
# Drives begin at a whole hour.
HOUR_S, TURN_S = 3600, 0.1
# What a robot tracks; clusters on all else are not judged.
CLASSES = {"car", "truck", "bus", "two-wheeler", "person"}
# `live` names clusters of so many points; of fewer it says only where they are.
MIN_POINTS = 20
# A cluster so far outside of an object's box is not the object's.
FARTHEST_M = 2.0

# The tracker of infer-cpu/src/live/tracker.rs, whose sources and reasons stand there.
FIRST_VELOCITY = numpy.array([8.0, 8.0, 0.5])
ACCELERATION = numpy.array([3.0, 3.0, 0.5])
GATE, PATIENCE_S, SHRINKAGE, MOST_HIDDEN_M = 11.34, 1.05, 0.99, 4.0


def main():
    ours, theirs = zip(*map(drive, SEEDS))
    # 83 and more as measured; 65 of the worst before pieces of objects were known.
    assert min(ours) > 75, ours
    assert numpy.mean(ours) > numpy.mean(theirs) + 5, (ours, theirs)


def drive(seed):
    """HOTA of `live` and of the Hungarian method on the drive of this seed."""
    capture = OUT / f"drive-{seed}.pcap"
    edgepuck("gen-scenes", "street", "--drive", SECONDS, "--seed", seed, "--out", capture)
    live = infer("live", "--pcap", capture, "--poses", capture.with_suffix(".tum"), "--model",
                 ROOT / "assets/weights/street-bev.safetensors")
    found = [json.loads(line) for line in live.stdout.splitlines()]
    truth_file = capture.with_suffix(".truth.jsonl")
    truth = [json.loads(line) for line in truth_file.read_text().splitlines()]
    turns = judged(truth, found)
    ours_is_theirs(turns)
    turns = [([one["object"] for one in objects], *rest) for objects, *rest in turns]
    ours = score(turns, {id(one): one["track"] for one in found})
    theirs = score(turns, hungarian(found, numpy.loadtxt(capture.with_suffix(".tum"))))
    print(f"seed {seed}, {SECONDS} s, {len(found)} clusters: live {ours}; Hungarian {theirs}",
          flush=True)
    return ours["HOTA"], theirs["HOTA"]


def ours_is_theirs(turns):
    """`eval`'s HOTA and switches of what is in each turn must be those of TrackEval, for points 2 m apart at most."""
    files, data = [OUT / "eval.jsonl", OUT / "eval.truth.jsonl"], []
    with files[0].open("w") as detections, files[1].open("w") as truth:
        for number, (objects, clusters, _) in enumerate(turns):
            off = numpy.array([[math.dist(one["centre_m"][:2], of["position_m"][:2]) for of in clusters] for one in objects])
            data.append(([one["object"] for one in objects], clusters,
                         numpy.maximum(0, 1 - off.reshape(len(objects), len(clusters)) / 2)))
            box = {"class": "thing", "turn": number, "size_m": [1, 1, 1], "yaw_deg": 0}
            for one in objects:
                truth.write(json.dumps(box | {"object": one["object"], "position_m": one["centre_m"]}) + "\n")
            for one in clusters:
                detections.write(json.dumps(box | {"track": one["track"], "position_m": one["position_m"]}) + "\n")
    wanted = score(data, {id(one): one["track"] for _, clusters, _ in data for one in clusters})
    said = edgepuck("eval", "--detections", files[0], "--truth", files[1]).stdout.splitlines()
    line = next(line for line in said if "HOTA" in line)
    parts = [f"{wanted[name]:.1f}" for name in ("HOTA", "DetA", "AssA")]
    expected = "HOTA {:>5} (detection {}, association {}), {} switches".format(*parts, wanted["switches"])
    assert line.endswith(expected), (line, expected)


def judged(truth, found):
    """For each turn the objects, the clusters on them and how near each is to each, 0 to 1."""
    objects, clusters = defaultdict(list), defaultdict(list)
    for one in truth:
        objects[one["turn"]].append(one)
    for one in found:
        clusters[turn_of(one)].append(one)
    turns = []
    for turn in sorted(objects):
        here = objects[turn]
        wanted = [i for i, one in enumerate(here)
                  if one["class"] in CLASSES and one["points"] >= MIN_POINTS]
        kept, similar = [], []
        for cluster in clusters[turn]:
            away = [outside(cluster, one) for one in here]
            if min(away) < FARTHEST_M and away.index(min(away)) in wanted:
                kept.append(cluster)
                similar.append([max(0.0, 1 - away[i] / FARTHEST_M) for i in wanted])
        similar = numpy.array(similar).reshape(len(kept), len(wanted)).T
        turns.append(([here[i] for i in wanted], kept, similar))
    return turns


def middle_s(cluster):
    return (cluster["first_s"] + cluster["last_s"]) / 2


def turn_of(cluster):
    return int(middle_s(cluster) % HOUR_S / TURN_S)


def outside(cluster, one):
    """How far the middle of a cluster is outside of an object's box, from above."""
    since_s = middle_s(cluster) - one["time_s"]
    off = [cluster["position_m"][i] - one["centre_m"][i] - since_s * one["velocity_m_s"][i]
           for i in range(2)]
    sin, cos = math.sin(math.radians(one["yaw_deg"])), math.cos(math.radians(one["yaw_deg"]))
    along = [abs(cos * off[0] + sin * off[1]), abs(cos * off[1] - sin * off[0])]
    return math.hypot(*(max(0.0, along[i] - one["size_m"][i] / 2) for i in range(2)))


def score(turns, tracks):
    """HOTA, its detection and association parts, identity switches, and the tracks of an object."""
    objects, ids, pairs = {}, {}, set()
    number = lambda known, one: known.setdefault(one, len(known))
    data = {"gt_ids": [], "tracker_ids": [], "similarity_scores": []}
    for here, clusters, similar in turns:
        data["gt_ids"].append(numpy.array([number(objects, one) for one in here], int))
        data["tracker_ids"].append(
            numpy.array([number(ids, tracks[id(one)]) for one in clusters], int))
        data["similarity_scores"].append(similar)
        pairs.update((here[column.argmax()], tracks[id(one)])
                     for column, one in zip(similar.T, clusters))
    data.update(num_timesteps=len(turns), num_gt_ids=len(objects), num_tracker_ids=len(ids),
                num_gt_dets=sum(map(len, data["gt_ids"])),
                num_tracker_dets=sum(map(len, data["tracker_ids"])))
    hota = trackeval.metrics.HOTA().eval_sequence(data)
    clear = trackeval.metrics.CLEAR({"PRINT_CONFIG": False}).eval_sequence(data)
    scores = {name: round(100 * float(numpy.mean(hota[name])), 1)
              for name in ("HOTA", "DetA", "AssA")}
    return scores | {"switches": int(clear["IDSW"]), "of": int(clear["CLR_TP"]),
                     "tracks": round(len(pairs) / len({one for one, _ in pairs}), 1)}


class Track:
    """A Kalman filter an axis, and the two sides that were seen of an object."""

    def __init__(self, number, cluster):
        self.number, self.last_s = number, cluster["last_s"]
        self.place = numpy.array(cluster["position_m"])
        self.velocity = numpy.zeros(3)
        self.covariance = [numpy.full(3, off(cluster) ** 2), numpy.zeros(3), FIRST_VELOCITY ** 2]
        self.sides, self.yaw = numpy.array(cluster["size_m"][:2]), math.radians(cluster["yaw_deg"])

    def after(self, time_s):
        dt, (pp, pv, vv), q = time_s - self.last_s, self.covariance, ACCELERATION ** 2
        place = self.place + dt * self.velocity
        return place, [pp + 2 * dt * pv + dt ** 2 * vv + q * dt ** 4 / 4,
                       pv + dt * vv + q * dt ** 3 / 2, vv + q * dt ** 2]

    def sides_of(self, cluster):
        sides, yaw = numpy.array(cluster["size_m"][:2]), math.radians(cluster["yaw_deg"])
        if (yaw - self.yaw + math.pi / 4) % math.pi < math.pi / 2:
            return sides, yaw
        return sides[::-1], yaw + math.pi / 2

    def middle(self, cluster, sensor):
        sides, yaw = self.sides_of(cluster)
        middle = numpy.array(cluster["position_m"])
        from_sensor = middle[:2] - sensor
        for i, axis in enumerate([(math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))]):
            hidden = min(max(self.sides[i] - sides[i], 0.0), MOST_HIDDEN_M)
            middle[:2] += math.copysign(hidden / 2, from_sensor @ numpy.array(axis)) * numpy.array(axis)
        return middle

    def cost(self, cluster, sensor):
        place, covariance = self.after(cluster["last_s"])
        variance = covariance[0] + off(cluster) ** 2
        distance = ((self.middle(cluster, sensor) - place) ** 2 / variance).sum()
        sides, _ = self.sides_of(cluster)
        mismatch = ((sides - self.sides) / (0.2 + 0.3 * numpy.maximum(sides, self.sides))) ** 2
        cost = distance + numpy.log(variance).sum() + mismatch.sum()
        return cost if distance <= GATE else numpy.inf

    def update(self, cluster, sensor):
        middle = self.middle(cluster, sensor)
        place, (pp, pv, vv) = self.after(cluster["last_s"])
        variance = pp + off(cluster) ** 2
        self.velocity = self.velocity + pv / variance * (middle - place)
        self.place = place + pp / variance * (middle - place)
        self.covariance = [pp * (1 - pp / variance), pv * (1 - pp / variance),
                           vv - pv * pv / variance]
        sides, self.yaw = self.sides_of(cluster)
        self.sides, self.last_s = numpy.maximum(sides, SHRINKAGE * self.sides), cluster["last_s"]


def off(cluster):
    return 0.1 + 0.05 * cluster["size_m"][0]


def hungarian(found, poses):
    """The track of each cluster, if all of a turn are assigned at once; `poses` are the sensor's."""
    turns, tracks, numbers, n = defaultdict(list), [], {}, 0
    for one in found:
        turns[turn_of(one)].append(one)
    for turn in sorted(turns):
        clusters = turns[turn]
        tracks = [one for one in tracks if clusters[0]["last_s"] - one.last_s < PATIENCE_S]
        at = [numpy.array([numpy.interp(one["last_s"], poses[:, 0], poses[:, axis])
                           for axis in (1, 2)]) for one in clusters]
        costs = numpy.array([[track.cost(one, sensor) for track in tracks]
                             for one, sensor in zip(clusters, at)])
        costs = costs.reshape(len(clusters), len(tracks))
        pairs = {}
        if tracks:
            rows, columns = linear_sum_assignment(numpy.minimum(costs, 1e3))
            pairs = {row: tracks[column] for row, column in zip(rows, columns)
                     if numpy.isfinite(costs[row, column])}
        for row, cluster in enumerate(clusters):
            if row in pairs:
                pairs[row].update(cluster, at[row])
                numbers[id(cluster)] = pairs[row].number
            else:
                n += 1
                numbers[id(cluster)] = n
                tracks.append(Track(n, cluster))
    return numbers


main()
