//! The surfaces from which shapes are built. Class files import all their tools from here,
//! including the builder and the sampler: those that need many of them as a prelude,
//! `use crate::primitives::*`.

mod block;
mod loft;
pub mod outline;
mod revolve;
mod sheet;
mod spline;
mod sweep;
mod vessel;

#[cfg(test)]
mod tests;

pub use super::builder::Builder;
pub use super::sampler::Sampler;
pub use block::{block, block_between, cushion};
pub use glam::{DAffine3, DVec2, DVec3, dvec2, dvec3};
pub use loft::{cap, cap_start, loft, prism, skin};
pub use revolve::{Profile, Section, cylinder, ellipsoid, frustum};
pub use sheet::{board, sheet};
pub use spline::smooth;
pub use sweep::{bar, rod, smooth_tube, sweep, tube};
pub use vessel::{Vessel, Wall};

pub type Make = fn(&mut Builder, &mut Sampler);

/// The makes of a class or kind, with their weights.
pub type Makes = &'static [(usize, Make)];

/// Builds one of `makes`. A single make draws no random number.
pub fn build_one(makes: Makes, b: &mut Builder, s: &mut Sampler) {
    let make = if let [(_, make)] = makes { *make } else { s.weighted(makes) };
    make(b, s);
}
