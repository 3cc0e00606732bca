//! The Python module `edgepuck._edgepuck`: what the package in `python/edgepuck` is made of.
//!
//! Python's side has the names, the defaults and the documentation. Here, numbers are in the
//! units of the libraries, and whatever takes long runs on the threads of this very process
//! (`process.rs`), without Python's lock.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod arrays;
mod classifier;
mod clouds;
mod detect;
mod error;
mod heights;
mod mesh;
mod models;
mod process;
mod scene;
mod scenes;
mod segment;
mod sensor;

/// What the package in `python/edgepuck` is made of.
#[pyo3::pymodule]
mod _edgepuck {
    #[pymodule_export]
    use super::arrays::{read_points, save_scan};
    #[pymodule_export]
    use super::classifier::Classifier;
    #[pymodule_export]
    use super::clouds::{Clouds, seed_of_epoch};
    #[pymodule_export]
    use super::detect::detect;
    #[pymodule_export]
    use super::error::Error;
    #[pymodule_export]
    use super::heights::read_grey16;
    #[pymodule_export]
    use super::mesh::Mesh;
    #[pymodule_export]
    use super::models::{activation_ranges, read_network, write_weights};
    #[pymodule_export]
    use super::process::{adapters, main, run_command, set_num_threads};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::scenes::Scenes;
    #[pymodule_export]
    use super::segment::segment;
    #[pymodule_export]
    use super::sensor::Sensor;
}
