//! The WGSL sources of Edgepuck's shaders, as text.
//!
//! `sim-gpu` joins those that a scan needs. Each pass has a counterpart of the
//! same name under `sim-gpu/src/cpu`.

/// The entry point: one ray per invocation.
pub const TRACE: &str = include_str!("trace.wgsl");
/// Rays from a sensor's beams.
pub const AIM: &str = include_str!("aim.wgsl");
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
pub const EFFECT_OUTPUTS: &str = include_str!("shared/effect_outputs.wgsl");

/// The effects: the name of each one's function, and its source.
pub const EFFECTS: [(&str, &str); 4] = [
    ("noise_range", include_str!("effects/noise_range.wgsl")),
    ("noise_xyz", include_str!("effects/noise_xyz.wgsl")),
    ("dropout", include_str!("effects/dropout.wgsl")),
    ("intensity", include_str!("effects/intensity.wgsl")),
];
