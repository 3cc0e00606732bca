//! The surfaces that shapes are put together from.

pub mod block;
pub mod loft;
pub mod outline;
pub mod revolve;
pub mod sheet;
pub mod spline;
pub mod sweep;
pub mod vessel;

#[cfg(test)]
mod measure;
