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
//! | `dataset` | scans, packed sets, sets of clusters, written and read; tars of WebDataset, written |
//! | `pcap` | packets in captures: a VLP-32C's, written (`vlp32c`; whole scans with `dataset` too), and a VLP-16's, VLP-32C's (`velodyne`) or Ouster's (`ouster`), read |
//! | `poses` | poses alone and over time (`geometry`), and trajectories read (`trajectory`) |
//! | `mistakes` | all that is wrong with a file in TOML (`mistakes`) |
//! | `weights` | models (`weights`) and their cards (`model_card`) |
//!
//! None of them needs a C compiler for its target.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]
#![cfg_attr(
    not(all(feature = "dataset", feature = "cloud-files")),
    allow(dead_code, reason = "formats that are left out leave helpers that others share")
)]

#[cfg(feature = "boxes")]
pub mod boxes;
pub mod cloud;
#[cfg(feature = "files")]
pub mod cloud_file;
#[doc(hidden)]
pub mod geometry;
pub mod hash;
#[cfg(feature = "npz")]
pub mod labelled;
#[cfg(feature = "weights")]
pub mod model_card;
#[cfg(feature = "pcap")]
pub mod ouster;
#[cfg(feature = "dataset")]
pub mod packed;
#[cfg(feature = "pcap")]
pub mod pcap;
#[cfg(feature = "pcap")]
pub mod periodic;
pub mod plausible;
#[cfg(all(feature = "dataset", feature = "pcap"))]
pub mod points_file;
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
pub mod interval;
#[doc(hidden)]
#[cfg(feature = "npz")]
pub mod labelled_sweep;
#[doc(hidden)]
#[cfg(feature = "mistakes")]
pub mod mistakes;
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
#[cfg(feature = "poses")]
pub mod trajectory;
#[doc(hidden)]
#[cfg(feature = "pcap")]
pub mod turns;
pub mod unit;
#[doc(hidden)]
#[cfg(feature = "dataset")]
pub mod webdataset;

#[cfg(feature = "npz")]
mod archive;
#[cfg(feature = "pcap")]
mod capture;
mod counted;
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
#[doc(hidden)]
pub use counted::counted;
pub use error::{FormatError, InvalidValue};
pub use scan::{Attribute, AttributeSet, Scan};
pub use split::Split;

/// The README's example is compiled.
#[cfg(all(doctest, feature = "cloud-files"))]
#[doc = include_str!("../README.md")]
struct Readme;
