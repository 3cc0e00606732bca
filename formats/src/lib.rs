//! The data types and file formats that the crates of Edgepuck share: scans,
//! clouds, labelled sets, models, and counter-based random numbers.
//!
//! Without features the library holds what a program needs in memory. Features
//! add files:
//!
//! | feature | what |
//! | --- | --- |
//! | `files` | `atomic` writes; clouds (`cloud_file`) as text, NPY and KITTI's `.bin` |
//! | `npz`, `ply`, `pcd`, `las` | clouds in one more format each; `npz` `labelled` sets and sweeps too |
//! | `cloud-files` | all of these |
//! | `dataset` | scans, packed sets, sets of clusters and yanx27's layout, written and read; tars of WebDataset, written |
//! | `pcap` | packets in captures: a VLP-32C's, written (`vlp32c`; whole scans with `dataset` too), and a VLP-16's, VLP-32C's (`velodyne`) or Ouster's (`ouster`), read |
//! | `weights` | models (`weights`) and what they state about themselves (`model_card`) |
//! | `chamfer` | the distance of two clouds (`chamfer`) |
//! | `hdf5` | ModelNet40's HDF5 layout |
//! | `cli` | how programs end (`outcome`) |
//!
//! None of them needs a C compiler for its target.

#![cfg_attr(
    not(all(feature = "dataset", feature = "cloud-files")),
    allow(dead_code, reason = "formats that are left out leave helpers that others share")
)]

#[cfg(feature = "chamfer")]
pub mod chamfer;
pub mod cloud;
#[cfg(feature = "files")]
pub mod cloud_file;
#[cfg(feature = "dataset")]
pub mod clusters;
pub mod error;
pub mod hash;
pub mod interval;
pub mod modelnet_h5_list;
mod named;
pub mod rng;
pub mod scan;
pub mod split;
pub mod trajectory;

#[cfg(feature = "npz")]
mod archive;
#[cfg(feature = "files")]
pub mod atomic;
#[cfg(feature = "pcap")]
mod capture;
#[cfg(feature = "dataset")]
pub mod csv;
#[cfg(feature = "files")]
mod decoding;
#[cfg(feature = "npz")]
pub mod labelled;
#[cfg(feature = "npz")]
pub mod labelled_sweep;
#[cfg(feature = "files")]
mod lines;
#[cfg(feature = "weights")]
pub mod model_card;
#[cfg(feature = "hdf5")]
pub mod modelnet_h5;
#[cfg(feature = "files")]
mod npy;
#[cfg(feature = "files")]
mod number;
#[cfg(feature = "pcap")]
pub mod ouster;
#[cfg(feature = "cli")]
pub mod outcome;
#[cfg(feature = "dataset")]
pub mod packed;
#[cfg(feature = "pcap")]
pub mod pcap;
#[cfg(feature = "ply")]
pub mod ply;
#[cfg(feature = "files")]
mod python_literal;
#[cfg(feature = "files")]
mod records;
#[cfg(feature = "pcap")]
pub mod returns;
#[cfg(feature = "dataset")]
pub mod scan_file;
#[cfg(feature = "pcap")]
pub mod velodyne;
#[cfg(feature = "pcap")]
pub mod vlp32c;
#[cfg(feature = "dataset")]
mod waiting_points;
#[cfg(feature = "dataset")]
pub mod webdataset;
#[cfg(feature = "weights")]
pub mod weights;
#[cfg(feature = "dataset")]
pub mod yanx27;

pub use error::FormatError;
pub use scan::{Attribute, AttributeSet, Scan};
pub use split::Split;

/// The README's example is compiled.
#[cfg(all(doctest, feature = "cloud-files"))]
#[doc = include_str!("../README.md")]
struct Readme;
