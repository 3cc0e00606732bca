//! The CPU twins of `shaders/effects/`, in f64.

pub mod dropout;
pub mod intensity;
pub mod noise_range;
pub mod noise_xyz;
pub mod stream;
