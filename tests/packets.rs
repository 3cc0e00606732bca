//! A scan's packets decode to its points. On every caster.

use std::num::NonZeroU32;

use edgepuck_mesh::TriangleMesh;
use formats::Scan;
use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::scan::Attribute;
use formats::vlp32c::{BEAM_CROSSING_M, Returns, Revolution, write};
use glam::{DQuat, DVec3};
use sim_gpu::effects::{Effects, Noise, NoiseModel, ReturnMode};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::packets::{returns, revolution, with_packet_geometry};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::ScanRequest;
use sim_gpu::internals::sensor::{Layout, Rotating, SensorProfile};
use tests::{adapter, casting, judge, meshes};

const STREAM: StreamKey = StreamKey([3, 5]);

fn vlp32c() -> SensorProfile {
    SensorProfile::builtin("vlp32c").unwrap()
}

fn head_of(sensor: &mut SensorProfile) -> &mut Rotating {
    let Layout::Rotating(rotating) = &mut sensor.layout else { panic!("it turns") };
    rotating
}

fn turning(rpm: f64) -> SensorProfile {
    let mut sensor = vlp32c();
    head_of(&mut sensor).rpm = rpm;
    with_packet_geometry(&sensor).unwrap()
}

/// A sensor that sees the world's origin some 16 degrees below its plane, where
/// beams start beside it, and across azimuth 0.
fn pose(distance_m: f64) -> Pose {
    let looking = Pose::look_at(DVec3::new(distance_m, 0.3, 0.2), DVec3::ZERO).unwrap();
    let tilted = DQuat::from_rotation_y(-0.3) * DQuat::from_rotation_x(0.2);
    Pose { rotation: looking.rotation * tilted, ..looking }
}

fn scan(caster: &OpenCaster, sensor: &SensorProfile, mesh: &TriangleMesh, pose: &Pose) -> Scan {
    let pattern = sensor.pattern();
    let target = casting::target(mesh);
    let mut request = ScanRequest::new(sensor, &pattern, *pose);
    request.attributes = [Attribute::Range, Attribute::Beam].into();
    request.stream = STREAM;
    sim_gpu::internals::scan::scan(caster, &target, &request).unwrap()
}

/// A point from a packet: azimuth clockwise and elevation in degrees, range in
/// metres from where the beam starts.
struct Decoded {
    beam: usize,
    azimuth_deg: f64,
    range_m: f64,
    point: DVec3,
}

/// Decodes a capture by the formulas of `formats::vlp32c`, as drivers do: with
/// the rate of turning from the packet's own azimuths, rounded to 0.01 degree.
fn decode(capture: &[u8], returns: Returns, head: &Rotating) -> Vec<Decoded> {
    let copies = if returns == Returns::Dual { 2 } else { 1 };
    let mut decoded = Vec::new();
    for (number, record) in capture[24..].chunks_exact(16 + 1248).enumerate() {
        let blocks: Vec<&[u8]> = record[16 + 42..].chunks_exact(100).take(12).collect();
        let azimuth = |block: &[u8]| f64::from(u16::from_le_bytes([block[2], block[3]]));
        let turned = (azimuth(blocks[11]) - azimuth(blocks[0])).rem_euclid(36_000.0);
        let rate = turned / (55.296 * (12 / copies - 1) as f64);
        for (i, block) in blocks.iter().enumerate().step_by(copies) {
            for (laser, measured) in block[4..].chunks_exact(3).enumerate() {
                let distance = u16::from_le_bytes([measured[0], measured[1]]);
                if distance == 0 {
                    continue;
                }
                let at_us = 2.304 * (laser / 2) as f64;
                let units = (azimuth(block) + rate * at_us).round();
                let beam = (number * 12 / copies + i / copies) * 32 + laser;
                let azimuth_deg = units * 0.01 - head.beam[laser].azimuth_offset_deg;
                let range_m = f64::from(distance) * 0.004;
                let (sin, cos) = azimuth_deg.to_radians().sin_cos();
                let elevation_rad = head.beam[laser].elevation_deg.to_radians();
                let across = range_m * elevation_rad.cos();
                let z = range_m * elevation_rad.sin() - BEAM_CROSSING_M * elevation_rad.tan();
                let point = DVec3::new(across * cos, -across * sin, z);
                decoded.push(Decoded { beam, azimuth_deg, range_m, point });
            }
        }
    }
    decoded
}

fn packets_of(sensor: &SensorProfile, returns: Returns, scan: &Scan) -> Vec<Decoded> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.pcap");
    write(&path, Hashing::None, &revolution(sensor).unwrap(), returns, scan).unwrap();
    decode(&std::fs::read(&path).unwrap(), returns, head_of(&mut sensor.clone()))
}

fn in_sensor<'a>(scan: &'a Scan, pose: &'a Pose) -> impl Iterator<Item = DVec3> + 'a {
    let sensor_from_world = pose.rotation.inverse();
    scan.positions
        .iter()
        .map(move |p| sensor_from_world * (DVec3::from_array(p.map(f64::from)) - pose.position_m))
}

fn degrees_apart(a: f64, b: f64) -> f64 {
    let apart = (a - b).rem_euclid(360.0);
    apart.min(360.0 - apart)
}

