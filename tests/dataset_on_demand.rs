//! Clouds cast on demand equal the packed clouds of a dataset with the same settings.

use edgepuck_dataset::{
    Begin, Clouds, DatasetConfig, DatasetError, DatasetFolder, MeshEntry, Normalize, Plan, Poses,
    Progress, SetConfig, Variant, Viewpoints, Views, discover, make, seed_of_epoch, verify,
};
use formats::Split;
use formats::labelled::read_labelled;
use formats::scan::Attribute;
use formats::scan_file::read_scan;
use glam::DVec3;
use sim_gpu::effects::{Effects, Noise, NoiseModel};
use sim_gpu::{Caster, Sensor};
use std::path::Path;
use tests::tree::assert_same;

const CACHE_BYTES: usize = 1 << 20;

fn settings(seed: u64) -> DatasetConfig {
    let noise = Noise { mean_m: 0.0, sigma_m: 0.02, model: NoiseModel::Range };
    let views = Views {
        count: 2,
        distance_to_m: Some(6.0),
        elevation_deg: -20.0,
        elevation_to_deg: Some(60.0),
        azimuth_jitter_deg: 180.0,
        ..Views::ROTATING
    };
    let set = SetConfig {
        name: "rotational".to_owned(),
        sensor: Sensor::named("vlp32c").expect("a built-in sensor"),
        viewpoints: Viewpoints::Views(views),
    };
    DatasetConfig {
        seed,
        effects: Effects { noise: Some(noise), ..Effects::default() },
        variants: vec![Variant::Noisy],
        packed_points: 32,
        min_points: 16,
        ..DatasetConfig::new(vec![set])
    }
}

fn meshes(folder: &Path) -> Vec<MeshEntry> {
    edgepuck_shapes::write_tree(folder, 3, 2, 1).expect("meshes are written");
    discover(folder, 0).expect("meshes are there")
}

fn clouds(meshes: &[MeshEntry], config: DatasetConfig, cache_bytes: usize) -> Clouds {
    Clouds::new(config, meshes, Some(Split::Train), cache_bytes).expect("a dataset")
}

#[test]
fn clouds_on_demand_are_those_of_the_packed_set() {
    let folder = tempfile::tempdir().unwrap();
    let (out, meshes) = (folder.path().join("out"), meshes(&folder.path().join("meshes")));
    let config = settings(seed_of_epoch(7, 2));
    let plan = Plan::new(&out, &config, &meshes);
    make(&plan, &Caster::cpu(), &Progress::default()).unwrap();
    let expected = read_labelled(&out.join("packed/rotational-noisy-train.npz")).unwrap();

    let clouds = clouds(&meshes, settings(7), CACHE_BYTES);
    assert_eq!(clouds.len(), expected.len(), "no view of this seed has too few points");
    let all: Vec<usize> = (0..clouds.len()).collect();
    let drawn = clouds.draw(&Caster::cpu(), seed_of_epoch(7, 2), &all, &[]).unwrap();
    for (i, found) in drawn.iter().enumerate() {
        assert_eq!(clouds.label(i), expected.labels[i] as usize, "{i}");
        assert_eq!(found, expected.cloud(i).as_flattened(), "{i}");
    }

    // An attribute is that of its point: the cloud is its beams' points, moved and scaled.
    let mut config = settings(7);
    config.attributes.insert(Attribute::Beam);
    let clouds = self::clouds(&meshes, config, CACHE_BYTES);
    let with_beams = clouds.draw(&Caster::cpu(), 7, &[3], &[Attribute::Beam]).unwrap();
    let scan = clouds.scan_each(&Caster::cpu(), 7, &[3]).unwrap().remove(0).unwrap();
    let rows: Vec<[DVec3; 2]> = with_beams[0]
        .chunks_exact(4)
        .map(|row| {
            let beams = scan.beam.as_ref().unwrap();
            let at = beams.iter().position(|&beam| beam as f32 == row[3]).unwrap();
            [[row[0], row[1], row[2]], scan.positions[at]].map(|p| DVec3::from(p.map(f64::from)))
        })
        .collect();
    let lengths = [0, 1].map(|which: usize| -> Vec<f64> {
        rows.iter().map(|row| row[which].distance(rows[0][which])).collect()
    });
    let scale = lengths[1].iter().sum::<f64>() / lengths[0].iter().sum::<f64>();
    for (drawn, seen) in lengths[0].iter().zip(&lengths[1]) {
        assert!((scale * drawn - seen).abs() < 1e-5, "{drawn} {seen}");
    }
}

