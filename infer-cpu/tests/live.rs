//! The pipeline from packets to tracked objects, with lost, late, foreign and damaged packets, and
//! with clocks that jump.

mod content;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::street::{
    OUSTER_PACKETS_PER_S, PACKET, PACKET_S, PACKETS_PER_S, Thing, ouster_metadata, ouster_packet,
    packets, street,
};
use formats::ouster::Metadata;
use formats::rng::StreamKey;
use infer_cpu::Options;
use infer_cpu::live::{Arrival, Counts, LiveOptions, Object, Pipeline, Pose, Trajectory};

/// Unix time at the first packet, seconds.
const START_S: f64 = 1.7e9;

/// Options that report an object when it is seen for the first time.
fn all() -> LiveOptions {
    let mut options = LiveOptions::default();
    options.min_turns = 1;
    options
}

fn pipeline(options: &LiveOptions) -> Pipeline {
    let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/weights");
    let model = Path::new(weights).join("street-bev.safetensors");
    Pipeline::open(&model, &Options::default(), options).unwrap()
}

/// Runs a pipeline on packets with their times since the first one, and returns all objects.
fn run<'a>(
    pipeline: &mut Pipeline,
    packets: impl IntoIterator<Item = (f64, &'a [u8])>,
) -> Vec<Object> {
    let mut objects = Vec::new();
    for (since_s, packet) in packets {
        pipeline.take(packet, Arrival { time_s: START_S + since_s, moment: None });
        pipeline.answer(|object| objects.push(object.clone()));
    }
    pipeline.end();
    pipeline.answer(|object| objects.push(object.clone()));
    objects
}

/// The packets with the times at which they were sent.
fn on_time(packets: &[[u8; PACKET]]) -> impl Iterator<Item = (f64, &[u8])> {
    packets.iter().enumerate().map(|(i, packet)| (i as f64 * PACKET_S, &packet[..]))
}

/// For each thing, the tracks near it and the number of objects of each track.
fn tracks(objects: &[Object], things: &[Thing]) -> Vec<BTreeMap<u64, usize>> {
    let mut tracks = vec![BTreeMap::new(); things.len()];
    for object in objects {
        let since_s = object.last_s - START_S;
        for (thing, tracks) in things.iter().zip(&mut tracks) {
            let off = [0, 1].map(|axis| {
                thing.at[axis] + since_s * thing.velocity[axis] - object.position_m[axis]
            });
            if off[0].hypot(off[1]) < thing.size[0] / 2.0 + 0.3 {
                *tracks.entry(object.track).or_default() += 1;
            }
        }
    }
    tracks
}

/// Checks that each thing has one track of at least `least` objects, with its velocity, and returns
/// the last object of each track.
fn last_of_tracks<'a>(objects: &'a [Object], things: &[Thing], least: usize) -> Vec<&'a Object> {
    let last = |(thing, tracks): (&Thing, BTreeMap<u64, usize>)| {
        let (&track, &n) = tracks.iter().max_by_key(|(_, n)| **n).unwrap();
        assert!(n >= least, "{thing:?}: {tracks:?}");
        let last = objects.iter().rfind(|object| object.track == track).unwrap();
        let velocity = last.velocity_m_s.unwrap();
        // The visible sides change while a car drives by, and with them the middle of its box.
        let off = (velocity[0] - thing.velocity[0]).hypot(velocity[1] - thing.velocity[1]);
        assert!(off < 1.0, "{thing:?}: {velocity:?}");
        last
    };
    things.iter().zip(tracks(objects, things)).map(last).collect()
}

#[test]
fn each_object_keeps_its_track_and_has_its_velocity() {
    let sent = packets(&street(), 5_000, 3 * PACKETS_PER_S);
    let objects = run(&mut pipeline(&all()), on_time(&sent));
    for last in last_of_tracks(&objects, &street(), 29) {
        assert!(last.frame == "sensor" && last.points >= 20 && last.class.is_some());
        assert!((last.last_s - START_S - 3.0).abs() < 0.15, "{last:?}");
        assert!((0.0..0.1).contains(&(last.last_s - last.first_s)));
    }
}

