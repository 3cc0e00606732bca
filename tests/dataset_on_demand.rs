//! Clouds cast on demand equal the packed clouds of a dataset with the same settings.

use edgepuck_dataset::{
    Clouds, DatasetConfig, DatasetError, Plan, Progress, SetConfig, Variant, Viewpoints, make,
    seed_of_epoch,
};
use formats::Split;
use formats::labelled::read_labelled;
use sim_gpu::effects::{Effects, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::tree::{MeshEntry, discover};
use sim_gpu::internals::sensor::{SensorProfile, Views};
use std::path::Path;

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
        sensor: SensorProfile::builtin("vlp32c").expect("a built-in sensor"),
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

fn cpu(clouds: &Clouds) -> OpenCaster {
    OpenCaster::Cpu(clouds.cast_effects())
}

#[test]
fn clouds_on_demand_are_those_of_the_packed_set() {
    let folder = tempfile::tempdir().unwrap();
    let (out, meshes) = (folder.path().join("out"), meshes(&folder.path().join("meshes")));
    let config = settings(seed_of_epoch(7, 2));
    let caster = OpenCaster::Cpu(config.cast_effects());
    let plan = Plan::new(&out, &config, &meshes);
    make(&plan, &caster, &Progress::default()).unwrap();
    let expected = read_labelled(&out.join("packed/rotational-noisy-train.npz")).unwrap();

    let clouds = clouds(&meshes, settings(7), CACHE_BYTES);
    assert_eq!(clouds.len(), expected.len(), "no view of this seed has too few points");
    let all: Vec<usize> = (0..clouds.len()).collect();
    let drawn = clouds.draw(&cpu(&clouds), seed_of_epoch(7, 2), &all).unwrap();
    for (i, found) in drawn.iter().enumerate() {
        assert_eq!(found.label, expected.labels[i] as usize, "{i}");
        assert_eq!(found.points, expected.cloud(i), "{i}");
    }
}

#[test]
fn a_cloud_depends_on_its_number_and_the_seed_alone() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = meshes(folder.path());
    let whole = clouds(&meshes, settings(7), usize::MAX);
    let uncached = clouds(&meshes, settings(7), 0);
    let numbers = [5, 0, 11, 5, 38];
    let together = whole.draw(&cpu(&whole), 7, &numbers).unwrap();
    for (number, together) in numbers.into_iter().zip(together) {
        let [alone] = &uncached.draw(&cpu(&uncached), 7, &[number]).unwrap()[..] else {
            panic!("one cloud was asked for");
        };
        assert_eq!(alone.points, together.points, "{number}");
        let others = whole.draw(&cpu(&whole), 8, &[number]).unwrap();
        assert_ne!(others[0].points, together.points, "{number}");
    }
}

#[test]
fn a_mesh_whose_views_all_have_too_few_points_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let meshes = meshes(folder.path());
    let config = DatasetConfig { min_points: 1 << 20, ..settings(7) };
    let clouds = clouds(&meshes, config, CACHE_BYTES);
    match clouds.draw(&cpu(&clouds), 7, &[3]) {
        Err(error @ DatasetError::Sparse { .. }) => {
            let text = error.to_string();
            assert!(text.starts_with("airplane/train/airplane_"), "{text}");
            assert!(text.contains("expected a view of at least 1048576 points"), "{text}");
        }
        other => panic!("{:?}", other.map(|clouds| clouds.len())),
    }
}
