//! What an answer says: each field against the detector called by hand for the returns of each turn,
//! against closed forms of the sensor's motion, and across the hour of the stamps.

use super::{START_S, all, on_time, pipeline, run};
use crate::street::{PACKET, PACKET_S, PACKETS_PER_S, Thing, packets, street};
use edgepuck_ros_messages::{self as ros, Message};
use edgepuck_segment::{OrientedBox, Settings, Sweep};
use formats::returns::Return;
use formats::velodyne;
use glam::{DQuat, DVec3, Vec3};
use infer_cpu::Options;
use infer_cpu::detect::{self, Detector};
use infer_cpu::live::{Arrival, Object, Pipeline, Pose, Recorder, Trajectory};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::time::{Duration, Instant};

const TURN_S: f64 = 0.1;

/// An object or another cluster of a turn, found by hand.
struct Found {
    points: Vec<[f32; 3]>,
    times_s: Vec<f64>,
    turn: u64,
    /// When the last point of the turn was measured.
    pose_s: f64,
    object: Option<detect::Object>,
}

impl Found {
    /// When its first and its last point were measured.
    fn span_s(&self) -> [f64; 2] {
        let times_s = || self.times_s.iter().copied();
        [times_s().fold(f64::INFINITY, f64::min), times_s().fold(0.0, f64::max)]
    }
}

/// The returns of a packet.
struct Decoded {
    time_s: f64,
    turn: u64,
    returns: Vec<Return>,
}

/// Points of a sensor at rest.
fn at_rest(point: [f32; 3], _: f64, _: f64) -> [f32; 3] {
    point
}

/// The returns of each packet, with their times, as the pipeline reports them.
fn decoded(sent: &[[u8; PACKET]]) -> Vec<Decoded> {
    let mut pipeline = pipeline(&all());
    let decoded = on_time(sent).map(|(since_s, packet)| {
        pipeline.take(packet, Arrival { time_s: START_S + since_s, moment: None });
        let found = pipeline.decoded().unwrap();
        // The stamps are rounded to microseconds, and f64 holds Unix time within 0.24.
        assert!((found.time_s - START_S - since_s).abs() < 1.5e-6, "{}", found.time_s);
        assert_eq!(found.turn, ((since_s + 1e-9) / TURN_S) as u64, "at {since_s} s");
        Decoded { time_s: found.time_s, turn: found.turn, returns: found.returns.to_vec() }
    });
    decoded.collect()
}

/// What a detector finds in each whole turn, in the order in which it was passed. `moved` puts points
/// into the frame of the sensor at the second time.
fn clusters(decoded: &[Decoded], moved: impl Fn([f32; 3], f64, f64) -> [f32; 3]) -> Vec<Found> {
    let settings = Settings::default();
    let mut detector = Detector::with(&model(), &Options::default(), 20, settings).unwrap();
    detector.min_confidence = 0.15;
    let mut all = Vec::new();
    for packets in decoded.chunk_by(|a, b| a.turn == b.turn) {
        let turn = packets[0].turn;
        // The last one did not end.
        if turn == decoded.last().unwrap().turn {
            break;
        }
        let timed = packets.iter().flat_map(|packet| {
            let time_s = packet.time_s;
            packet.returns.iter().map(move |found| (time_s + found.after_us * 1e-6, *found))
        });
        let timed: Vec<(f64, Return)> = timed.collect();
        let pose_s = timed.iter().fold(0.0f64, |last_s, (time_s, _)| last_s.max(*time_s));
        let points: Vec<_> =
            timed.iter().map(|(time_s, found)| moved(found.point_m, *time_s, pose_s)).collect();
        let rings: Vec<_> = timed.iter().map(|(_, found)| found.ring).collect();
        let found = detector.detect(&Sweep { points: &points, rings: Some(&rings) }).unwrap();
        let start = all.len();
        all.extend(detector.clusters().enumerate().map(|(number, cluster)| Found {
            points: cluster.points.iter().map(|&i| points[i as usize]).collect(),
            times_s: cluster.points.iter().map(|&i| timed[i as usize].0).collect(),
            turn,
            pose_s,
            object: found.objects.get(number).cloned(),
        }));
        all[start..].sort_by(|a: &Found, b| a.span_s()[1].total_cmp(&b.span_s()[1]));
    }
    all
}

