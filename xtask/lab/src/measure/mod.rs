//! What every measurement shares: clocks, machines, backends, meshes and rays.

pub mod accuracy;
pub mod baseline;
pub mod clock;
pub mod energy;
pub mod lanes;
pub mod machine;
pub mod methods;
pub mod reference_network;
pub mod scenes;
pub mod shot;
pub mod subject;
pub mod subprocess;