#[test]
fn objects_are_reported_from_min_turns_on() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let objects = run(&mut pipeline(&all()), on_time(&sent));
    assert_eq!(LiveOptions::default().min_turns, 2);
    for min_turns in [2, 4] {
        let mut options = all();
        options.min_turns = min_turns;
        let mut seen = BTreeMap::<u64, u64>::new();
        let expected: Vec<&Object> = objects
            .iter()
            .filter(|object| {
                let n = seen.entry(object.track).or_default();
                *n += 1;
                *n >= min_turns
            })
            .collect();
        let found = run(&mut pipeline(&options), on_time(&sent));
        assert!(found.iter().eq(expected.iter().copied()), "{min_turns}");
        assert!(found.len() < objects.len() && !found.is_empty(), "{min_turns}");
    }
}

#[test]
fn an_ouster_sees_the_same_street() {
    let things = street();
    let n_packets = 2 * OUSTER_PACKETS_PER_S;
    let sent: Vec<_> = (0..n_packets).map(|number| ouster_packet(&things, number)).collect();
    let since_s = |i: usize| i as f64 / OUSTER_PACKETS_PER_S as f64;
    let lost = |i: usize| i % 640 == 20;
    // It sends all 64 packets of a turn, or the first of them.
    for (last_column, n_sent, n_lost) in [(1023, 64, 2), (511, 32, 2), (239, 15, 0)] {
        let window = format!("\"column_window\": [0, {last_column}], \"pixels_per_column\"");
        let metadata = ouster_metadata().replace("\"pixels_per_column\"", &window);
        let mut options = all();
        options.ouster = Some(Metadata::parse(&metadata, Path::new("os.json")).unwrap());
        let mut pipeline = pipeline(&options);
        let coming = sent.iter().enumerate().filter(|(i, _)| !lost(*i) && i % 64 < n_sent);
        let objects = run(&mut pipeline, coming.map(|(i, packet)| (since_s(i), &packet[..])));
        pipeline.take(&sent[0][..48], Arrival { time_s: START_S, moment: None });
        let counts = pipeline.counts();
        let expected = ((n_packets / 64 * n_sent) as u64 - n_lost, n_lost, 1);
        assert_eq!((counts.packets, counts.lost, counts.foreign), expected, "{n_sent}");
        assert_eq!((counts.dropped_points, pipeline.stats().n_turns()), (0, 19), "{n_sent}");
        if n_sent == 64 {
            last_of_tracks(&objects, &things, 18);
        }
    }
}

/// The packets of a sensor in the street that sends a sector only, units of 0.01 degree: a packet is filled
/// with the blocks of the next pass (`is_filled`), or packets outside are left out.
fn of_sector([from, to]: [u16; 2], is_filled: bool) -> Vec<(f64, [u8; PACKET])> {
    let sent = packets(&street(), 5_000, 3 * PACKETS_PER_S);
    let after = |azimuth: u16| (u32::from(azimuth) + 36_000 - u32::from(from)) % 36_000;
    let is_sent = |block: &[u8]| after(u16::from_le_bytes([block[2], block[3]])) < after(to);
    if !is_filled {
        let inside = on_time(&sent).filter(|(_, packet)| packet[..1200].chunks(100).all(is_sent));
        return inside.map(|(since_s, packet)| (since_s, packet.try_into().unwrap())).collect();
    }
    let blocks = sent.iter().flat_map(|packet| packet[..1200].chunks(100)).enumerate();
    let inside: Vec<_> = blocks.filter(|(_, block)| is_sent(block)).collect();
    let packet = |blocks: &[(usize, &[u8])]| {
        let since_s = blocks[0].0 as f64 * PACKET_S / 12.0;
        let mut bytes = sent[0];
        let inside = blocks.iter().flat_map(|(_, block)| block.iter().copied());
        bytes.iter_mut().zip(inside).for_each(|(byte, new)| *byte = new);
        bytes[1200..1204].copy_from_slice(&(5_000 + (since_s * 1e6) as u32).to_le_bytes());
        (since_s, bytes)
    };
    inside.chunks_exact(12).map(packet).collect()
}

