//! The data types and file formats that the crates of Edgepuck share: scans,
//! clouds, labelled sets, models, and counter-based random numbers.
//!
//! Without features the library has the types in memory. Features add files:
//!
//! | feature | what it adds |
//! | --- | --- |
//! | `files` | `atomic` writes; clouds (`cloud_file`) as text, NPY, KITTI's and nuScenes' `.bin` |
//! | `npz`, `ply`, `pcd`, `las` | clouds in one more format each; `npz` `labelled` sets and sweeps too |
//! | `cloud-files` | all of these |
//! | `dataset` | scans, packed sets, sets of clusters and yanx27's layout, written and read; tars of WebDataset, written |
//! | `pcap` | packets in captures: a VLP-32C's, written (`vlp32c`; whole scans with `dataset` too), and a VLP-16's, VLP-32C's (`velodyne`) or Ouster's (`ouster`), read |
//! | `weights` | models (`weights`) and their cards (`model_card`) |
//! | `chamfer` | the Chamfer distance of two clouds (`chamfer`) |
//! | `hdf5` | ModelNet40's HDF5 layout |
//! | `cli` | exit codes and error messages of programs (`outcome`) |
//!
//! None of them needs a C compiler for its target.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![cfg_attr(
    not(all(feature = "dataset", feature = "cloud-files")),
    allow(dead_code, reason = "formats that are left out leave helpers that others share")
)]

#[cfg(feature = "chamfer")]
pub mod chamfer;
pub mod cloud;
#[cfg(feature = "files")]
pub mod cloud_file;
pub mod hash;
#[cfg(feature = "npz")]
pub mod labelled;
#[cfg(feature = "weights")]
pub mod model_card;
#[cfg(feature = "hdf5")]
pub mod modelnet_h5;
#[cfg(feature = "pcap")]
pub mod ouster;
#[cfg(feature = "dataset")]
pub mod packed;
#[cfg(feature = "pcap")]
pub mod pcap;
#[cfg(feature = "pcap")]
pub mod periodic;
pub mod returns;
pub mod rng;
pub mod scan;
#[cfg(feature = "dataset")]
pub mod scan_file;
#[cfg(feature = "pcap")]
pub mod velodyne;
#[cfg(feature = "pcap")]
pub mod vlp32c;
#[cfg(feature = "weights")]
pub mod weights;

// For Edgepuck's other crates; they may change in any version.
#[doc(hidden)]
#[cfg(feature = "files")]
pub mod atomic;
#[doc(hidden)]
pub mod foreign;
#[doc(hidden)]
pub mod interval;
#[doc(hidden)]
#[cfg(feature = "npz")]
pub mod labelled_sweep;
#[doc(hidden)]
pub mod modelnet_h5_list;
#[doc(hidden)]
#[cfg(feature = "files")]
pub mod new_outputs;
#[doc(hidden)]
#[cfg(feature = "cli")]
pub mod outcome;
#[doc(hidden)]
#[cfg(feature = "cli")]
pub mod outputs;
#[doc(hidden)]
#[cfg(feature = "pcap")]
pub mod packets;
#[doc(hidden)]
#[cfg(feature = "ply")]
pub mod ply;
#[doc(hidden)]
#[cfg(feature = "dataset")]
pub mod rows;
#[doc(hidden)]
pub mod split;
pub mod streams;
#[doc(hidden)]
pub mod trajectory;
#[doc(hidden)]
#[cfg(feature = "pcap")]
pub mod turns;
#[doc(hidden)]
#[cfg(feature = "dataset")]
pub mod webdataset;
#[doc(hidden)]
#[cfg(feature = "dataset")]
pub mod yanx27;

#[cfg(feature = "npz")]
mod archive;
#[cfg(feature = "pcap")]
mod capture;
#[cfg(feature = "dataset")]
mod csv;
#[cfg(feature = "files")]
mod decoding;
mod error;
#[cfg(feature = "files")]
mod lines;
mod named;
#[cfg(feature = "files")]
mod npy;
#[cfg(feature = "files")]
mod number;
#[cfg(feature = "files")]
mod python_literal;
#[cfg(feature = "files")]
mod records;

#[cfg(feature = "pcap")]
pub use capture::{ChosenSender, Senders};
pub use error::FormatError;
pub use scan::{Attribute, AttributeSet, Scan};
pub use split::Split;

/// The README's example is compiled.
#[cfg(all(doctest, feature = "cloud-files"))]
#[doc = include_str!("../README.md")]
struct Readme;
