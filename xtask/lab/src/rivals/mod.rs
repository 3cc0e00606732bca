//! Comparisons with other programs, which take turns with ours in one run.

pub mod casting;
pub mod infer;
