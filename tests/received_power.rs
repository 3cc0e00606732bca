//! What a sensor receives of a surface, against closed forms: calibrated reflectivity, the detection
//! limit. `combined_effects` has power and intensity at every incidence.

use edgepuck_mesh::TriangleMesh;
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use glam::{DAffine3, DVec3};
use sim_gpu::Scene;
use sim_gpu::effects::{Detection, Effects, Intensity};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, Tally, scan_objects};
use sim_gpu::internals::sensor::{DetectionLimit, SensorProfile};
use std::fs;
use tests::{adapter, casting, meshes};

const WALL_M: f64 = 10.0;

/// A surface, from a sensor at the origin.
struct Seen {
    mesh: TriangleMesh,
    world_from_object: DAffine3,
    reflectivity: f32,
    retroreflection: f64,
}

impl Seen {
    fn new(mesh: TriangleMesh) -> Self {
        let world_from_object = DAffine3::IDENTITY;
        Self { mesh, world_from_object, reflectivity: 1.0, retroreflection: 0.0 }
    }

    fn wall(reflectivity: f32) -> Self {
        let low = DVec3::new(WALL_M, -60.0, -20.0);
        let mesh = meshes::cuboid(low, DVec3::new(WALL_M + 1.0, 60.0, 20.0));
        Self { reflectivity, ..Self::new(mesh) }
    }

    /// The inside of a ball around the sensor, which has nearly one range and faces it.
    fn ball() -> Self {
        Self::new(meshes::mapped(&meshes::icosphere(5), |p| p * WALL_M))
    }

    fn scan(&self, caster: &OpenCaster) -> (Scan, Tally) {
        let target = casting::target(&self.mesh);
        let mut placed = PlacedTarget::new(&target);
        placed.world_from_object = self.world_from_object;
        (placed.reflectivity, placed.retroreflection) = (self.reflectivity, self.retroreflection);
        let sensor = SensorProfile::builtin("vlp32c").unwrap();
        let pattern = sensor.pattern();
        let pose = Pose::look_at(DVec3::ZERO, DVec3::X).unwrap();
        let mut request = ScanRequest::new(&sensor, &pattern, pose);
        request.attributes = [
            Attribute::Range,
            Attribute::Beam,
            Attribute::Normal,
            Attribute::Power,
            Attribute::Reflectivity,
        ]
        .into();
        request.attributes.extend(caster.effects().intensity.map(|_| Attribute::Intensity));
        request.stream = StreamKey([3, 5]);
        let scanned = scan_objects(caster, &[placed], &request).unwrap();
        (scanned.scan, scanned.tally)
    }

    fn on_cpu(&self, detection: Option<Detection>) -> (Scan, Tally) {
        self.scan(&OpenCaster::Cpu(Effects { detection, ..Effects::default() }))
    }
}

fn detection(reflectivity: f64, range_m: f64) -> Detection {
    let limit = Some(DetectionLimit { reflectivity, range_m });
    Detection { limit, threshold_to_noise: None, range_sigma_m: None }
}

fn ranges(scan: &Scan) -> Vec<f64> {
    scan.range_m.as_ref().unwrap().iter().map(|&range_m| range_m.into()).collect()
}

