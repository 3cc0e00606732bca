mod capture;

use std::fs;

use capture::{Block, Packet};
use formats::hash::Hashing;
use formats::velodyne::count_returns;
use formats::vlp32c::{FARTHEST_M, Returns, Revolution, START_S, write};
use formats::{FormatError, Scan};
use proptest::prelude::*;

/// 600 revolutions a minute: 1808 whole sequences and 14 beams.
const REVOLUTION: Revolution = Revolution { rpm: 600.0, n_beams: 57_870 };

fn scan(returned: &[(u32, f32)]) -> Scan {
    Scan {
        positions: vec![[0.0; 3]; returned.len()],
        beam: Some(returned.iter().map(|r| r.0).collect()),
        range_m: Some(returned.iter().map(|r| r.1).collect()),
        ..Scan::default()
    }
}

fn every_beam() -> Scan {
    scan(&(0..REVOLUTION.n_beams).map(|beam| (beam, 1.0 + beam as f32 * 1e-3)).collect::<Vec<_>>())
}

/// What is in the file of `scan`, after its returns were counted.
fn written(revolution: &Revolution, returns: Returns, scan: &Scan) -> (Vec<Packet>, u64) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.pcap");
    write(&path, Hashing::None, revolution, returns, scan).unwrap();
    (capture::parse(&fs::read(&path).unwrap()), count_returns(&path).unwrap())
}

/// The blocks of one return of each sequence, in order.
fn sequences(packets: &[Packet], returns: Returns) -> Vec<&Block> {
    let step = if returns == Returns::Dual { 2 } else { 1 };
    packets.iter().flat_map(|packet| packet.blocks.iter().step_by(step)).collect()
}

#[test]
fn a_revolution_without_a_return_is_sent_all_the_same() {
    for (returns, n_packets, mode) in
        [(Returns::Strongest, 151, 0x37), (Returns::Last, 151, 0x38), (Returns::Dual, 302, 0x39)]
    {
        let (packets, count) = written(&REVOLUTION, returns, &scan(&[]));
        assert_eq!((packets.len(), count), (n_packets, 0));
        assert!(packets.iter().all(|packet| packet.mode == mode && packet.model == 0x28));
        let blocks = packets.iter().flat_map(|packet| &packet.blocks);
        assert!(blocks.flat_map(|block| block.measured).all(|measured| measured == (0, 0)));
    }
}

#[test]
fn every_beam_has_its_place_and_the_last_packet_is_filled_up() {
    let (packets, count) = written(&REVOLUTION, Returns::Strongest, &every_beam());
    assert_eq!(count, u64::from(REVOLUTION.n_beams));
    let sequences = sequences(&packets, Returns::Strongest);
    assert_eq!(sequences.len(), 1812, "1809 sequences fill 151 packets but for three");
    for (sequence, block) in sequences.iter().enumerate() {
        for (laser, &(distance, reflectivity)) in block.measured.iter().enumerate() {
            let beam = sequence * 32 + laser;
            if beam < REVOLUTION.n_beams as usize {
                let range_m = 1.0 + beam as f64 * 1e-3;
                // Half a unit, and f32 holds 64 m to 3.8e-6 m.
                assert!((f64::from(distance) * 0.004 - range_m).abs() <= 0.002 + 4e-6);
                assert_eq!(reflectivity, 100, "without intensity, white");
            } else {
                assert_eq!((distance, reflectivity), (0, 0), "beam {beam} was not fired");
            }
        }
    }
}

#[test]
fn both_returns_of_a_beam_are_the_same_in_blocks_of_one_azimuth() {
    let (single, _) = written(&REVOLUTION, Returns::Strongest, &every_beam());
    let (dual, count) = written(&REVOLUTION, Returns::Dual, &every_beam());
    assert_eq!(count, u64::from(REVOLUTION.n_beams), "two returns of a beam count once");
    for packet in &dual {
        for pair in packet.blocks.chunks(2) {
            assert_eq!(pair[0], pair[1]);
        }
    }
    assert_eq!(sequences(&dual, Returns::Dual), sequences(&single, Returns::Strongest));
}

#[test]
fn even_blocks_hold_the_farther_of_two_returns() {
    let scan = scan(&[(33, 5.0), (33, 7.0), (34, 6.0)]);
    let (packets, count) = written(&REVOLUTION, Returns::Dual, &scan);
    assert_eq!(count, 2, "two returns of a beam count once");
    let [last, other] = [2, 3].map(|block: usize| &packets[0].blocks[block].measured);
    assert_eq!([last[1].0, last[2].0, last[3].0], [1750, 1500, 0]);
    assert_eq!([other[1].0, other[2].0, other[3].0], [1250, 1500, 0]);
}

#[test]
fn azimuths_run_clockwise_and_past_360_degrees() {
    let (packets, _) = written(&REVOLUTION, Returns::Strongest, &scan(&[]));
    let azimuths: Vec<f64> = sequences(&packets, Returns::Strongest)
        .iter()
        .map(|block| f64::from(block.azimuth))
        .collect();
    assert_eq!(azimuths[0], 0.0);
    assert!(azimuths.iter().all(|&azimuth| azimuth < 36_000.0));
    for (sequence, azimuth) in azimuths.iter().enumerate() {
        // 55.296 us of 0.1 s, in 0.01 degree.
        let turned: f64 = sequence as f64 * 19.90656;
        let off = (azimuth - turned).rem_euclid(36_000.0);
        assert!(off.min(36_000.0 - off) <= 0.5 + 1e-9, "sequence {sequence} at {azimuth}");
    }
    assert_eq!(azimuths.windows(2).filter(|pair| pair[1] < pair[0]).count(), 1, "one wrap");
}

