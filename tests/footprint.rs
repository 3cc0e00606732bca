//! Wide beams, against closed forms and against very many rays: what a sensor measures at
//! edges, on slopes and of two surfaces at once. `sim_gpu::sensor` has the power at an edge, and
//! `combined_effects` which returns it tells.

use edgepuck_mesh::TriangleMesh;
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::DVec3;
use sim_gpu::effects::{Dropout, Effects, Footprint, Noise, NoiseModel, ReturnMode};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, Tally, scan_objects};
use sim_gpu::internals::sensor::{BeamPattern, SensorProfile};
use tests::{adapter, casting, meshes};

/// The beams' full angles along the horizon and across it, degrees.
const DIVERGENCE_DEG: [f64; 2] = [0.2, 0.1];

fn wide(samples: u32) -> Effects {
    let (divergence_deg, separation_m) = (Some(DIVERGENCE_DEG), Some(1.0));
    let footprint = Some(Footprint { samples, divergence_deg, separation_m });
    Effects { footprint, ..Effects::default() }
}

fn dual(samples: u32) -> Effects {
    Effects { returns: Some(ReturnMode::Dual), ..wide(samples) }
}

/// Level beams around the x axis, 0.001 degrees apart.
fn fan() -> BeamPattern {
    let direction = |i: i32| (f64::from(i) * 0.001).to_radians().sin_cos();
    casting::beams((-300..=300).map(|i| {
        let (sine, cosine) = direction(i);
        DVec3::new(cosine, sine, 0.0)
    }))
}

fn scan(caster: &OpenCaster, pattern: &BeamPattern, mesh: &TriangleMesh) -> (Scan, Tally) {
    let sensor = SensorProfile::builtin("vlp32c").unwrap();
    let pattern = caster.effects().widen(pattern.clone(), &sensor).unwrap();
    scan_as_is(caster, &pattern, mesh, None)
}

fn scan_as_is(
    caster: &OpenCaster,
    pattern: &BeamPattern,
    mesh: &TriangleMesh,
    effects: Option<Effects>,
) -> (Scan, Tally) {
    let sensor = SensorProfile::builtin("vlp32c").unwrap();
    let target = casting::target(mesh);
    let pose = Pose::look_at(DVec3::ZERO, DVec3::X).unwrap();
    let mut request = ScanRequest::new(&sensor, pattern, pose);
    request.attributes =
        [Attribute::Range, Attribute::Beam, Attribute::Power, Attribute::Return].into();
    request.stream = StreamKey([3, 5]);
    request.effects = effects;
    let scanned = scan_objects(caster, &[PlacedTarget::new(&target)], &request).unwrap();
    (scanned.scan, scanned.tally)
}

fn on_cpu(effects: &Effects, mesh: &TriangleMesh) -> Scan {
    scan(&OpenCaster::Cpu(effects.clone()), &fan(), mesh).0
}

fn ranges(scan: &Scan) -> Vec<f64> {
    scan.range_m.as_ref().unwrap().iter().map(|&range_m| range_m.into()).collect()
}

fn beams(scan: &Scan) -> &[u32] {
    scan.beam.as_ref().unwrap()
}

/// A plate across the x axis, `at_m` away, from y = `from_m` on to the left.
fn plate(at_m: f64, from_m: f64) -> TriangleMesh {
    let corner = |y, z| DVec3::new(at_m, y, z);
    let vertices =
        vec![corner(from_m, -9.0), corner(9.0, -9.0), corner(9.0, 9.0), corner(from_m, 9.0)];
    TriangleMesh { vertices, triangles: vec![[0, 2, 1], [0, 3, 2]] }
}

#[test]
fn one_ray_is_the_beam_without_width_to_the_bit() {
    let noise = Some(Noise { mean_m: 0.0, sigma_m: 0.02, model: NoiseModel::Range });
    let dropout = Some(Dropout { probability: 0.1 });
    let plain = Effects { noise, dropout, ..Effects::default() };
    let one = Effects { noise, dropout, ..dual(1) };
    let pattern = SensorProfile::builtin("vlp32c").unwrap().pattern();
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 5.0);
    for (plain, one) in adapter::casters(&plain).into_iter().zip(adapter::casters(&one)) {
        let (expected, found) = (scan(plain, &pattern, &mesh), scan(one, &pattern, &mesh));
        assert!(expected.0.len() > 1000);
        assert_eq!(found, expected, "{}", one.name());
    }
}

#[test]
fn the_clean_scan_of_wide_beams_is_that_of_their_centres() {
    let sensor = SensorProfile::builtin("vlp32c").unwrap();
    let mesh = meshes::mapped(&meshes::icosphere(3), |p| p * 5.0);
    let expected = scan(&OpenCaster::Cpu(Effects::default()), &sensor.pattern(), &mesh);
    let wide = wide(7);
    let pattern = wide.widen(sensor.pattern(), &sensor).unwrap();
    let clean = Some(wide.clean());
    assert_eq!(scan_as_is(&OpenCaster::Cpu(wide), &pattern, &mesh, clean), expected);
}

