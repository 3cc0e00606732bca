//! Datasets: many meshes, seen by sensors from many places, as files.
//!
//! [`config`] says what is wanted, [`pipeline`] makes the scans and keeps a
//! [`journal`] so that a killed run can go on, [`finish`] packs them and
//! writes the manifest, which [`verify`] checks a dataset against. [`merge`]
//! makes one dataset of parts. [`surfaces`] draws what scans are compared with, and
//! [`corrupted`] makes sets in which something goes wrong. [`on_demand`] casts the clouds of a
//! dataset as they are asked for, and writes none; [`tars`] writes them as WebDataset reads them.
//! [`publish`] describes a finished dataset to those who find it.

mod budget;
mod clouds;
pub mod config;
pub mod corrupted;
pub mod difference;
pub mod error;
mod export_layouts;
pub mod finish;
pub mod journal;
pub mod layout;
pub mod manifest;
pub mod merge;
mod mesh;
pub mod on_demand;
mod pack;
pub mod pipeline;
pub mod progress;
pub mod publish;
pub mod record;
pub mod start;
pub mod surfaces;
pub mod tars;
pub mod verify;

pub use config::{DatasetConfig, SetConfig, Variant, Viewpoints};
pub use error::DatasetError;
pub use export_layouts::check_layouts;
pub use manifest::Manifest;
pub use record::{Cloud, Entry, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
