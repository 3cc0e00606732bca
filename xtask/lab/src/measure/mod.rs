//! What every measurement shares: clocks, machines, backends, meshes and rays.

pub mod accuracy;
pub mod clock;
pub mod energy;
pub mod lanes;
pub mod machine;
pub mod moller_trumbore;
pub mod reference_network;
pub mod scenes;
pub mod shot;
pub mod subject;
pub mod subprocess;
pub mod ways;
