//! Random numbers belong to what they are drawn for: scans that differ in the seed, the set, the
//! mesh, the view, the sensor, the object or the time have noise that does not correlate, and scans
//! that are equal in all of them have the same.

use edgepuck_dataset::{
    DatasetConfig, Plan, Progress, SetConfig, Variant, Viewpoints, discover, make,
};
use formats::labelled::read_labelled;
use formats::scan::Attribute;
use formats::scan_file::read_scan;
use glam::DVec3;
use sim_gpu::effects::{Effects, Noise};
use sim_gpu::internals::sensor::SensorProfile;
use sim_gpu::{Caster, Mesh, Pose, Scan, Scene, Sensor};
use std::num::NonZeroU32;
use test_support::assert_uncorrelated;
use tests::meshes::{icosphere, mapped};

/// The noise of each beam, by beam.
type Residuals = Vec<f64>;

fn noise() -> Effects {
    Effects { noise: Some(Noise::along_range(0.02)), ..Effects::default() }
}

fn sensor() -> Sensor {
    let few = NonZeroU32::new(8).unwrap();
    Sensor::from(SensorProfile::builtin("vlp32c").unwrap().decimated(few))
}

fn pairs(a: &[f64], b: &[f64]) -> Vec<[f64; 2]> {
    a.iter().zip(b).map(|(a, b)| [*a, *b]).collect()
}

/// That no two of these have noise in common, also if one is shifted by a beam.
fn assert_independent(all: &[(String, Residuals)]) {
    for (i, (name, own)) in all.iter().enumerate() {
        assert_uncorrelated(&format!("{name}: next beam"), &pairs(&own[1..], own));
        for (other, others) in &all[i + 1..] {
            assert_uncorrelated(&format!("{name} and {other}"), &pairs(own, others));
        }
    }
}

fn ranges(scan: &formats::Scan) -> Vec<f64> {
    scan.range_m.as_ref().unwrap().iter().map(|&range_m| range_m.into()).collect()
}

fn residuals(noisy: &formats::Scan, clean: &formats::Scan) -> Residuals {
    assert_eq!(noisy.beam, clean.beam);
    ranges(noisy).iter().zip(ranges(clean)).map(|(noisy, clean)| noisy - clean).collect()
}

/// The inside of a ball, which every beam meets.
fn ball() -> Mesh {
    Mesh::try_from(mapped(&icosphere(3), |p| p * 30.0)).unwrap()
}

/// A scene of balls of these names. Only the first is met.
fn world(names: &[Option<&str>]) -> Scene {
    let mut scene = Scene::new();
    scene.effects = noise();
    let mesh = ball();
    for name in names {
        let id = scene.add(&mesh, Pose::IDENTITY);
        scene[id].name = name.map(str::to_owned);
    }
    scene
}

#[test]
fn scans_of_other_seeds_sensors_objects_and_times_have_other_noise() {
    let sensor = sensor();
    let alone = world(&[None]);
    let clean = alone.scan(&sensor, Pose::IDENTITY).effects(Effects::default()).run().unwrap();
    let scan = || alone.scan(&sensor, Pose::IDENTITY);
    let with_sensor = |number: usize| {
        let mut scene = alone.clone();
        for name in ["roof", "rear", "roof"] {
            scene.mount(name, &sensor, Pose::IDENTITY);
        }
        scene.scan_mounted(number).run().unwrap()
    };
    // A ball far away has number 0, so that the one that is met has number 1.
    let second = || {
        let mut scene = world(&[None, None]);
        let far = scene.ids().next().unwrap();
        scene[far].pose = Pose::at([500.0, 0.0, 0.0]);
        scene
    };
    let named = |name| world(&[Some(name)]).scan(&sensor, Pose::IDENTITY).run().unwrap();
    let all: Vec<(&str, Scan)> = vec![
        ("seed 0", scan().run().unwrap()),
        ("seed 1", scan().seed(1).run().unwrap()),
        ("seed 2^32", scan().seed(1 << 32).run().unwrap()),
        ("at 0.1 s", scan().start_s(0.1).run().unwrap()),
        ("at 0.2 s", scan().start_s(0.2).run().unwrap()),
        ("sensor 0", with_sensor(0)),
        ("sensor 1", with_sensor(1)),
        ("sensor 2 of the name of sensor 0", with_sensor(2)),
        ("object a", named("a")),
        ("object b", named("b")),
        ("object 1", second().scan(&sensor, Pose::IDENTITY).run().unwrap()),
    ];
    let of = |(name, scan): &(&str, Scan)| ((*name).to_owned(), residuals(scan, &clean));
    assert_independent(&all.iter().map(of).collect::<Vec<_>>());
    // The same again, after others.
    assert_eq!(scan().run().unwrap().points, all[0].1.points);
    assert_eq!(named("b").points, all[9].1.points);
}

/// Two sets of the same sensor and poses, of two meshes of the same shape, in two views of the same
/// pose.
fn equal_views(seed: u64) -> DatasetConfig {
    let pose = Pose::look_at(DVec3::new(0.0, 0.0, 0.1), DVec3::X).unwrap();
    let set = |name: &str| SetConfig {
        name: name.to_owned(),
        sensor: sensor(),
        viewpoints: Viewpoints::Poses(vec![pose; 2]),
    };
    DatasetConfig {
        seed,
        effects: noise(),
        variants: vec![Variant::Clean, Variant::Noisy],
        attributes: [Attribute::Range, Attribute::Beam].into(),
        packed_points: 512,
        ..DatasetConfig::new(vec![set("a"), set("b")])
    }
}

#[test]
fn clouds_of_other_seeds_sets_meshes_and_views_have_other_noise_and_other_points() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = folder.path().join("meshes");
    for name in ["one", "two"] {
        let path = meshes.join(format!("ball/train/{name}.off"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        edgepuck_shapes::write_off(&icosphere(3), &path).unwrap();
    }
    let (mut noisy, mut packed) = (Vec::new(), Vec::new());
    for seed in [0, 1] {
        let (out, config) = (folder.path().join(format!("out{seed}")), equal_views(seed));
        let found = discover(&meshes, 0).unwrap();
        let plan = Plan::new(&out, &config, &found);
        make(&plan, &Caster::cpu(), &Progress::default()).unwrap();
        for set in ["a", "b"] {
            let scan = |variant: &str, mesh: &str, view: u32| {
                let name = format!("{set}/{variant}/ball/train/{mesh}_v{view}.npz");
                read_scan(&out.join(name)).unwrap()
            };
            for (mesh, view) in [("one", 0), ("one", 1), ("two", 0), ("two", 1)] {
                let residuals = residuals(&scan("noisy", mesh, view), &scan("clean", mesh, view));
                noisy.push((format!("seed {seed}, set {set}, {mesh}, view {view}"), residuals));
            }
            let set = read_labelled(&out.join(format!("packed/{set}-clean-train.npz"))).unwrap();
            packed.extend((0..set.len()).map(|i| set.cloud(i).to_vec()));
        }
    }
    assert_independent(&noisy);

    // The clean scans are equal, so that clouds differ only by which points were drawn.
    assert_eq!(packed.len(), 16);
    for (i, own) in packed.iter().enumerate() {
        assert!(!packed[i + 1..].contains(own), "cloud {i} is drawn again");
    }
}
