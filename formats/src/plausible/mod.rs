//! Whether an input is what its user probably meant: its unit, frame, axes, layout and kind.
//!
//! Readers judge what they read and return [`Warning`]s, which programs show. What cannot be meant at
//! all is an error of the reader instead.

mod foreign;
mod mesh_size;
#[cfg(feature = "poses")]
mod motion;
mod object;
mod sweep;
mod warning;

#[cfg(feature = "mistakes")]
pub use foreign::foreign_toml;
#[cfg(feature = "weights")]
pub(crate) use foreign::or_foreign;
#[cfg(any(feature = "files", feature = "pcap", feature = "poses"))]
pub(crate) use foreign::or_foreign_file;
pub use foreign::{foreign, read_text};
pub use mesh_size::{bounds, effect_on_mesh, mesh_in_scene, mesh_size, unit_of_scanned};
#[cfg(feature = "poses")]
pub use motion::{motion_of, sensor_motion, upside_down};
pub use object::{Unlike, coarse_object, judge_object};
#[cfg(feature = "poses")]
pub use sweep::judge_surroundings;
pub use sweep::{check_sweep, coarse_coordinates, is_lost, judge_sweep};
pub use warning::Warning;
