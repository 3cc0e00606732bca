//! Model files: their networks, layer by layer, and how kernels need them packed.

mod batch_norm;
pub mod layers;
pub mod network;
pub mod source;
pub mod summary;
