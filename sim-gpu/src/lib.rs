//! Casts LiDAR beams against triangle meshes.
//!
//! The modules stand in the order in which data flows through them: mesh,
//! BVH, target, sensor and scene, casting (on a GPU or on the CPU), scan,
//! packets.

pub mod bvh;
pub mod cast_error;
pub mod caster;
pub mod config;
pub mod cpu;
pub mod effects;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod job;
pub mod mesh;
pub mod packets;
pub mod pose;
pub mod ray;
pub mod resolve;
pub mod scan;
pub mod scene;
pub mod sensor;
pub mod simplify;
pub mod surface_points;
pub mod target;

pub use formats;
pub use glam;
pub use scan::{scan, scan_many};
