//! Casts LiDAR beams against triangle meshes.
//!
//! The modules stand in the order in which data flows through them: mesh,
//! BVH, sensor and scene, casting (on a GPU or on the CPU), scan.

pub mod config;
pub mod effects;
pub mod mesh;
pub mod pose;
pub mod scene;
pub mod sensor;
