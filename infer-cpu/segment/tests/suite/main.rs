//! Segmentations of scenes with a known surface for each point, of unusual input, and of real
//! sweeps.

#![expect(clippy::unwrap_used, reason = "tests")]

mod claims;
mod clusters;
mod components;
mod frames;
mod ground;
mod inputs;
mod real_frames;
mod scanner;
