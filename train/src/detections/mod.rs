//! What a detector finds of labelled objects: by class, range and number of points, how precisely, and
//! for how long under one number.
//!
//! `frames` pairs detections and truth, `judge` says which are right, `precision` and `tracks` have the
//! metrics of nuScenes and HOTA, and `report` prints them.

mod frames;
mod judge;
mod precision;
mod report;
mod tracks;

pub use frames::read;
pub use report::{table, to_svg};