/// The journal of a run that was interrupted at its end, and a mesh that was changed since.
#[test]
fn a_mesh_that_changes_before_a_run_goes_on_is_scanned_again() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (meshes, config) = (meshes(&at("meshes")), settings(7));
    let run = |out: &Path, begin| {
        let plan = Plan { begin, ..Plan::new(out, &config, &meshes) };
        make(&plan, &Caster::cpu(), &Progress::default()).unwrap()
    };
    let before = run(&at("out"), Begin::Fresh);
    let out = at("out");
    DatasetFolder(&out).write_terms(&before.terms()).unwrap();
    before.meshes.iter().for_each(|record| DatasetFolder(&out).note(record).unwrap());
    std::fs::copy(&meshes[9].path, &meshes[0].path).unwrap();
    run(&at("out"), Begin::Resume);
    run(&at("anew"), Begin::Fresh);
    assert_same(&at("out"), &at("anew"));
}

#[test]
fn a_cloud_depends_on_its_number_and_the_seed_alone() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = meshes(folder.path());
    let whole = clouds(&meshes, settings(7), usize::MAX);
    let uncached = clouds(&meshes, settings(7), 0);
    let numbers = [5, 0, 11, 5, 38];
    let together = whole.draw(&Caster::cpu(), 7, &numbers, &[]).unwrap();
    for (number, together) in numbers.into_iter().zip(together) {
        let [alone] = &uncached.draw(&Caster::cpu(), 7, &[number], &[]).unwrap()[..] else {
            panic!("one cloud was asked for");
        };
        assert_eq!(*alone, together, "{number}");
        let others = whole.draw(&Caster::cpu(), 8, &[number], &[]).unwrap();
        assert_ne!(others[0], together, "{number}");
    }
}

#[test]
fn each_epoch_has_a_seed_of_its_own_and_the_first_that_of_the_training() {
    let mut seeds: Vec<u64> = (0..1000).map(|epoch| seed_of_epoch(7, epoch)).collect();
    assert_eq!(seeds[0], 7);
    seeds.extend((1..1000).map(|epoch| seed_of_epoch(8, epoch)));
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 1999);
}

#[test]
fn a_mesh_whose_views_all_have_too_few_points_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = meshes(folder.path());
    let config = DatasetConfig { min_points: 1 << 20, ..settings(7) };
    let clouds = clouds(&meshes, config, CACHE_BYTES);
    match clouds.draw(&Caster::cpu(), 7, &[3], &[]) {
        Err(error @ DatasetError::Sparse { .. }) => {
            let text = error.to_string();
            assert!(text.starts_with("airplane/train/airplane_"), "{text}");
            assert!(text.contains("expected a view of at least 1048576 points"), "{text}");
        }
        other => panic!("{:?}", other.map(|clouds| clouds.len())),
    }
}

#[test]
fn a_mesh_that_is_not_normalized_stays_where_its_file_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let class = folder.path().join("meshes/box/train");
    std::fs::create_dir_all(&class).unwrap();
    // Corners at 9 and 11, -1 and 1, 20 and 22: the sensor stands around (10, 0, 21).
    let centre = DVec3::new(10.0, 0.0, 21.0);
    std::fs::write(class.join("box_1.off"), unit_cube_at(centre)).unwrap();
    let meshes = discover(&folder.path().join("meshes"), 0).unwrap();
    let mut config = settings(0);
    config.normalize = Normalize::None;
    config.effects = Effects::default();
    config.variants = vec![Variant::Clean];
    let out = folder.path().join("out");
    let manifest =
        make(&Plan::new(&out, &config, &meshes), &Caster::cpu(), &Progress::default()).unwrap();
    assert!(verify(&out).unwrap().is_sound());
    assert_eq!((manifest.meshes[0].centre, manifest.meshes[0].scale), ([0.0; 3], 1.0));
    let Poses::EachMesh(poses) = &manifest.poses[0].poses else { panic!("one list for all") };
    let drawn = clouds(&meshes, config, CACHE_BYTES);
    for (pose, view) in poses[0].poses.iter().zip(0..) {
        let distance_m = pose.position_m.distance(centre);
        assert!((Views::ROTATING.distance_m..=6.0).contains(&distance_m), "{distance_m}");
        let file = out.join(format!("rotational/clean/box/train/box_1_v{view}.npz"));
        let scan = read_scan(&file).unwrap();
        assert!(!scan.is_empty());
        for point in &scan.positions {
            let point = DVec3::from_array(scan.origin) + DVec3::from(point.map(f64::from)) - centre;
            // f32 resolves 2e-6 m at 30 m.
            assert!((point.abs().max_element() - 1.0).abs() < 1e-5, "{point}");
        }
        let on_demand = drawn.scan_each(&Caster::cpu(), 0, &[view]).unwrap().remove(0).unwrap();
        assert_eq!(on_demand.positions, scan.positions);
    }
}

/// An OFF file of a cube with sides of 2 m.
fn unit_cube_at(centre: DVec3) -> String {
    let mut off = "OFF\n8 6 0\n".to_owned();
    for i in 0..8 {
        let corner = DVec3::new((i & 1).into(), (i >> 1 & 1).into(), (i >> 2).into());
        let [x, y, z] = (centre + 2.0 * corner - 1.0).to_array();
        off += &format!("{x} {y} {z}\n");
    }
    off + "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"
}
