//! Training of PointNet and its Critical Points Layer, on any CPU.
//!
//! Layers compute their own gradients ([`layer`]). A step is a forward and
//! backward pass of [`network::PointNet`] and a step of [`adam`]. A
//! [`run::Job`] takes a [`recipe::Recipe`] and clouds to a model file that
//! infer-cpu reads.

#![deny(unsafe_code)]

pub mod accuracy_report;
pub mod adam;
pub mod augment;
pub mod batch;
pub mod batches;
pub mod calibration;
pub mod checkpoint;
pub mod clouds;
pub mod cluster;
pub mod cpl;
mod draws;
pub mod error;
pub mod evaluate;
pub mod explanation_drawing;
pub mod gumbel;
pub mod init;
pub mod layer;
pub mod lime;
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
pub mod run;
pub mod selector;
pub mod shape;
mod svg_text;
mod t_net;
pub mod trainer;

/// The README's example is compiled.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