#[test]
fn packets_follow_each_other_in_time() {
    for (returns, interval_us) in [(Returns::Strongest, 663.552), (Returns::Dual, 331.776)] {
        let (packets, _) = written(&REVOLUTION, returns, &scan(&[]));
        for (number, packet) in packets.iter().enumerate() {
            let expected_us = number as f64 * interval_us;
            assert!((f64::from(packet.past_hour_us) - expected_us).abs() <= 0.5);
            assert_eq!(packet.captured_us, packet.past_hour_us, "captured as it was fired");
            assert_eq!(packet.captured_s, START_S, "a revolution takes less than a second");
        }
    }
    assert_eq!(START_S % 3600, 0, "so that time past the hour is time since the start");
}

#[test]
fn a_range_that_no_packet_can_tell_is_no_return() {
    let farthest = FARTHEST_M as f32;
    for (range_m, distance) in [
        (f32::NAN, 0),
        (f32::INFINITY, 0),
        (f32::NEG_INFINITY, 0),
        (-1.0, 0),
        (-0.0, 0),
        (0.0019, 0),
        (0.0021, 1),
        (farthest, 65535),
        (farthest + 0.0015, 65535),
        (farthest + 0.0025, 0),
        (f32::MAX, 0),
        (f32::MIN_POSITIVE, 0),
    ] {
        let (packets, count) = written(&REVOLUTION, Returns::Strongest, &scan(&[(33, range_m)]));
        assert_eq!(packets[0].blocks[1].measured[1].0, distance, "{range_m}");
        assert_eq!(count, u64::from(distance > 0), "{range_m}");
    }
}

#[test]
fn intensity_is_the_share_of_light_in_percent() {
    for (intensity, reflectivity) in [
        (0.0, 0),
        (0.004, 0),
        (0.006, 1),
        (0.5, 50),
        (1.0, 100),
        (2.0, 100),
        (-1.0, 0),
        (f32::NAN, 0),
    ] {
        let scan = Scan { intensity: Some(vec![intensity]), ..scan(&[(0, 5.0)]) };
        let (packets, _) = written(&REVOLUTION, Returns::Strongest, &scan);
        assert_eq!(packets[0].blocks[0].measured[0], (1250, reflectivity), "{intensity}");
    }
}

#[test]
fn a_scan_that_says_too_little_or_too_much_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.pcap");
    let whole = scan(&[(0, 5.0)]);
    for (scan, part) in [
        (
            Scan { beam: None, ..whole.clone() },
            "attribute beam: expected 1 values, one for each point, found 0",
        ),
        (
            Scan { range_m: None, ..whole.clone() },
            "attribute range: expected 1 values, one for each point, found 0",
        ),
        (
            Scan { beam: Some(vec![1, 2]), ..whole.clone() },
            "attribute beam: expected 1 values, one for each point, found 2",
        ),
        (Scan { beam: Some(vec![57_870]), ..whole.clone() }, "beam: 57870 of 57870"),
        (scan(&[(5, 1.0), (5, 2.0), (5, 3.0)]), "beam: 5 has more points than the 2 of"),
    ] {
        let error: FormatError =
            write(&path, Hashing::None, &REVOLUTION, Returns::Dual, &scan).unwrap_err();
        assert!(error.to_string().contains(part), "{error}");
        assert!(!path.exists());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn written_returns_are_found(
        rpm in 300.0..=1200.0f64,
        which in 0usize..3,
        returned in prop::collection::btree_map(0u32..28_000, 0.01f32..262.0, 0..200),
    ) {
        let returns = Returns::ALL[which];
        let n_beams = (32.0 * 60e6 / (rpm * 55.296)) as u32;
        let revolution = Revolution { rpm, n_beams };
        let returned: Vec<(u32, f32)> = returned.into_iter().collect();
        let (packets, count) = written(&revolution, returns, &scan(&returned));
        prop_assert_eq!(count, returned.len() as u64);
        let mut found = Vec::new();
        for (sequence, block) in sequences(&packets, returns).iter().enumerate() {
            let turned = sequence as f64 * 55.296e-6 * rpm / 60.0 * 36_000.0;
            let off = (f64::from(block.azimuth) - turned).rem_euclid(36_000.0);
            prop_assert!(off.min(36_000.0 - off) <= 0.5 + 1e-9);
            for (laser, &(distance, _)) in block.measured.iter().enumerate() {
                if distance > 0 {
                    found.push(((sequence * 32 + laser) as u32, f64::from(distance) * 0.004));
                }
            }
        }
        prop_assert_eq!(found.len(), returned.len());
        for ((beam, range_m), (expected, expected_m)) in found.into_iter().zip(returned) {
            prop_assert_eq!(beam, expected);
            // Half a unit, and f64's rounding of both products.
            prop_assert!((range_m - f64::from(expected_m)).abs() <= 0.002 + 1e-12);
        }
    }
}
