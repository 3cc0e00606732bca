//! Casts LiDAR beams against triangle meshes.
//!
//! The modules stand in the order in which data flows through them: mesh,
//! BVH, sensor and scene, casting (on a GPU or on the CPU), scan.

pub mod mesh;
pub mod shapes;
