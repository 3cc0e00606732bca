//! The largest sizes of a classifier.

/// The largest capacity, in points.
pub const MOST_POINTS: usize = 1 << 28;

/// The most threads.
pub const MOST_THREADS: usize = 1024;
