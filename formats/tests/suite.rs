//! Files are read and written as their formats say, a module for each kind.
#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

#[cfg(feature = "cloud-files")]
mod clouds;
#[cfg(all(feature = "cloud-files", feature = "pcap", feature = "weights"))]
mod foreign;
#[cfg(all(feature = "npz", feature = "dataset"))]
mod labelled_sets;
#[cfg(feature = "npz")]
mod numpy;
#[cfg(feature = "pcap")]
mod ouster;
#[cfg(feature = "dataset")]
mod packed_sets;
#[cfg(feature = "dataset")]
mod scan_files;
#[cfg(all(feature = "dataset", feature = "pcap"))]
mod velodyne;
#[cfg(all(feature = "dataset", feature = "pcap"))]
mod vlp32c;
#[cfg(feature = "dataset")]
mod written_bytes;