#[test]
fn a_sensor_that_sends_a_sector_sees_what_is_in_it_and_loses_nothing() {
    let sent = packets(&street(), 5_000, 3 * PACKETS_PER_S);
    let whole = run(&mut pipeline(&all()), on_time(&sent));
    for [from, to] in [[32_000, 5_000], [1_000, 6_000], [30_000, 24_000]] {
        for is_filled in [true, false] {
            let sent = of_sector([from, to], is_filled);
            let mut pipeline = pipeline(&all());
            let objects =
                run(&mut pipeline, sent.iter().map(|(at_s, packet)| (*at_s, &packet[..])));
            let Counts { lost, late, restarts, dropped_points, .. } = *pipeline.counts();
            let name = format!("{from} to {to}, {is_filled}");
            assert_eq!([lost, late, restarts, dropped_points], [0; 4], "{name}");
            // The parked car is in each turn.
            let turns: BTreeSet<_> = objects.iter().map(|object| object.turn).collect();
            assert!(turns.iter().copied().eq(0..turns.len() as u64), "{name}: {turns:?}");
            assert!((29..=31).contains(&turns.len()), "{name}: {turns:?}");
            // Behind the first, turns begin where the sector does.
            let width_s = f64::from((to + 36_000 - from) % 36_000) * 0.1 / 36_000.0;
            let is_of_two = |pair: &[Object]| {
                let [turn, next] = [pair[0].turn, pair[1].turn];
                turn > 0 && turn == next && pair[1].last_s - pair[0].last_s > width_s
            };
            assert!(!objects.windows(2).any(is_of_two), "{name}");
            let is_inside = |object: &&Object| {
                let azimuth_deg = (-object.position_m[1]).atan2(object.position_m[0]).to_degrees();
                let after_deg =
                    |azimuth_deg: f64| (azimuth_deg - f64::from(from) / 100.0).rem_euclid(360.0);
                let width_deg = after_deg(f64::from(to) / 100.0);
                object.turn > 2 && (13.0..width_deg - 13.0).contains(&after_deg(azimuth_deg))
            };
            let is_seen = |whole: &&Object| {
                objects.iter().any(|found| {
                    let off = |i: usize| (found.position_m[i] - whole.position_m[i]).abs();
                    (found.last_s - whole.last_s).abs() < 1e-4 && off(0).max(off(1)) < 0.01
                })
            };
            let expected: Vec<_> = whole.iter().filter(is_inside).collect();
            let n_seen = expected.iter().copied().filter(is_seen).count();
            assert!(n_seen > 20 && 10 * n_seen > 9 * expected.len(), "{name}: {n_seen}");
            // Packets that are lost in the sector count, and after a restart the sector is known.
            let again = sent.iter().map(|(at_s, packet)| (at_s + 4.0, &packet[..])).enumerate();
            let again = again.filter(|(i, _)| !(100..104).contains(i)).map(|(_, sent)| sent);
            run(&mut pipeline, again);
            let Counts { lost, restarts, .. } = *pipeline.counts();
            assert_eq!([lost, restarts], [4, 1], "{name}");
        }
    }
}

#[test]
fn what_is_lost_at_one_azimuth_after_many_turns_is_lost() {
    let sent = packets(&street(), 5_000, 2 * PACKETS_PER_S);
    let comes = |i: &usize| !(100..105).contains(i) && !(854..859).contains(i);
    let mut pipeline = pipeline(&all());
    run(&mut pipeline, on_time(&sent).enumerate().filter(|(i, _)| comes(i)).map(|(_, it)| it));
    assert_eq!((pipeline.counts().lost, pipeline.stats().n_turns()), (10, 19));
}

/// A packet covers 4.8 degrees, so that its loss divides a near car. Losing 1 % of the packets
/// changes no track; with 10 %, some tracks are still long.
#[test]
fn lost_packets_are_counted_and_answers_go_on() {
    let things = street();
    let sent = packets(&things, 5_000, 3 * PACKETS_PER_S);
    let key = StreamKey::new(0, "lost packets", 0);
    for (share, most_tracks) in [(0.01, 1), (0.1, 3), (0.5, 6)] {
        let comes = |i: usize| i == 0 || key.unit(i as u64) >= share || i + 1 == sent.len();
        let coming = on_time(&sent).enumerate().filter(|(i, _)| comes(*i)).map(|(_, p)| p);
        let mut pipeline = pipeline(&all());
        let objects = run(&mut pipeline, coming);
        let n_lost = (0..sent.len()).filter(|&i| !comes(i)).count() as u64;
        let counts = pipeline.counts();
        assert_eq!((counts.lost, counts.restarts, counts.late), (n_lost, 0, 0), "{share}");
        for tracks in tracks(&objects, &things) {
            let n_long = tracks.values().filter(|n| **n >= 8).count();
            let least = usize::from(share < 0.5);
            assert!((least..=most_tracks).contains(&n_long), "{share}: {tracks:?}");
        }
    }
}

