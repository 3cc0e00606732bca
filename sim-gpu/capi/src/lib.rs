//! The C interface of `sim-gpu`, `include/edgepuck_sim.h`: functions that take pointers, check them, and
//! return a status.
//!
//! Doc comments here are for readers of that header, which is generated from them.

mod mesh;
mod pose;
mod scan;
mod scene;
mod sensor;
mod status;

pub use mesh::*;
pub use pose::*;
pub use scan::*;
pub use scene::*;
pub use sensor::*;
pub use status::*;