#[test]
fn incidence_is_that_in_the_world_however_an_object_is_scaled() {
    // A plane through the x axis' point WALL_M, tilted by 45 degrees before it is stretched.
    let corners = [[1.0, -1.0], [1.0, 1.0], [-1.0, -1.0], [-1.0, 1.0]];
    let vertices = corners.map(|[up, side]| DVec3::new(up, 20.0 * side, up)).to_vec();
    let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [1, 3, 2]] };
    let placed = DAffine3::from_translation(DVec3::X * WALL_M);
    let stretched = placed * DAffine3::from_scale(DVec3::new(1.0, 1.0, 4.0));
    let effects = Effects { intensity: Some(Intensity), ..Effects::default() };
    let seen = Seen { world_from_object: stretched, reflectivity: 0.5, ..Seen::new(mesh) };
    let normal = DVec3::new(4.0, 0.0, -1.0).normalize();
    for caster in adapter::casters(&effects) {
        let (scan, _) = seen.scan(caster);
        assert!(scan.len() > 1000);
        let light =
            scan.reflectivity.as_ref().unwrap().iter().zip(scan.intensity.as_ref().unwrap());
        for (position, (byte, intensity)) in scan.positions.iter().zip(light) {
            let beam = DVec3::from_array(position.map(f64::from)).normalize();
            let expected = 0.5 * normal.dot(beam).abs();
            assert!((f64::from(*byte) - 100.0 * expected).abs() <= 0.5 + 1e-4, "{byte}");
            // Position, normal and intensity are rounded to f32.
            assert!((f64::from(*intensity) - expected).abs() < 1e-6, "{intensity}");
        }
    }
}

#[test]
fn a_retro_reflector_is_bright_at_every_incidence() {
    for (retroreflection, expected) in [(1.0, 255), (0.5, 178), (1e-9, 101)] {
        let (scan, _) = Seen { retroreflection, ..Seen::wall(0.1) }.on_cpu(None);
        assert!(scan.reflectivity.as_ref().unwrap().iter().all(|&byte| byte == expected));
        for (range_m, &power) in ranges(&scan).into_iter().zip(scan.power.as_ref().unwrap()) {
            assert!((f64::from(power) * range_m.powi(2) - 1.0).abs() < 3e-7);
        }
    }
}

#[test]
fn returns_below_the_limit_are_lost_and_no_others() {
    // 0.6 x 10 / R^3 against 0.3 / 20^2: R is 20 m at most.
    let effects = Effects { detection: Some(detection(0.3, 20.0)), ..Effects::default() };
    let (all, _) = Seen::wall(0.6).on_cpu(None);
    let near: Vec<[f32; 3]> = all
        .positions
        .iter()
        .zip(ranges(&all))
        .filter(|(_, range_m)| *range_m <= 20.0)
        .map(|(position, _)| *position)
        .collect();
    assert!(near.len() > 1000 && near.len() + 1000 < all.len());
    for caster in adapter::casters(&effects) {
        let (scan, tally) = Seen::wall(0.6).scan(caster);
        assert_eq!(scan.positions, near);
        assert_eq!(
            (tally.points, tally.undetected),
            (near.len() as u64, (all.len() - near.len()) as u64)
        );
    }
}

/// The limit against which the ball returns `ratio` times the least power.
fn of_the_balls_power(ratio: f64) -> Detection {
    detection(0.5, WALL_M * (0.5 * ratio).sqrt())
}

// Facets of the ball lie up to 3e-4 of its radius inside it, and face the sensor within
// 0.02 rad: power differs by 1e-3 at most.
const POWER: f64 = 1e-3;

#[test]
fn a_noisy_threshold_loses_as_many_as_a_normal_distribution_says() {
    let n = Seen::ball().on_cpu(None).0.len() as f64;
    // Phi(5 (ratio - 1)).
    for (ratio, expected) in
        [(1.0, 0.5), (1.2, 0.841_344_7), (0.8, 0.158_655_3), (0.6, 0.022_750_1)]
    {
        let noisy = Detection { threshold_to_noise: Some(5.0), ..of_the_balls_power(ratio) };
        let (scan, tally) = Seen::ball().on_cpu(Some(noisy));
        assert_eq!((tally.points + tally.undetected) as f64, n);
        let share = scan.len() as f64 / n;
        let deviation = (expected * (1.0 - expected) / n).sqrt();
        // The density is 0.4 at most.
        let most = 4.0 * deviation + 0.4 * 5.0 * POWER;
        assert!((share - expected).abs() < most, "{ratio}: {share}");
    }
}

