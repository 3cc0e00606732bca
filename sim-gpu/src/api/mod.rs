//! The types that the root shows, over the modules that do the work.

mod batch;
mod caster;
mod error;
mod extent;
mod import;
mod mesh;
mod scan;
mod scan_builder;
mod scene;
mod scene_file;
mod sensor;

pub use batch::{Batch, BatchBuilder, Moves, NO_OBJECT};
pub use caster::Caster;
pub use error::Error;
pub use extent::Extent;
pub use import::FilePlace;
pub use mesh::Mesh;
pub use scan::Scan;
pub use scan_builder::ScanBuilder;
pub use scene::{Instance, InstanceId, MountedSensor, Scene};
pub use sensor::Sensor;
