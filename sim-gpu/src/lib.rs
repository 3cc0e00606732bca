//! Casts LiDAR beams against triangle meshes.
//!
//! ```no_run
//! use sim_gpu::{Caster, Mesh, Pose, Scene, Sensor};
//!
//! let mut scene = Scene::new();
//! // A mesh (OBJ, OFF, PLY, STL or glTF), scaled to the unit sphere around the origin.
//! scene.add(Mesh::read("chair.obj")?.unit_sphere(), Pose::IDENTITY);
//! // A sensor 3 m away, 20 degrees above the horizon, that looks at the origin.
//! let sensor = Sensor::named("vlp32c")?;
//! let pose = Pose::looking_at_origin_deg(3.0, 20.0, 0.0);
//! // The best GPU that there is, or else the CPU.
//! let scan = scene.scan(&sensor, pose).with(&Caster::auto()).run()?;
//! println!("{} points", scan.len());
//! scan.save("scan.npz")?;
//! # Ok::<(), sim_gpu::Error>(())
//! ```
//!
//! [`Mesh`] and [`Sensor`] go into a [`Scene`], a [`Caster`] makes a [`Scan`] of it, and
//! [`Effects`] say what the scan models beyond ideal ranges.
//!
//! # Features
//! `gpu` casts on GPUs and software Vulkan, through wgpu. `simplify` simplifies meshes, which takes
//! a C++ compiler. `textures` reads reflectivities from images.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod aim;
mod api;
mod bvh;
mod cast_error;
mod caster;
mod config;
mod corruption;
mod cpu;
pub mod effects;
mod fixed_frame;
#[cfg(feature = "gpu")]
mod gpu;
mod import;
mod job;
mod lanes;
mod material;
mod mesh;
mod motion;
mod packets;
mod pose;
mod ray;
mod resolve;
mod scan;
mod scene;
mod sensor;
mod simplify;
mod surface_points;
mod target;
mod weather;

pub use api::{
    Batch, BatchBuilder, Caster, Error, Instance, InstanceId, Mesh, MountedSensor, Moves,
    NO_OBJECT, Scan, ScanBuilder, Scene, Sensor,
};
#[doc(hidden)]
pub use api::{Extent, FilePlace};
pub use effects::Effects;
pub use formats;
pub use formats::scan::Attribute;
pub use glam;
pub use import::Import;
pub use material::Materials;
pub use pose::{Pose, Trajectory};
pub use scan::{Glass, Tally};

/// The errors that [`Error`] holds.
pub mod errors {
    pub use crate::cast_error::CastError;
    pub use crate::config::{ConfigError, InvalidValue};
    pub use crate::material::MaterialError;
    pub use crate::mesh::{MeshError, ParseError};
    pub use crate::simplify::NotBuilt;
}

/// What Edgepuck's own crates, tests and measurements use beyond the types at the root. It is not
/// stable: any release may change it.
#[doc(hidden)]
pub mod internals {
    macro_rules! modules {
        ($($name:ident)*) => {
            $(
                pub mod $name {
                    pub use crate::$name::*;
                }
            )*
        };
    }

    modules! {
        bvh cast_error caster config corruption cpu import job material mesh motion packets pose ray resolve
        scan scene sensor simplify surface_points target weather
    }

    #[cfg(feature = "gpu")]
    modules! { gpu }
}

/// The README's example is compiled.
#[cfg(all(doctest, feature = "gpu"))]
#[doc = include_str!("../README.md")]
struct Readme;