fn model() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights/street-bev.safetensors")
}

/// The probabilities of the five known classes and of `unknown` by a detection: of what it is not,
/// four fifths are unknown. A cluster without a detection is unknown at 0.9.
fn probabilities(object: Option<&detect::Object>) -> Vec<f64> {
    let Some(object) = object else { return [vec![0.02; 5], vec![0.9]].concat() };
    let class = CLASSES.iter().position(|name| *name == object.class).unwrap();
    let rest = 1.0 - object.confidence;
    let mut all = vec![0.2 * rest / 4.0; 6];
    (all[class], all[5]) = (object.confidence, 0.8 * rest);
    all
}

const CLASSES: [&str; 6] = ["car", "person", "two-wheeler", "bus", "truck", "unknown"];

/// Objects that the pipeline answers without its last clusters, which only the end completes.
fn answers(pipeline: &mut Pipeline, sent: &[[u8; PACKET]]) -> Vec<Object> {
    let mut objects = Vec::new();
    for (since_s, packet) in on_time(sent) {
        pipeline.take(packet, Arrival { time_s: START_S + since_s, moment: None });
        pipeline.answer(|object| objects.push(object.clone()));
    }
    objects
}

/// The mean of the log-probabilities of a track: each view counts as much as the others, at first,
/// and later at least a twentieth.
#[derive(Default)]
struct Mean {
    n: f64,
    log_probabilities: Vec<f64>,
}

impl Mean {
    fn add(&mut self, view: &[f64]) {
        self.n += 1.0;
        self.log_probabilities.resize(view.len(), 0.0);
        let weight = (1.0 / self.n).max(0.05);
        for (mean, new) in self.log_probabilities.iter_mut().zip(view) {
            *mean += weight * (new.max(1e-3).ln() - *mean);
        }
    }

    /// The likeliest known class, its probability, and whether the track is of it.
    fn best(&self) -> (usize, f64, bool) {
        let of = |class: &usize| self.log_probabilities[*class];
        let best = (0..5).max_by(|a, b| of(a).total_cmp(&of(b))).unwrap();
        let sum: f64 = self.log_probabilities.iter().map(|x| (x - of(&best)).exp()).sum();
        (best, 1.0 / sum, of(&best) >= of(&5))
    }
}

#[test]
fn objects_are_those_of_the_detector() {
    let sent = packets(&street(), 5_000, 2 * PACKETS_PER_S);
    let found = clusters(&decoded(&sent), at_rest);
    let objects = answers(&mut pipeline(&all()), &sent);
    assert_eq!(objects.len(), found.len());
    let (mut tracks, mut seen) = (BTreeMap::<u64, Mean>::new(), BTreeSet::new());
    let mut answered = BTreeSet::new();
    for (object, found) in objects.iter().zip(&found) {
        let OrientedBox { centre_m, size_m, yaw_rad } = OrientedBox::around(&found.points);
        assert_eq!(object.frame, "sensor");
        assert_eq!((object.turn, object.points), (found.turn, found.points.len()));
        assert_eq!(object.position_m, centre_m.map(f64::from));
        assert_eq!(object.size_m, size_m.map(f64::from));
        assert_eq!(object.yaw_deg, f64::from(yaw_rad.to_degrees()));
        let flat_m = f64::from(centre_m[0]).hypot(f64::from(centre_m[1]));
        assert!((object.range_m - flat_m).abs() < 1e-5);
        assert_eq!([object.first_s, object.last_s], found.span_s());
        assert_eq!(object.latency_ms, None);
        if found.points.len() < 20 {
            assert_eq!(object.confidence, None);
            continue;
        }
        let view = probabilities(found.object.as_ref());
        let mean = tracks.entry(object.track).or_default();
        mean.add(&view);
        let (best, probability, is_known) = mean.best();
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-9;
        assert!(near(object.probability, probability), "{object:?}: {probability}");
        assert!(near(object.confidence, view[best].max(1e-3)), "{object:?}");
        assert_eq!(object.resembles.as_deref(), Some(CLASSES[best]));
        let answer = if is_known { CLASSES[best] } else { "unknown" };
        assert_eq!(object.class.as_deref(), Some(answer));
        // Later boxes of a track are means.
        let own = found.object.as_ref().filter(|own| own.class == answer);
        if let (Some(own), true) = (own, seen.insert(object.track)) {
            let (reported, whole) = (object.whole_box.unwrap(), own.whole);
            assert_eq!(reported.centre_m, whole.centre_m.map(f64::from));
            assert_eq!(reported.size_m, whole.size_m.map(f64::from));
            let off_rad = reported.yaw_rad - f64::from(whole.yaw_rad);
            assert!(off_rad.sin().abs() < 1e-6, "{object:?}: {whole:?}");
        }
        answered.insert(answer.to_owned());
    }
    assert!(answered.contains("unknown") && answered.len() > 1, "{answered:?}");
}

