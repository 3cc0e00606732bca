//! Datasets whose scans were never cast: finishing, verifying and merging need only files and
//! records that agree.

use edgepuck_dataset::internals::Terms;
use edgepuck_dataset::{
    DatasetConfig, DatasetFolder, Entry, FileRecord, MeshFailure, MeshRecord, ScanRecord,
    SetConfig, Variant, VariantRecord, Viewpoints,
};
use edgepuck_mesh::frame::Up;
use edgepuck_mesh::validate::MeshDefects;
use formats::Split;
use formats::rng::StreamKey;
use formats::scan::{Attribute, Scan};
use formats::scan_file::{ScanFormat, write_scan};
use sim_gpu::Sensor;
use sim_gpu::internals::scan::Tally;
use sim_gpu::internals::sensor::Views;
use std::path::Path;

/// Points of each packed cloud.
pub const PACKED_POINTS: u32 = 32;
/// Points that a scan must have to be packed.
pub const MIN_POINTS: u32 = 16;

/// A rotating sensor with two views and a camera whose one view is jittered, clean and noisy, in
/// all formats of points.
pub fn config() -> DatasetConfig {
    let set = |name: &str, sensor: &str, views: Views| SetConfig {
        name: name.to_owned(),
        sensor: Sensor::named(sensor).expect("a built-in sensor"),
        viewpoints: Viewpoints::Views(views),
    };
    DatasetConfig {
        seed: 7,
        attributes: [Attribute::Normal].into(),
        formats: ScanFormat::ALL.into_iter().filter(|of| *of != ScanFormat::Pcap).collect(),
        variants: vec![Variant::Clean, Variant::Noisy],
        packed_points: PACKED_POINTS,
        min_points: MIN_POINTS,
        layouts: Vec::new(),
        ..DatasetConfig::new(vec![
            set("rotational", "vlp32c", Views { count: 2, ..Views::ROTATING }),
            set("static", "kinect-v2", Views { azimuth_jitter_deg: 10.0, ..Views::STATIC }),
        ])
    }
}

/// The terms of a run on `config`.
pub fn terms(config: DatasetConfig, shard: Option<(u32, u32)>) -> Terms {
    let version = env!("CARGO_PKG_VERSION").to_owned();
    Terms { version, config, adapter: "an adapter".to_owned(), meshes: String::new(), shard }
}

/// A mesh of `class`.
pub fn entry(class: &str, split: Split, name: &str) -> Entry {
    Entry { class: class.to_owned(), split, name: name.to_owned() }
}

/// The failure of a mesh.
pub fn failure(class: &str, split: Split, name: &str) -> MeshFailure {
    MeshFailure {
        entry: entry(class, split, name),
        source: format!("{class}/{split}/{name}.off"),
        line: Some(3),
        cause: "a vertex \"is\" not finite".to_owned(),
    }
}

/// Begins a dataset in `out` and writes the scans of `entries`, as a run that was killed leaves it.
pub fn write(out: &Path, terms: &Terms, entries: &[Entry]) -> Vec<MeshRecord> {
    DatasetFolder(out).write_terms(terms).expect("a journal");
    entries.iter().map(|entry| write_mesh(out, &terms.config, entry)).collect()
}

fn write_mesh(out: &Path, config: &DatasetConfig, entry: &Entry) -> MeshRecord {
    let mut scans = Vec::new();
    for set in &config.sets {
        for view in 0..set.viewpoints.count() as u32 {
            let variants = config.variants.iter();
            let write = |&variant: &Variant| write_variant(out, config, set, entry, view, variant);
            let variants = variants.map(write).collect();
            scans.push(ScanRecord { set: set.name.clone(), view, variants });
        }
    }
    MeshRecord {
        entry: entry.clone(),
        source: format!("{}/{}/{}.off", entry.class, entry.split, entry.name),
        hash: config.hash.of_bytes(entry.name.as_bytes()),
        up: Up::Z,
        centre: [0.1, -0.2, 1e-7],
        views_around: [0.0; 3],
        scale: 1.0 / 3.0,
        triangles: 12,
        dropped_faces: 0,
        defects: MeshDefects::default(),
        scans,
        warnings: Vec::new(),
    }
}

fn write_variant(
    out: &Path,
    config: &DatasetConfig,
    set: &SetConfig,
    entry: &Entry,
    view: u32,
    variant: Variant,
) -> VariantRecord {
    let name = format!("{}/{}/{}/{}", set.name, variant.name(), entry.id(), entry.split);
    let scan = scan(StreamKey::new(config.seed, &name, view));
    let write = |&format: &ScanFormat| {
        let path = out.join(entry.scan_file(&set.name, variant, view, format));
        FileRecord { format, hash: write_scan(&path, format, config.hash, &scan).expect("a scan") }
    };
    VariantRecord {
        variant,
        tally: Tally { points: scan.len() as u64, ..Tally::default() },
        files: config.formats.iter().map(write).collect(),
        cloud: None,
    }
}

/// 0 to 99 points on the x axis, in ascending order, with normals equal to the positions: in a
/// cloud that keeps points and normals together, both ascend together.
fn scan(key: StreamKey) -> Scan {
    let n = key.below(100, 0);
    let positions: Vec<[f32; 3]> = (0..n).map(|i| [i as f32, 0.0, 0.0]).collect();
    Scan { normal: Some(positions.clone()), positions, ..Scan::default() }
}
