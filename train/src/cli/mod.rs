//! The commands of `edgepuck-train`.

pub mod compare_points;
pub mod eval;
pub mod explain;
mod failure;
pub mod serve;
pub mod train;

use failure::print;
pub use failure::{Usage, exit_code};