/// A sensor that drives and turns: the closed form of its pose.
fn driven(after_s: f64) -> Pose {
    let position_m = DVec3::new(100.0, -40.0, 2.0) + DVec3::new(30.0, 4.0, 0.5) * after_s;
    Pose { position_m, rotation: DQuat::from_rotation_z(1.9 + 0.6 * after_s) }
}

#[test]
fn points_of_a_moving_sensor_are_rectified() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let mut options = all();
    let known_s = [-1.0, 3.0];
    let poses = known_s.map(|after_s| (START_S + after_s, driven(after_s)));
    options.ego_motion = Some(Trajectory::new(poses.to_vec()).unwrap());
    let objects = answers(&mut pipeline(&options), &sent);
    // Points of the sensor at one time, as it sees them at another.
    let moved = |point: [f32; 3], at_s: f64, pose_s: f64| {
        let [at, last] = [at_s, pose_s].map(|time_s| driven(time_s - START_S));
        let in_world = at.to_world(Vec3::from(point).as_dvec3());
        last.from_world(in_world).as_vec3().to_array()
    };
    let found = clusters(&decoded(&sent), moved);
    assert_eq!(objects.len(), found.len());
    assert!(objects.len() > 20);
    for (object, found) in objects.iter().zip(&found) {
        let last_s = found.pose_s - START_S;
        let last = driven(last_s);
        let seen = OrientedBox::around(&found.points);
        let range_m = Vec3::from(seen.centre_m).as_dvec3().truncate().length();
        assert!((object.range_m - range_m).abs() < 1e-4);
        let at_m = last.to_world(Vec3::from(seen.centre_m).as_dvec3());
        // f32 holds these points within 2 micrometres, and the times within 0.24 us of 30 m/s.
        let off_m = DVec3::from_array(object.position_m).distance(at_m);
        assert!(object.frame == "world" && off_m < 1e-4, "{object:?}: {at_m}");
        let size_off = DVec3::from_array(object.size_m) - Vec3::from(seen.size_m).as_dvec3();
        assert!(size_off.abs().max_element() < 1e-4, "{object:?}: {seen:?}");
        // A direction of a box is one modulo half a turn.
        let turned_deg = f64::from(seen.yaw_rad).to_degrees() + (1.9 + 0.6 * last_s).to_degrees();
        let off_deg = (turned_deg - object.yaw_deg + 90.0).rem_euclid(180.0) - 90.0;
        assert!(off_deg.abs() < 0.05, "{object:?}: {off_deg}");
        assert!(object.yaw_deg.abs() <= 90.0, "{object:?}");
    }
    // So that the first and the last pose of a turn differ.
    let swept_s = found.iter().map(|found| found.pose_s - found.span_s()[0]).fold(0.0, f64::max);
    assert!(swept_s * 30.0 > 0.2, "{swept_s}");
}

