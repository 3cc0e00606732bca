//! Training of PointNet and its Critical Points Layer.
//!
//! Layers carry their own gradients, by hand ([`layer`]), and a step is a
//! forward and backward pass of [`network::PointNet`] and one of [`adam`].

#![deny(unsafe_code)]

pub mod adam;
pub mod augment;
pub mod batch;
pub mod batches;
pub mod beside_random;
pub mod checkpoint;
pub mod chooser;
pub mod clouds;
pub mod error;
pub mod evaluate;
pub mod front;
pub mod gumbel;
pub mod layer;
pub mod lime;
pub mod loss;
pub mod matrix;
pub mod model;
pub mod network;
pub mod parameter;
pub mod recipe;
mod stack;
mod t_net;
pub mod trainer;
