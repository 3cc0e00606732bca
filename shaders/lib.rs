//! The WGSL sources of Edgepuck's shaders, as text.
//!
//! `sim-gpu` joins those that a scan needs. Each pass has a counterpart of the
//! same name under `sim-gpu/src/cpu`.

/// The entry point: one ray per invocation.
pub const TRACE: &str = include_str!("trace.wgsl");
/// The search for the nearest triangle along a ray.
pub const TRAVERSE: &str = include_str!("traverse.wgsl");
/// The watertight test of a ray against a triangle.
pub const INTERSECT: &str = include_str!("intersect.wgsl");
/// The records of a bounding volume hierarchy.
pub const BVH: &str = include_str!("shared/bvh.wgsl");
/// The records of a ray and of what it meets.
pub const RAY: &str = include_str!("shared/ray.wgsl");
/// Counter-based random numbers.
pub const STREAM: &str = include_str!("shared/stream.wgsl");
/// A normal deviate from random bits.
pub const NORMAL_DEVIATE: &str = include_str!("shared/normal_deviate.wgsl");
/// The buffer that effects write to.
pub const WORDS: &str = include_str!("shared/words.wgsl");
/// Gaussian error of the range.
pub const NOISE_RANGE: &str = include_str!("effects/noise_range.wgsl");
/// Gaussian error of each coordinate.
pub const NOISE_XYZ: &str = include_str!("effects/noise_xyz.wgsl");
/// Lost returns.
pub const DROPOUT: &str = include_str!("effects/dropout.wgsl");
/// Intensity of a return.
pub const INTENSITY: &str = include_str!("effects/intensity.wgsl");
