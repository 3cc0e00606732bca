//! PointNet behind a Critical Points Layer, without a GPU.

#![deny(unsafe_code)]

pub mod kernel;
pub mod sampler;
