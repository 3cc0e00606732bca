//! Scenes of streets, yards and rooms, as a robot's LiDAR sees them.
//!
//! A [`Recipe`] is a distribution of scenes, read from TOML. [`Scene::draw`] draws
//! one of them by its number; [`Stage::sweep`] scans it whole, ground and objects
//! together; [`label_clusters`] cuts the sweep into clusters by the segmentation
//! that a robot runs, and labels each by what most of its points lie on.
//! [`generate`] does all of it for many scenes and packs the clusters as a
//! training set.
//!
//! The same recipe, seed and number give the same scene, sweep and clusters on
//! every machine, whatever the number of threads.

mod clusters;
mod drive;
mod error;
mod footprint;
mod generate;
mod ground;
mod lanes;
mod place;
mod recipe;
mod scene;
mod stage;
mod street;

#[cfg(test)]
mod tests;

/// The README's example is compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use clusters::{LabelledCluster, OTHER, label_clusters};
pub use drive::{Drive, Packet, Sighting, Sightings};
pub use error::SceneError;
pub use generate::{Counts, Generation, generate};
pub use recipe::{Objects, Place, Recipe, Span};
pub use scene::{PlacedObject, Scene};
pub use stage::{Stage, Sweep};
pub use street::Body;
