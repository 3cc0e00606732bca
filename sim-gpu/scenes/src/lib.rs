//! Streets, yards and rooms as the LiDAR of a robot sees them.
//!
//! A [`Recipe`] is a distribution of scenes, read from TOML. [`DrawnScene::draw`] draws one scene by
//! its number. [`Stage::sweep`] scans the whole scene, ground and objects together;
//! [`Stage::build`] returns it as a [`sim_gpu::Scene`] for other scans.
//! [`label_clusters`] takes the clusters that the robot's segmentation found in the sweep, and
//! labels each with the class of the object that most of its points lie on. [`generate`] does all
//! of this for many scenes and packs the clusters as a training set. A [`Drive`] moves a sensor
//! along an endless street and returns its packets.
//!
//! The same recipe, seed and number give the same scene, sweep and clusters on every machine,
//! with any number of threads.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod boxes;
mod clusters;
mod drive;
mod error;
mod footprint;
mod generate;
mod ground;
mod lanes;
mod model;
mod place;
mod placed_object;
mod recipe;
mod scene;
mod sector;
mod sightings;
mod stage;
mod street;
mod sway;
mod sweep;

#[cfg(test)]
mod tests;

/// The README's example is compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use boxes::ObjectBox;
pub use clusters::{LabelledCluster, label_clusters};
pub use drive::{AIR, Drive, Packet};
pub use error::SceneError;
pub use generate::{ClusterCounts, LabelledScene, generate, is_test, place_in_set};
pub use placed_object::PlacedObject;
pub use recipe::{Ground, Mount, OTHER, Objects, Place, Recipe, SensorChoice, Span};
pub use scene::DrawnScene;
pub use sightings::{Sighting, Sightings};
pub use stage::Stage;
pub use street::StreetObject;
pub use sweep::Sweep;