#[test]
fn a_weak_return_is_measured_worse() {
    let clean = ranges(&Seen::ball().on_cpu(None).0);
    for (ratio, expected_m) in [(1.0 + POWER, 0.1), (4.0, 0.05), (1e6, 1e-4)] {
        let weak = Detection { range_sigma_m: Some(0.1), ..of_the_balls_power(ratio) };
        let (scan, _) = Seen::ball().on_cpu(Some(weak));
        let errors = ranges(&scan).into_iter().zip(&clean).map(|(p, q)| p - q);
        let n = clean.len() as f64;
        assert_eq!(scan.len(), clean.len());
        let sigma_m = (errors.map(|error| error * error).sum::<f64>() / n).sqrt();
        // The standard error of a deviation is 1 / sqrt(2n); ranges are stored in f32, 1e-6 m.
        let most = expected_m * (4.0 / (2.0 * n).sqrt() + POWER) + 1e-6;
        assert!((sigma_m - expected_m).abs() < most, "{ratio}: {sigma_m} m");
    }
}

#[test]
fn faces_return_light_as_their_materials_do() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    // A wall 5 m away, white on the left, grey in the middle, a road sign on the right.
    write(
        "wall.obj",
        "v 5 9 -1\nv 5 9 1\nv 5 3 -1\nv 5 3 1\nv 5 -3 -1\nv 5 -3 1\nv 5 -9 -1\n\
         v 5 -9 1\nf 1 2 4 3\nusemtl grey\nf 3 4 6 5\nusemtl sign\nf 5 6 8 7\n",
    );
    write(
        "scene.toml",
        "attributes = [\"intensity\", \"reflectivity\"]\n[effects]\nintensity = true\n\
         [[object]]\nmesh = \"wall.obj\"\nup = \"z\"\nreflectivity = 0.8\n\
         materials = { grey = { reflectivity = 0.25 }, sign = { retroreflection = 1 } }\n\
         [[sensor]]\nprofile = \"vlp16\"\nposition_m = [0, 0, 0]\nyaw_deg = 0\n",
    );
    let scene = Scene::read(folder.path().join("scene.toml")).unwrap();
    let scan = scene.scan_mounted(0).run().unwrap();
    let (intensities, bytes) =
        (scan.intensity.as_ref().unwrap(), scan.reflectivity.as_ref().unwrap());
    let grey = 0.25;
    let mut seen = [0; 3];
    for ((position, intensity), byte) in scan.positions.iter().zip(intensities).zip(bytes) {
        let beam = DVec3::from_array(position.map(f64::from));
        let cosine = beam.x / beam.length();
        let part = usize::from(beam.y < 3.0) + usize::from(beam.y < -3.0);
        let (reflectivity, expected) = match part {
            0 => (0.8, 80.0 * cosine),
            1 => (grey, 100.0 * grey * cosine),
            _ => (1.0, 255.0),
        };
        assert!((f64::from(*intensity) - reflectivity * cosine).abs() < 1e-6, "{position:?}");
        assert!((f64::from(*byte) - expected).abs() <= 0.5 + 1e-4, "{position:?}");
        seen[part] += 1;
    }
    assert!(seen.iter().all(|&n| n > 100), "{seen:?}");
}

#[test]
fn numbers_hold_at_the_extremes() {
    let n = Seen::ball().on_cpu(None).0.len();
    let kept = |detection| Seen::ball().on_cpu(Some(detection)).0.len();
    assert_eq!(kept(detection(f64::MIN_POSITIVE, 1e9)), n, "nothing is too weak");
    assert_eq!(kept(detection(1.0, 1e-150)), 0, "everything is");
    let black = Seen { reflectivity: 0.0, ..Seen::ball() };
    let (scan, tally) = black.on_cpu(Some(detection(1e-300, 1e9)));
    assert_eq!((scan.len(), tally.undetected), (0, n as u64), "black returns nothing");
    let far = Detection { threshold_to_noise: Some(1e-9), ..of_the_balls_power(1.0) };
    let half = kept(far) as f64 / n as f64;
    assert!((half - 0.5).abs() < 4.0 * 0.5 / (n as f64).sqrt(), "noise alone: {half}");
}
