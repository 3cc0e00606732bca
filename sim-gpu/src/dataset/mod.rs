//! Datasets: many meshes, seen by sensors from many places, as files.
//!
//! [`config`] says what is wanted, [`pipeline`] makes the scans and keeps a
//! [`journal`] so that a killed run can go on, [`finish`] packs them and
//! writes the manifest.

mod budget;
pub mod config;
pub mod error;
pub mod journal;
pub mod layout;
pub mod pipeline;
mod prepare;
pub mod progress;
pub mod record;
mod under_way;
mod write;

pub use config::{DatasetConfig, SetConfig, Variant, Viewpoints};
pub use error::DatasetError;
pub use record::{Entry, MeshFailure, MeshRecord, ScanRecord, VariantRecord};