#[test]
fn a_slope_is_one_return_at_the_range_of_its_middle() {
    // y = (x - 10 m) / tan(60 degrees): 19 rays span 0.14 m of range.
    let tilt = 60f64.to_radians().tan();
    let mesh = meshes::mapped(&plate(0.0, -9.0), |p| DVec3::new(10.0 + p.y * tilt, p.y, p.z));
    let plain = on_cpu(&Effects::default(), &mesh);
    for samples in [7, 19, 37] {
        let wide = on_cpu(&dual(samples), &mesh);
        assert_eq!(beams(&wide), beams(&plain));
        for (found, expected) in ranges(&wide).into_iter().zip(ranges(&plain)) {
            // With s the tangent of a ray's angle the range is R / (1 - s tan), the power falls
            // with its cube (one over R^2, one cosine more). So the weighted mean is
            // R (1 - 2 <s^2> tan^2) to the second order, and <s^2> a quarter of the beam's radius.
            let s = (DIVERGENCE_DEG[0].to_radians() / 2.0).tan();
            let second = expected * 2.0 * 0.25 * s * s * tilt * tilt;
            assert!((found - expected).abs() < 1.2 * second + 2e-6, "{found}, not {expected}");
        }
    }
}

#[test]
fn surfaces_nearer_than_the_separation_are_one_return_between_them() {
    let edge = |behind_m: f64| meshes::together(&[plate(10.0, 0.0), plate(10.0 + behind_m, -9.0)]);
    let mixed = on_cpu(&dual(19), &edge(0.99));
    assert_eq!(mixed.len(), 601);
    let between = ranges(&mixed).into_iter().filter(|range_m| (10.05..10.9).contains(range_m));
    assert!(between.count() > 50);

    let apart = on_cpu(&dual(19), &edge(1.01));
    let ranges = ranges(&apart);
    assert!(apart.len() > 650);
    assert!(ranges.iter().all(|r| (r - 10.0).abs() < 1e-3 || (r - 11.01).abs() < 1e-3));
    for (pair, number) in beams(&apart).windows(2).zip(apart.return_number.as_ref().unwrap()) {
        assert!(pair[0] < pair[1] || *number == 1, "the nearer of two comes first");
    }
}

#[test]
fn thirty_seven_rays_measure_what_a_hundred_thousand_do() {
    // Columns that a beam is as wide as, before a wall too near to be told from them.
    let columns = (-20..20).map(|i| f64::from(i) * 0.07).fold(plate(10.6, -9.0), |mesh, y_m| {
        let low = DVec3::new(10.0, y_m, -9.0);
        meshes::together(&[mesh, meshes::cuboid(low, low + DVec3::new(0.1, 0.03, 18.0))])
    });
    let beam = DVec3::new(1.0, 0.012, 0.003).normalize();
    let across = DVec3::Z.cross(beam).normalize();
    let up = beam.cross(across);
    let [half_wide, half_high] = DIVERGENCE_DEG.map(|deg| (deg.to_radians() / 2.0).tan());
    let stream = StreamKey([1, 2]);
    // Box and Muller's deviates: a Gaussian beam's standard deviation is half its 1/e^2 radius.
    let rays = (0..100_000).map(|i| {
        let radius = (-2.0 * (1.0 - stream.unit(2 * i)).ln()).sqrt();
        let (sine, cosine) = (std::f64::consts::TAU * stream.unit(2 * i + 1)).sin_cos();
        beam + across * (radius * cosine * half_wide / 2.0) + up * (radius * sine * half_high / 2.0)
    });
    let many = scan(&OpenCaster::Cpu(Effects::default()), &casting::beams(rays), &columns).0;
    let powers: Vec<f64> = many.power.as_ref().unwrap().iter().map(|&p| p.into()).collect();
    let power = powers.iter().sum::<f64>() / 1e5;
    let range_m = powers.iter().zip(ranges(&many)).map(|(p, r)| p * r).sum::<f64>()
        / powers.iter().sum::<f64>();

    let one = scan(&OpenCaster::Cpu(wide(37)), &casting::beams([beam]), &columns).0;
    assert_eq!(one.len(), 1);
    // Each edge may move 0.06 of the power (sensor/footprint.rs) from one surface to the other, which
    // lies 6 % farther away; two edges lie within the beam's radius of 17 mm.
    let found = f64::from(one.power.as_ref().unwrap()[0]);
    assert!((found / power - 1.0).abs() < 2.0 * 0.06 * 0.12, "{found}, not {power}");
    let found_m = ranges(&one)[0];
    assert!((found_m - range_m).abs() < 2.0 * 0.06 * 0.6, "{found_m} m, not {range_m} m");
}
