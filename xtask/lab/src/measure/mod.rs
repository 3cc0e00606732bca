//! What every measurement shares: clocks, machines, backends, meshes and rays.

pub mod accuracy;
pub mod backends;
pub mod baseline;
pub mod bench_mesh;
pub mod clock;
pub mod energy;
pub mod machine;
pub mod methods;
pub mod ray_set;
pub mod reference_network;
pub mod scenes;
pub mod subprocess;
