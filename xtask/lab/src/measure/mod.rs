//! What every measurement shares: clocks, machines, backends, meshes and rays.

pub mod backends;
pub mod baseline;
pub mod bench_mesh;
pub mod clock;
pub mod machine;
pub mod methods;
pub mod ray_set;
