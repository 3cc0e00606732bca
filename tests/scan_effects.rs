//! What a scan makes of hits: range limits, noise, dropout, quantisation,
//! intensity, normals, recipes. On every caster.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::{DAffine3, DVec3};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::TriangleMesh;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, Tally, scan_objects};
use sim_gpu::internals::sensor::SensorProfile;
use tests::{adapter, casting, meshes};

const STREAM: StreamKey = StreamKey([7, 11]);

const SENSOR: DVec3 = DVec3::new(3.0, 0.0, 0.0);

/// What `sensor` measures of a unit sphere with all effects of `caster`.
fn scan(caster: &OpenCaster, sensor: &SensorProfile) -> (Scan, Tally) {
    let pattern = sensor.pattern();
    let target = casting::target(&meshes::icosphere(4));
    let mut placed = PlacedTarget::new(&target);
    placed.reflectivity = 0.5;
    let mut request =
        ScanRequest::new(sensor, &pattern, Pose::look_at(SENSOR, DVec3::ZERO).unwrap());
    request.attributes = [Attribute::Range, Attribute::Beam, Attribute::Normal].into();
    request.attributes.extend(caster.effects().intensity.map(|_| Attribute::Intensity));
    request.stream = STREAM;
    let scanned = scan_objects(caster, &[placed], &request).unwrap();
    (scanned.scan, scanned.tally)
}

/// A square that is four times as wide and high as its mesh faces the sensor: the cosine of the incidence
/// is that of the beam and the x axis.
#[test]
fn an_uneven_scale_changes_no_angle() {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[y, z]| DVec3::new(0.0, y, z)).to_vec();
    let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] };
    let (target, sensor) = (casting::target(&mesh), vlp32c());
    let pattern = sensor.pattern();
    let mut placed = PlacedTarget::new(&target);
    placed.world_from_object = DAffine3::from_scale(DVec3::new(1.0, 4.0, 4.0));
    placed.reflectivity = 0.5;
    let pose = Pose::look_at(SENSOR, DVec3::ZERO).unwrap();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    request.attributes = [Attribute::Intensity].into();
    let effects = Effects { intensity: Some(Intensity), ..Effects::default() };
    for caster in adapter::casters(&effects) {
        let scan = scan_objects(caster, &[placed.clone()], &request).unwrap().scan;
        assert!(scan.positions.len() > 1000);
        for (point, intensity) in scan.positions.iter().zip(scan.intensity.unwrap()) {
            let expected = 0.5 * from_sensor(point).normalize().x.abs();
            // Both are rounded to f32, whose ulp is 2^-24 or less of 1.
            assert!((f64::from(intensity) - expected).abs() < 3e-7, "{intensity} for {expected}");
        }
    }
}

fn vlp32c() -> SensorProfile {
    SensorProfile::builtin("vlp32c").unwrap()
}

fn on_cpu(effects: &Effects) -> (Scan, Tally) {
    scan(&OpenCaster::Cpu(effects.clone()), &vlp32c())
}

fn from_sensor(point: &[f32; 3]) -> DVec3 {
    DVec3::from_array(point.map(f64::from)) - SENSOR
}

fn noise(sigma_m: f64, model: NoiseModel) -> Effects {
    Effects { noise: Some(Noise { mean_m: 0.0, sigma_m, model }), ..Effects::default() }
}

/// Each caster that there is, opened for `effects`, its scan beside the clean.
fn on_each(effects: &Effects, check: impl Fn(&(Scan, Tally), &(Scan, Tally))) {
    let plain = Effects::default();
    for (clean, noisy) in adapter::casters(&plain).into_iter().zip(adapter::casters(effects)) {
        check(&scan(clean, &vlp32c()), &scan(noisy, &vlp32c()));
    }
}

fn ranges(scan: &Scan) -> Vec<f64> {
    scan.range_m.as_ref().unwrap().iter().map(|&range| f64::from(range)).collect()
}

#[test]
fn a_sensor_sees_nothing_outside_its_range() {
    let caster = OpenCaster::Cpu(Effects::default());
    let everything = scan(&caster, &vlp32c()).1.points;
    let mut near = vlp32c();
    near.range.min_m = 2.2;
    let mut far = vlp32c();
    far.range.max_m = 2.2;
    let (near, near_tally) = scan(&caster, &near);
    let (far, far_tally) = scan(&caster, &far);
    // f32 holds 2.2 m to 1.2e-7 m.
    assert!(ranges(&near).iter().all(|&range| range >= 2.2 - 2e-7));
    assert!(ranges(&far).iter().all(|&range| range <= 2.2 + 2e-7));
    assert!(near_tally.points > 0 && far_tally.points > 0);
    assert_eq!(near_tally.points + far_tally.points, everything);
    assert_eq!(near_tally.out_of_range, far_tally.points);
}

