//! What stands on pavements and in yards.

mod bench;
mod bin;
mod clutter;
mod cone;

pub use bench::build as bench;
pub use bin::build as bin;
pub use clutter::build as clutter;
pub use cone::build as cone;