/// A world with another origin and other axes has the same objects: hidden parts lie behind what the
/// sensor sees, wherever it is. What moves faster than 2 m/s shows its front, once its velocity is known.
#[test]
fn objects_do_not_depend_on_the_world_frame() {
    let mut things = street();
    things.push(Thing { at: [24.0, 7.0], velocity: [-6.0, 0.0], ..things[1] });
    let sent = packets(&things, 5_000, 2 * PACKETS_PER_S);
    let away = Pose { rotation: DQuat::from_rotation_z(1.9), ..driven(0.0) };
    let [here, there] = [Pose::IDENTITY, away].map(|pose| {
        let mut options = all();
        options.ego_motion = Some(Trajectory::new(vec![(START_S, pose)]).unwrap());
        answers(&mut pipeline(&options), &sent)
    });
    assert_eq!(here.len(), there.len());
    let mut n_ahead = [0; 2];
    for (here, there) in here.iter().zip(&there) {
        assert_eq!((here.track, &here.class), (there.track, &there.class));
        let velocities = here.velocity_m_s.zip(there.velocity_m_s);
        let turned = |v: [f64; 3]| away.rotation * DVec3::from(v);
        // Points go to the world and back, and are rounded to f32 once more: a few micrometres, of which
        // a turn of 0.1 s makes less than 1 mm/s.
        let is_same = |(a, b): ([f64; 3], [f64; 3])| turned(a).distance(b.into()) < 1e-3;
        assert!(velocities.is_none_or(is_same), "{here:?} {there:?}");
        let Some((whole, other)) = here.whole_box.zip(there.whole_box) else { continue };
        let off_m = away.to_world(whole.centre_m.into()).distance(other.centre_m.into());
        assert!(off_m < 1e-4, "{off_m} m: {here:?} {there:?}");
        let [x, y, _] = here.velocity_m_s.unwrap_or_default();
        if here.turn > 8 && x.hypot(y) > 4.0 {
            let ahead = x * whole.yaw_rad.cos() + y * whole.yaw_rad.sin();
            assert!(ahead > 0.9 * x.hypot(y), "{here:?}");
            n_ahead[usize::from(x > 0.0)] += 1;
        }
    }
    assert!(n_ahead.iter().all(|n| *n >= 5), "{n_ahead:?}");
}

#[test]
fn a_stream_across_the_hour_of_the_stamps_is_as_any_other() {
    let new = || pipeline(&all());
    let [plain, across] = [5_000, 3_599_500_000].map(|stamp_us| {
        let mut pipeline = new();
        let sent = packets(&street(), stamp_us, PACKETS_PER_S);
        let objects = run(&mut pipeline, on_time(&sent));
        let counts = *pipeline.counts();
        assert_eq!((counts.restarts, counts.lost, counts.late, counts.duplicated), (0, 0, 0, 0));
        objects
    });
    assert_eq!(plain.len(), across.len());
    for (plain, across) in plain.iter().zip(&across) {
        assert_eq!((plain.track, plain.position_m), (across.track, across.position_m));
        let off_s = [plain.first_s - across.first_s, plain.last_s - across.last_s];
        // Both are rounded to f64 of Unix time once or twice.
        assert!(off_s.into_iter().all(|off_s| off_s.abs() < 1e-6), "{off_s:?}");
    }
}

#[test]
fn a_briefly_hidden_object_keeps_its_track() {
    let [car, _, person] = street()[..] else { panic!("expected three things") };
    let n = 3 * PACKETS_PER_S;
    let alone = packets(&[car], 5_000, n);
    let gone = packets(&[], 5_000, n);
    let walks = packets(&[person], 5_000, n);
    let both = packets(&[car, person], 5_000, n);
    // The car is hidden from 1.0 to 1.8 s, and a person appears at 1.4 s.
    let sent: Vec<[u8; PACKET]> = (0..n)
        .map(|i| match (i as f64 * PACKET_S / 0.2) as u32 {
            0..5 => alone[i],
            5..7 => gone[i],
            7..9 => walks[i],
            _ => both[i],
        })
        .collect();
    let objects = run(&mut pipeline(&all()), on_time(&sent));
    let near = |object: &&Object, thing: &Thing| {
        let since_s = object.last_s - START_S;
        let at = [0, 1].map(|axis| thing.at[axis] + since_s * thing.velocity[axis]);
        (object.position_m[0] - at[0]).hypot(object.position_m[1] - at[1]) < 2.4
    };
    let tracks = |thing: &Thing| -> Vec<u64> {
        let mut all: Vec<u64> =
            objects.iter().filter(|object| near(object, thing)).map(|o| o.track).collect();
        all.dedup();
        all
    };
    assert_eq!((tracks(&car).len(), tracks(&person).len()), (1, 1), "{:?}", tracks(&car));
    assert_ne!(tracks(&car), tracks(&person));
}

