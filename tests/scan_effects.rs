//! What a scan makes of hits: range limits, noise and rings. `combined_effects` has the rest.

use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::DVec3;
use sim_gpu::effects::{Dropout, Effects, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
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
    let mut request =
        ScanRequest::new(sensor, &pattern, Pose::look_at(SENSOR, DVec3::ZERO).unwrap());
    request.attributes = [Attribute::Range, Attribute::Beam].into();
    request.stream = STREAM;
    let scanned = scan_objects(caster, &[PlacedTarget::new(&target)], &request).unwrap();
    (scanned.scan, scanned.tally)
}

fn vlp32c() -> SensorProfile {
    SensorProfile::builtin("vlp32c").unwrap()
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
}
