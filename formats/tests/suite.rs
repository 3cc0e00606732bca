//! Files are read and written as their formats say, a module for each kind.

#[cfg(feature = "cloud-files")]
mod clouds;
#[cfg(all(feature = "npz", feature = "dataset"))]
mod labelled_sets;
#[cfg(feature = "hdf5")]
mod modelnet_h5;
#[cfg(feature = "dataset")]
mod packed_sets;
#[cfg(feature = "dataset")]
mod scan_files;
#[cfg(feature = "pcap")]
mod vlp32c;
#[cfg(feature = "dataset")]
mod written_bytes;