/// Packets that seem to have come ten seconds ago, each at its time.
#[test]
fn a_latency_counts_from_the_packet_with_the_last_point() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S / 2);
    let start = Instant::now().checked_sub(Duration::from_secs(10)).unwrap();
    let mut pipeline = pipeline(&all());
    let mut n_objects = 0;
    for (since_s, packet) in on_time(&sent) {
        let moment = Some(start + Duration::from_secs_f64(since_s));
        let before_s = start.elapsed().as_secs_f64();
        pipeline.take(packet, Arrival { time_s: START_S + since_s, moment });
        pipeline.answer(|object| {
            let after_s = start.elapsed().as_secs_f64();
            // Its points were measured within a packet, after the moment of which it arrived.
            let at_s = object.last_s - START_S;
            let answered_s = at_s + object.latency_ms.unwrap() * 1e-3;
            let span_s = before_s..after_s + PACKET_S + 1e-5;
            assert!(span_s.contains(&answered_s), "{answered_s} {span_s:?}");
            n_objects += 1;
        });
    }
    assert!(n_objects > 10, "{n_objects}");
}

/// By the manual (VLP-16, 63-9243, 9.3.2): in dual return mode the last return of a firing is in the
/// first block of a pair, and the strongest in the second.
#[test]
fn last_and_strongest_returns_are_not_swapped() {
    let mut packet = [0u8; PACKET];
    for block in 0..12 {
        let at = &mut packet[100 * block..];
        at[..2].copy_from_slice(&[0xff, 0xee]);
        let azimuth = 40 * (block as u16 / 2);
        at[2..4].copy_from_slice(&azimuth.to_le_bytes());
        for i in 0..32 {
            // 10 m, of reflectivity 5, behind 4 m, of 90. Unit: 2 mm.
            let (units, reflectivity) = match (i, block % 2) {
                (31, _) => (3_000u16, 7),
                (_, 0) => (5_000, 5),
                _ => (2_000, 90),
            };
            at[4 + 3 * i..6 + 3 * i].copy_from_slice(&units.to_le_bytes());
            at[6 + 3 * i] = reflectivity;
        }
    }
    packet[1204..].copy_from_slice(&[0x39, 0x22]);
    let decoder = velodyne::Decoder::new(velodyne::Model::Vlp16);
    let mut seen = BTreeMap::<String, usize>::new();
    decoder
        .decode(&packet, |found| {
            let text = format!("{:?} {} m, {}", found.kind, found.range_m, found.reflectivity);
            *seen.entry(text).or_default() += 1;
        })
        .unwrap();
    let expected = [("Both 6 m, 7", 6), ("Last 10 m, 5", 186), ("Strongest 4 m, 90", 186)];
    assert_eq!(seen, expected.map(|(text, n)| (text.to_owned(), n)).into());
}

/// The messages of one topic of a recording: the time of each, nanoseconds, and its bytes.
fn messages(recording: &[u8], topic: &str) -> Vec<(u64, Vec<u8>)> {
    let all = mcap::MessageStream::new(recording).unwrap().map(Result::unwrap);
    let own = all.filter(|message| message.channel.topic == topic);
    own.map(|message| (message.log_time, message.data.to_vec())).collect()
}

fn numbers<const N: usize>(bytes: &[u8]) -> [f64; N] {
    std::array::from_fn(|i| f64::from_le_bytes(bytes[8 * i..][..8].try_into().unwrap()))
}

/// Nanoseconds of Unix time, which f64 holds within 240.
fn assert_time(found_ns: u64, expected_s: f64) {
    let off_ns = found_ns.abs_diff((expected_s * 1e9) as u64);
    assert!(off_ns <= 1000, "{found_ns} ns, not {expected_s} s");
}