#[test]
fn packets_that_come_twice_or_late_change_nothing() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let expected = run(&mut pipeline(&all()), on_time(&sent));
    let mut pipeline = pipeline(&all());
    let again = on_time(&sent).enumerate().flat_map(|(i, packet)| {
        let late = (i >= 3 && i % 10 == 0).then(|| (packet.0, &sent[i - 3][..]));
        let twice = (i % 7 == 0).then_some(packet);
        [Some(packet), twice, late].into_iter().flatten()
    });
    assert_eq!(run(&mut pipeline, again), expected);
    let counts = pipeline.counts();
    assert_eq!((counts.duplicated, counts.late, counts.lost), (108, 75, 0));
}

#[test]
fn a_sensor_that_restarts_and_clocks_that_jump_begin_a_new_stream() {
    let things = street();
    let [before, after] = [3_000_000_000, 0].map(|stamp| packets(&things, stamp, PACKETS_PER_S));
    // The sensor is off for five seconds; or its clock is set; or the host's is.
    for (pause_s, after) in [(5.0, &after), (0.0, &after), (-100.0, &before)] {
        let mut pipeline = pipeline(&all());
        let later = on_time(after).map(|(since_s, packet)| (since_s + 1.0 + pause_s, packet));
        let objects = run(&mut pipeline, on_time(&before).chain(later));
        let counts = pipeline.counts();
        assert_eq!((counts.restarts, counts.lost), (1, 0), "{pause_s}");
        assert_eq!(counts.packets, 2 * PACKETS_PER_S as u64);
        // There are objects of both halves.
        let n_late = objects.iter().filter(|object| object.first_s > START_S + 0.9 + pause_s);
        assert!(n_late.count() >= 20, "{pause_s}");
        // They are other tracks.
        let is_late = |object: &Object| object.last_s >= START_S + 1.0 + pause_s.max(0.0);
        let tracks = |late| {
            let of_half = objects.iter().filter(move |object| is_late(object) == late);
            of_half.map(|object| object.track).collect::<BTreeSet<_>>()
        };
        assert!(pause_s < 0.0 || tracks(true).is_disjoint(&tracks(false)), "{pause_s}");
    }
}

#[test]
fn packets_with_descending_times_are_ignored() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let mut pipeline = pipeline(&all());
    let backwards = sent.iter().rev().enumerate();
    let coming = backwards.map(|(i, packet)| (i as f64 * PACKET_S, &packet[..]));
    run(&mut pipeline, coming.chain(on_time(&sent).map(|(since_s, p)| (since_s + 10.0, p))));
    let counts = *pipeline.counts();
    assert_eq!(counts.packets + counts.late, 2 * PACKETS_PER_S as u64, "{counts:?}");
    assert!(counts.packets > PACKETS_PER_S as u64 && counts.clusters > 20, "{counts:?}");
}

#[test]
fn foreign_packets_are_counted_and_each_kind_is_reported_once() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let key = StreamKey::new(0, "foreign packets", 0);
    let noise: Vec<u8> = (0..PACKET).map(|i| (key.unit(i as u64) * 256.0) as u8).collect();
    let mut other_model = sent[0];
    other_model[1205] = 0x28;
    let mut unknown_model = sent[0];
    unknown_model[1205] = 0x77;
    let foreign: [&[u8]; 6] =
        [&[], &sent[0][..700], &[7; 65_507], &noise, &other_model, &unknown_model];
    let mut pipeline = pipeline(&all());
    let expected = run(&mut self::pipeline(&all()), on_time(&sent));
    let mixed = on_time(&sent).enumerate().flat_map(|(i, packet)| {
        let foreign = foreign.get(i % 20).map(|bytes| (packet.0, *bytes));
        [Some(packet), foreign].into_iter().flatten()
    });
    assert_eq!(run(&mut pipeline, mixed), expected);
    assert!(pipeline.counts().foreign >= 6 * 37);
    let flaws: Vec<_> = pipeline.new_flaws().iter().map(ToString::to_string).collect();
    let expected = [
        "expected a data packet of 1206 bytes, found 0 bytes",
        "block 0: expected the flag ff ee",
        "expected a packet of a vlp16, found one of a vlp32c",
        "expected a packet of a VLP-16 (byte 0x22) or VLP-32C (0x28), found byte 0x77",
    ];
    assert_eq!(flaws, expected);
    assert!(pipeline.new_flaws().is_empty());
}