#[test]
fn packets_decode_to_the_points_of_the_scan() {
    let mesh = meshes::icosphere(3);
    for caster in adapter::casters(&Effects::default()) {
        for (rpm, returns) in
            [(300.0, Returns::Dual), (600.0, Returns::Strongest), (1200.0, Returns::Last)]
        {
            let (sensor, pose) = (turning(rpm), pose(3.0));
            let scan = scan(caster, &sensor, &mesh, &pose);
            let decoded = packets_of(&sensor, returns, &scan);
            assert!(scan.len() > 1000, "{}", scan.len());
            assert_eq!(decoded.len(), scan.len());
            let points = in_sensor(&scan, &pose);
            for (i, (point, decoded)) in points.zip(&decoded).enumerate() {
                assert_eq!(decoded.beam, scan.beam.as_ref().unwrap()[i] as usize);
                let range_m = f64::from(scan.range_m.as_ref().unwrap()[i]);
                // Half a unit; f32 holds 4 m to 2.4e-7 m.
                assert!((decoded.range_m - range_m).abs() <= 0.002 + 3e-7);
                // Half a unit and an eighth of one (`formats::vlp32c`); positions of
                // 2.4e-7 m at 1 m from the axis and more are 3e-5 degrees.
                let azimuth_deg = -point.y.atan2(point.x).to_degrees();
                let off_deg = degrees_apart(decoded.azimuth_deg, azimuth_deg);
                assert!(off_deg <= 0.00625 + 3e-5, "{off_deg}");
                // Both together: along the beam and across it.
                let across_m = 0.00628f64.to_radians() * range_m;
                assert!(decoded.point.distance(point) <= 0.002f64.hypot(across_m) + 1e-6);
            }
        }
    }
}

#[test]
fn the_oracle_agrees_on_beams_that_start_beside_the_sensor() {
    let (sensor, pose) = (turning(600.0), pose(3.0));
    let pattern = sensor.pattern();
    let target = casting::target(&meshes::icosphere(3));
    let job = casting::job(&target, &pose, &pattern);
    for caster in adapter::casters(&Effects::default()) {
        let verdict = judge::judge(&job, &pattern, &casting::hits(caster, &job, &pattern));
        assert!(verdict.hits > 1000 && verdict.broken.is_empty(), "{verdict:?}");
    }
}

#[test]
fn a_sensor_that_packets_cannot_tell_is_refused() {
    type Change = fn(&mut SensorProfile);
    let changes: [(Change, &str); 10] = [
        (|s| head_of(s).beam[7].elevation_deg += 0.001, "rotating.beam[7]: expected laser 7"),
        (|s| head_of(s).beam[7].azimuth_offset_deg = 0.0, "rotating.beam[7]: expected laser 7"),
        (|s| head_of(s).beam.swap(0, 1), "rotating.beam[0]: expected laser 0"),
        (|s| head_of(s).beam.truncate(31), "rotating.beam: expected 32 beams, found 31"),
        (|s| head_of(s).sequence_us = 60.0, "rotating.sequence_us: expected 55.296, found 60"),
        (|s| head_of(s).rpm = 299.0, "rotating.rpm: expected a number within 300..=1200"),
        (|s| head_of(s).beam_crossing_m = Some(0.0), "beam_crossing_m: expected 0.0424, found 0"),
        (|s| head_of(s).sequence_quantum_deg = Some(0.1), "sequence_quantum_deg: expected 0.01"),
        (|s| s.decimation = NonZeroU32::new(2).unwrap(), "decimation"),
        (|s| s.range.max_m = 263.0, "range.max_m: expected a number within 0..=262.14"),
    ];
    for (change, key) in changes {
        let mut sensor = vlp32c();
        change(&mut sensor);
        let error = with_packet_geometry(&sensor).unwrap_err().to_string();
        assert!(error.contains(key), "{key}: {error}");
    }
    let error = revolution(&vlp32c()).unwrap_err().to_string();
    assert!(error.contains("rotating.beam_crossing_m: expected 0.0424, found none"), "{error}");
    let noise = Noise { mean_m: 0.0, sigma_m: 0.01, model: NoiseModel::Xyz };
    let error = returns(&Effects { noise: Some(noise), ..Effects::default() }, None).unwrap_err();
    assert!(error.to_string().starts_with("effects.noise.model: "), "{error}");
    let mode = |mode| Effects { returns: Some(mode), ..Effects::default() };
    let error = returns(&mode(ReturnMode::First), None).unwrap_err().to_string();
    assert!(error.starts_with("effects.returns: \"first\" is not among theirs; "), "{error}");
    let error = returns(&mode(ReturnMode::Dual), Some(Returns::Last)).unwrap_err().to_string();
    assert!(error.starts_with("effects.returns: expected the returns"), "{error}");
    assert_eq!(returns(&mode(ReturnMode::Dual), None), Ok(Returns::Dual));
}

#[test]
fn beams_may_stand_in_any_order_that_fires_alike() {
    let mut sensor = vlp32c();
    head_of(&mut sensor).beam.rotate_left(8);
    let sensor = with_packet_geometry(&sensor).unwrap();
    let expected = Revolution { rpm: 600.0, n_beams: 57_870 };
    assert_eq!(revolution(&sensor).unwrap(), expected);
    assert_eq!(sensor.pattern(), turning(600.0).pattern());
}
