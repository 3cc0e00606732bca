//! Casts LiDAR beams against triangle meshes.
//!
//! ```no_run
//! use sim_gpu::caster::{AdapterRequest, Caster};
//! use sim_gpu::effects::Effects;
//! use sim_gpu::formats::hash::Hashing;
//! use sim_gpu::formats::scan_file::{ScanFormat, write_scan};
//! use sim_gpu::glam::DVec3;
//! use sim_gpu::mesh::frame::Normalize;
//! use sim_gpu::pose::Pose;
//! use sim_gpu::scan::ScanRequest;
//! use sim_gpu::sensor::Sensor;
//! use sim_gpu::target::Target;
//! use std::path::Path;
//!
//! // A mesh (OBJ, OFF, PLY or STL), scaled to the unit sphere around the origin.
//! let target = Target::load(Path::new("chair.obj"), Normalize::UnitSphere)?;
//! // A sensor by name, or by the path of a TOML profile, and its beams.
//! let sensor = Sensor::resolve("vlp32c")?;
//! let pattern = sensor.pattern();
//! // The sensor stands at (3, 0, 1) metres and looks at the origin.
//! let pose = Pose::look_at(DVec3::new(3.0, 0.0, 1.0), DVec3::ZERO)?;
//! // The best GPU there is, or else the CPU; `Caster::Cpu` needs no driver.
//! let caster = Caster::open(&AdapterRequest::Auto, &Effects::default())?;
//!
//! let scan = sim_gpu::scan(&caster, &target, &ScanRequest::new(&sensor, &pattern, pose))?;
//! println!("{} points", scan.positions.len());
//! write_scan(Path::new("scan.npz"), ScanFormat::Npz, Hashing::None, &scan)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The modules stand in the order in which data flows through them: mesh,
//! BVH, target, sensor and scene, casting (on a GPU or on the CPU), scan,
//! packets.

mod aim;
pub mod bvh;
pub mod cast_error;
pub mod caster;
pub mod config;
pub mod corruption;
pub mod cpu;
pub mod effects;
mod fixed_frame;
#[cfg(feature = "gpu")]
pub mod gpu;
pub mod job;
mod lanes;
pub mod material;
pub mod mesh;
pub mod motion;
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
pub mod weather;

pub use formats;
pub use glam;
pub use scan::{scan, scan_many};