/// A foreign first packet must not make the pipeline ignore the sensor forever.
#[test]
fn a_sensor_that_is_replaced_by_another_model_is_taken_after_a_while() {
    let sent = packets(&street(), 5_000, 2 * PACKETS_PER_S);
    let mut stranger = sent[0];
    stranger[1205] = 0x28;
    let mut pipeline = pipeline(&all());
    let objects = run(&mut pipeline, [(0.0, &stranger[..])].into_iter().chain(on_time(&sent)));
    let counts = pipeline.counts();
    assert_eq!((counts.foreign, counts.restarts), (300, 1));
    assert_eq!(counts.packets, sent.len() as u64 + 1 - 300);
    assert!(objects.len() > 30, "{}", objects.len());
}

#[test]
fn tracks_end_where_another_sensor_took_over() {
    let mut sent = packets(&street(), 5_000, 3 * PACKETS_PER_S);
    // For 310 packets another model sends; 300 are needed for either to be taken, which completes clusters.
    let taken_over = PACKETS_PER_S;
    sent[taken_over..taken_over + 310].iter_mut().for_each(|packet| packet[1205] = 0x28);
    let mut pipeline = pipeline(&all());
    let mut tracks = [BTreeSet::new(), BTreeSet::new()];
    for (i, (time_s, packet)) in on_time(&sent).enumerate() {
        pipeline.take(packet, Arrival { time_s: START_S + time_s, moment: None });
        let tracks = &mut tracks[usize::from(i >= taken_over)];
        pipeline.answer(|object| {
            if !(taken_over..taken_over + 620).contains(&i) {
                tracks.insert(object.track);
            }
        });
    }
    assert_eq!(pipeline.counts().restarts, 2);
    assert!(tracks.iter().all(|tracks| !tracks.is_empty()));
    assert!(tracks[0].is_disjoint(&tracks[1]), "{tracks:?}");
}

/// The sensor drives through a static world, which moves relative to it.
#[test]
fn static_objects_stand_still_in_the_world() {
    // In the sensor's frame, static things move backwards.
    let things: Vec<_> =
        street()[..1].iter().map(|thing| Thing { velocity: [-4.0, 0.0], ..*thing }).collect();
    let sent = packets(&things, 5_000, 2 * PACKETS_PER_S);
    let mut options = all();
    let poses = [0.0, 10.0].map(|after_s| (START_S + after_s, Pose::at([4.0 * after_s, 0.0, 0.0])));
    options.ego_motion = Some(Trajectory::new(poses.to_vec()).unwrap());
    let objects = run(&mut pipeline(&options), on_time(&sent));
    let parked: Vec<_> =
        objects.iter().filter(|o| (o.position_m[0] - 8.0).abs() < 1.0 && o.turn > 5).collect();
    assert!(parked.len() >= 12, "{}", parked.len());
    for object in &parked {
        let [x, y, _] = object.velocity_m_s.unwrap();
        assert!(object.frame == "world" && x.hypot(y) < 0.5, "{object:?}");
    }
    let relative = run(&mut pipeline(&all()), on_time(&sent));
    let last = relative.iter().rfind(|object| object.velocity_m_s.is_some()).unwrap();
    assert!((last.velocity_m_s.unwrap()[0] + 4.0).abs() < 0.5, "{last:?}");
}

#[test]
fn clusters_of_few_points_have_no_class() {
    let sent = packets(&street(), 5_000, PACKETS_PER_S);
    let mut options = all();
    options.min_points = 1_000_000;
    let mut pipeline = pipeline(&options);
    let objects = run(&mut pipeline, on_time(&sent));
    assert!(objects.len() > 20);
    for object in &objects {
        assert_eq!((&object.class, object.confidence, object.probability), (&None, None, None));
    }
    let Counts { clusters, unclassified, .. } = *pipeline.counts();
    assert_eq!((clusters, unclassified), (objects.len() as u64, objects.len() as u64));
}

/// Only packets in a row without one of the sensor's tell that it is replaced.
#[test]
fn foreign_packets_among_those_of_the_sensor_replace_nothing() {
    let sent = packets(&street(), 5_000, 20);
    let mut stranger = sent[0];
    stranger[1205] = 0x28;
    let mut pipeline = pipeline(&all());
    for (since_s, packet) in on_time(&sent) {
        let arrival = Arrival { time_s: START_S + since_s, moment: None };
        pipeline.take(packet, arrival);
        (0..100).for_each(|_| pipeline.take(&stranger, arrival));
    }
    let Counts { packets, foreign, restarts, .. } = *pipeline.counts();
    assert_eq!((packets, foreign, restarts), (20, 2000, 0));
}
