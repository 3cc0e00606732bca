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
//! `gpu` casts on GPUs and software Vulkan, through wgpu.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

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
mod job;
mod lanes;
mod motion;
pub mod packets;
mod pose;
mod ray;
mod resolve;
mod scan;
mod scene;
mod sensor;
mod target;
mod weather;

pub use api::{
    Batch, BatchBuilder, Caster, Error, Instance, InstanceId, Mesh, MountedSensor, Moves,
    NO_OBJECT, Scan, ScanBuilder, Scene, Sensor,
};
#[doc(hidden)]
pub use api::{Extent, FilePlace};
pub use edgepuck_mesh::import::Import;
pub use edgepuck_mesh::material::Materials;
pub use effects::Effects;
pub use formats::plausible::Warning;
pub use formats::scan::Attribute;
pub use glam;
pub use pose::{Pose, Trajectory};
pub use scan::{Glass, Tally};

/// The columns of [`Scan::points`](Scan), and the attributes that name them.
pub mod columns {
    pub use formats::scan::{Attribute, AttributeSet, Column, Scan};
}

/// Profiles of sensors, as [`Sensor::read`] takes them, and the beams that they describe.
pub mod sensors {
    pub use crate::sensor::{
        Beam, BeamPattern, DetectionLimit, Layout, Rotating, SensorProfile, TypicalNoise, Views,
        builtin_names,
    };
}

/// Files of settings in TOML: reading and checking them, with messages that name lines and keys.
pub mod settings {
    pub use crate::config::{all, parse, read, within};
}

/// Files of scenes and of poses, and the limits of what they hold.
pub mod scene_files {
    pub use crate::pose::load_poses;
    pub use crate::scene::{SceneFile, SceneObject, SceneSensor, check_object};
}

/// The adapters of this machine.
#[cfg(feature = "gpu")]
pub mod adapters {
    pub use crate::gpu::{AdapterKind, AdapterSummary, list_adapters};
}

/// What weather and faults do to scans that a real sensor recorded.
pub mod recorded {
    pub use crate::corruption::{Corruption, Recorded};
    pub use crate::weather::{Air, Fates, Medium, in_weather};
}

/// The errors that [`Error`] holds.
pub mod errors {
    pub use crate::cast_error::CastError;
    pub use crate::config::{ConfigError, InvalidValue};
    pub use crate::scan::ScanError;
    pub use edgepuck_mesh::material::MaterialError;
    pub use edgepuck_mesh::{MeshError, ParseError};
    pub use formats::FormatError;
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
        bvh cast_error caster config corruption cpu job motion packets pose ray resolve
        scan scene sensor target weather
    }

    #[cfg(feature = "gpu")]
    modules! { gpu }
}

/// The README's example is compiled.
#[cfg(all(doctest, feature = "gpu"))]
#[doc = include_str!("../README.md")]
struct Readme;
