//! What a segmentation must be, on scenes of which each point's surface is known, on
//! unusual input, and on real sweeps.

#![expect(clippy::unwrap_used, reason = "tests")]

mod clusters;
mod components;
mod frames;
mod ground;
mod inputs;
mod npz;
mod real_frames;
mod scanner;
mod stream;