#[test]
fn noise_of_no_width_changes_nothing() {
    on_each(&noise(0.0, NoiseModel::Range), |(clean, _), (noisy, _)| assert_eq!(clean, noisy));
    on_each(&noise(0.0, NoiseModel::Xyz), |(clean, _), (noisy, _)| assert_eq!(clean, noisy));
}

#[test]
fn a_micrometre_of_noise_is_a_micrometre() {
    on_each(&noise(1e-6, NoiseModel::Range), |(clean, _), (noisy, _)| {
        assert_eq!(clean.len(), noisy.len());
        let errors = ranges(clean).into_iter().zip(ranges(noisy)).map(|(p, q)| q - p);
        let errors: Vec<f64> = errors.collect();
        let mean_square = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        // Ranges of 2 to 3 m are stored to 1.2e-7 m: a tenth more at most.
        assert!((0.9e-6..1.1e-6).contains(&mean_square.sqrt()), "{}", mean_square.sqrt());
    });
}

#[test]
fn a_range_that_noise_makes_negative_is_dropped_and_counted() {
    on_each(&noise(1e3, NoiseModel::Range), |(clean, tally), (noisy, noisy_tally)| {
        assert_eq!(noisy_tally.points + noisy_tally.negative, tally.points);
        assert!(ranges(noisy).iter().all(|&range| range > 0.0));
        // Half of them, within five standard errors of a fair coin.
        let n = clean.len() as f64;
        let share = noisy_tally.negative as f64 / n;
        assert!((share - 0.5).abs() < 5.0 * 0.5 / n.sqrt(), "{share}");
    });
}

#[test]
fn noise_along_the_ray_stays_on_it_and_pointwise_noise_does_not() {
    let sideways = |model: NoiseModel| {
        let [(clean, _), (noisy, _)] =
            [Effects::default(), noise(0.01, model)].each_ref().map(on_cpu);
        let pairs = clean.positions.iter().zip(&noisy.positions);
        pairs.map(|(p, q)| from_sensor(q).reject_from(from_sensor(p)).length()).fold(0.0, f64::max)
    };
    // Positions below 4 m are stored to 2.4e-7 m in each of three coordinates.
    assert!(sideways(NoiseModel::Range) < 1e-6);
    assert!(sideways(NoiseModel::Xyz) > 0.01);
}

#[test]
fn dropout_loses_its_share_and_all_casters_lose_the_same() {
    let effects = Effects { dropout: Some(Dropout { probability: 0.3 }), ..Effects::default() };
    let mut survivors = Vec::new();
    for caster in adapter::casters(&effects) {
        let (scan, tally) = scan(caster, &vlp32c());
        let n = (tally.points + tally.dropped) as f64;
        let share = tally.dropped as f64 / n;
        // Five standard errors of a binomial share.
        assert!((share - 0.3).abs() < 5.0 * (0.3 * 0.7 / n).sqrt(), "{share}");
        survivors.push(scan.beam);
    }
    assert!(survivors.windows(2).all(|pair| pair[0] == pair[1]));
    for (probability, left) in [(0.0, true), (1.0, false)] {
        let effects = Effects { dropout: Some(Dropout { probability }), ..Effects::default() };
        let (scan, _) = on_cpu(&effects);
        assert_eq!(!scan.is_empty(), left, "{probability}");
    }
}

#[test]
fn intensity_is_the_cosine_of_incidence_times_reflectivity() {
    let effects = Effects { intensity: Some(Intensity), ..Effects::default() };
    for caster in adapter::casters(&effects) {
        let (scan, _) = scan(caster, &vlp32c());
        let normals = scan.normal.as_ref().unwrap();
        let intensities = scan.intensity.as_ref().unwrap();
        for ((position, normal), intensity) in scan.positions.iter().zip(normals).zip(intensities) {
            let normal = DVec3::from_array(normal.map(f64::from)).normalize();
            let cosine = -normal.dot(from_sensor(position).normalize());
            assert!(cosine > 0.0, "normals look at the sensor");
            // Corners rounded to 2^-24 of edges near 0.07 turn a facet by up to
            // 2e-6 rad; position and normal in f32 add 4e-7.
            assert!((f64::from(*intensity) - 0.5 * cosine).abs() < 5e-6);
        }
    }
}

#[test]
fn modelnet40c_gives_768_points_on_rings_a_degree_apart() {
    let sensor = SensorProfile::builtin("modelnet40c-lidar").unwrap();
    let (scan, _) = scan(&OpenCaster::Cpu(Effects::default()), &sensor);
    assert_eq!(scan.len(), 768);
    let mut polar_deg: Vec<f64> = scan
        .positions
        .iter()
        .map(from_sensor)
        .map(|v| v.truncate().length().atan2(v.z).to_degrees())
        .collect();
    polar_deg.sort_by(f64::total_cmp);
    for pair in polar_deg.windows(2) {
        let steps = pair[1] - pair[0];
        // Positions are stored to 2.4e-7 m at 2 m or more: 1e-5 degrees.
        assert!((steps - steps.round()).abs() < 2e-5, "{steps}");
    }
}
