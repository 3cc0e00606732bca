//! The one crate that every other crate of Edgepuck shares: counter-based
//! random numbers, scans, clouds and packed datasets, and atomic writes.
//!
//! Without features it holds what a program needs in memory. Feature `dataset`
//! adds the files ([`scan_file`], [`packed`], [`yanx27`], [`atomic`]), feature
//! `hdf5` ModelNet40's HDF5 layout (`modelnet_h5`), feature `weights` models
//! (`weights`, `model_card`).

pub mod cloud;
pub mod error;
pub mod hash;
pub mod rng;
pub mod scan;
pub mod split;

#[cfg(feature = "dataset")]
mod archive;
#[cfg(any(feature = "dataset", feature = "weights"))]
pub mod atomic;
#[cfg(feature = "dataset")]
pub mod csv;
#[cfg(feature = "weights")]
pub mod model_card;
#[cfg(feature = "hdf5")]
pub mod modelnet_h5;
#[cfg(feature = "dataset")]
mod npy;
#[cfg(feature = "dataset")]
pub mod npz;
#[cfg(feature = "dataset")]
pub mod packed;
#[cfg(feature = "dataset")]
pub mod ply;
#[cfg(feature = "dataset")]
pub mod scan_file;
#[cfg(feature = "weights")]
pub mod weights;
#[cfg(feature = "dataset")]
pub mod yanx27;

pub use error::FormatError;
pub use scan::{Attribute, AttributeSet, Scan};
pub use split::Split;
