//! Trains PointNet and its Critical Points Layer on any CPU.
//!
//! [`run::Job`] trains a network on clouds by a [`recipe::Recipe`], and writes a model file that
//! infer-cpu reads. A training step is a forward and backward pass of [`network::PointNet`], whose
//! layers compute their own gradients ([`layer`]), and an update by [`adam::Adam`].

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![deny(unsafe_code)]

pub mod accuracy_report;
pub mod adam;
pub mod augment;
pub mod batch;
pub mod batches;
pub mod calibration;
pub mod checkpoint;
#[doc(hidden)]
pub mod cli;
pub mod clouds;
mod cluster;
pub mod cluster_variation;
pub mod cpl;
mod critical_points;
mod draws;
pub mod error;
pub mod evaluate;
pub mod explanation_drawing;
pub mod init;
pub mod layer;
pub mod lime;
mod limits;
pub mod loss;
pub mod matrix;
pub mod metrics;
mod mlp;
pub mod model;
pub mod model_file;
pub mod negatives;
pub mod network;
pub mod object_report;
pub mod parameter;
pub mod point_encoder;
pub mod random_baseline;
pub mod recipe;
pub mod rows;
pub mod run;
pub mod set_network;
pub mod shape;
mod svg;
mod t_net;
pub mod trainer;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