#[test]
fn a_recording_has_the_points_the_pose_and_the_objects_of_each_turn() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let mut options = all();
    let poses = [-1.0, 3.0].map(|after_s| (START_S + after_s, driven(after_s)));
    options.ego_motion = Some(Trajectory::new(poses.to_vec()).unwrap());
    let mut pipeline = pipeline(&options);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("run.mcap");
    let mut recorder = Recorder::create(&file).unwrap();
    // By the number of the turn in which a packet or an answer comes.
    let (mut returns, mut objects) = (BTreeMap::new(), BTreeMap::new());
    let mut before = 0;
    for (since_s, packet) in on_time(&sent) {
        pipeline.take(packet, Arrival { time_s: START_S + since_s, moment: None });
        // The turn that a packet completes comes before the packet itself.
        pipeline.answer(|object| {
            recorder.object(object);
            objects.entry(before).or_insert_with(Vec::new).push(object.clone());
        });
        recorder.packet(&pipeline).unwrap();
        let decoded = pipeline.decoded().unwrap();
        let timed = decoded.returns.iter().map(|it| (decoded.time_s + it.after_us * 1e-6, *it));
        before = decoded.turn;
        returns.entry(before).or_insert_with(Vec::new).extend(timed);
    }
    recorder.finish(&pipeline).unwrap();
    let recording = std::fs::read(&file).unwrap();

    let (clouds, moved) = (messages(&recording, "/points"), messages(&recording, "/tf"));
    assert_eq!((clouds.len(), moved.len()), (returns.len(), returns.len()));
    for ((returns, (at_ns, cloud)), (_, tf)) in returns.values().zip(&clouds).zip(&moved) {
        let (first_s, last_s) = (returns[0].0, returns.last().unwrap().0);
        assert_time(*at_ns, last_s);
        // 22 bytes a point: x, y, z, intensity, ring, time; then that all are finite.
        let data = &cloud[cloud.len() - 1 - 22 * returns.len()..cloud.len() - 1];
        for (bytes, (time_s, found)) in data.chunks(22).zip(returns) {
            let [x, y, z] = found.point_m;
            let since_s = (time_s - first_s) as f32;
            let numbers = [x, y, z, found.reflectivity.into()].map(f32::to_le_bytes);
            let ring = found.ring.to_le_bytes();
            assert_eq!(bytes, [&numbers.concat()[..], &ring, &since_s.to_le_bytes()].concat());
        }
        // After four bytes of CDR and the number of transforms: whole seconds, and nanoseconds.
        let [s, ns] = [8, 12].map(|at| u32::from_le_bytes(tf[at..at + 4].try_into().unwrap()));
        assert_time(u64::from(s) * 1_000_000_000 + u64::from(ns), last_s);
        let [x, y, z, rotation @ ..] = numbers::<7>(&tf[tf.len() - 56..]);
        let expected = driven(last_s - START_S);
        assert!(DVec3::new(x, y, z).distance(expected.position_m) < 1e-4);
        let turned = DQuat::from_array(rotation) * DVec3::X;
        assert!(turned.distance(expected.rotation * DVec3::X) < 1e-4);
    }

    let recorded = messages(&recording, "/objects");
    assert_eq!(recorded.len(), returns.len());
    let mut n_objects = 0;
    for (turn, (at_ns, bytes)) in returns.keys().zip(&recorded) {
        let own: &[Object] = objects.get(turn).map_or(&[], Vec::as_slice);
        let mut expected = ros::detections(&own.iter().map(message_of).collect::<Vec<_>>());
        let last_s = own.iter().map(|object| object.last_s).reduce(f64::max);
        let last_s = last_s.unwrap_or(returns[turn].last().unwrap().0);
        expected.header =
            ros::Header { stamp: ros::Time::from_s(last_s), frame_id: "world".to_owned() };
        assert_time(*at_ns, last_s);
        assert_eq!(*bytes, expected.to_cdr(), "turn {turn}");
        n_objects += own.len();
    }
    assert!(n_objects > 20, "{n_objects}");
}

fn message_of(object: &Object) -> ros::Object {
    ros::Object {
        turn: object.turn,
        track: object.track,
        class: object.class.as_deref().map(str::to_owned),
        probability: object.probability,
        frame: "world".to_owned(),
        position_m: object.position_m,
        size_m: object.size_m,
        yaw_deg: object.yaw_deg,
        last_s: object.last_s,
        whole_box: object.whole_box,
    }
}
