//! Datasets of LiDAR scans: many meshes, scanned by sensors from many viewpoints.
//!
//! [`make()`] writes a dataset of files and a manifest, and resumes a run that was interrupted;
//! [`make_tars`] writes the clouds as tars for WebDataset, on many machines. [`verify()`] checks a
//! dataset against its manifest, [`merge()`] makes one dataset of parts, and [`publish()`] writes a
//! card and metadata for it. [`Clouds`] casts the same clouds on demand, without files.
//!
//! ```
//! use edgepuck_dataset::{DatasetConfig, Plan, Progress, SetConfig, discover, make, verify};
//! use sim_gpu::{Caster, Sensor};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = std::env::temp_dir().join(format!("edgepuck-dataset-{}", std::process::id()));
//! # std::fs::create_dir_all(folder.join("meshes/cup/train"))?;
//! # let cup = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 1\n3 0 1 2\n";
//! # std::fs::write(folder.join("meshes/cup/train/cup_1.off"), cup)?;
//!
//! let sensor = Sensor::named("generic-static")?;
//! let config = DatasetConfig::new(vec![SetConfig::new("static", sensor)]);
//!
//! let meshes = discover(&folder.join("meshes"), config.seed)?;
//! let out = folder.join("dataset");
//! let plan = Plan::new(&out, &config, &meshes);
//! let manifest = make(&plan, &Caster::auto(), &Progress::default())?;
//! assert_eq!(manifest.packed[0].file, "packed/static-clean-train.npz");
//! assert!(verify(&out)?.is_sound());
//! # std::fs::remove_dir_all(folder)?;
//! # Ok(())
//! # }
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod budget;
mod clouds;
mod config;
mod difference;
mod error;
mod finish;
mod folder;
mod make;
mod manifest;
mod merge;
mod mesh;
mod on_demand;
mod pack;
mod pipeline;
mod plan;
mod progress;
mod publish;
mod record;
mod settings;
mod tars;
mod verify;
mod view;

pub use config::{DatasetConfig, Layout, SetConfig, Variant, Viewpoints};
pub use error::DatasetError;
pub use folder::DatasetFolder;
pub use make::make;
pub use manifest::{LeftOut, Manifest, MeshPoses, PackedRecord, Poses, SetPoses};
pub use merge::merge;
pub use on_demand::{Clouds, seed_of_epoch};
pub use plan::{Begin, Plan};
pub use progress::{Progress, Stage};
pub use publish::{Publication, publish};
pub use record::{Entry, FileRecord, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
pub use settings::{Around, noisy, read_effects};
pub use tars::{Cut, HandOver, PartManifest, PartRecord, Sample, TarRecord, Tars, make_tars};
pub use verify::{Problem, Report, verify};

// The types of the settings that are not of this crate.
pub use edgepuck_mesh::frame::{Normalize, Unit, Up};
pub use edgepuck_mesh::tree::{MeshEntry, discover};
pub use formats::hash::Hashing;
pub use formats::scan_file::ScanFormat;
pub use formats::vlp32c::Returns;
pub use sim_gpu::sensors::Views;

/// Parts of the library for Edgepuck's programs and tests, which may change in any version.
#[doc(hidden)]
pub mod internals {
    pub use crate::finish::finish;
    pub use crate::merge::{Part, check_parts, link};
    pub use crate::plan::Terms;
}
